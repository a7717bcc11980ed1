# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Views of samples one by one: how they are distributed, and those that defects have of their own.

``distribution`` compares how many are in each cell with what a model says of its noise.

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import ndtr, ndtri

from .evidence import Evidence
from .in_time import modulated, pooled, power_in_time
from .kinds import Defect, model_tails, Modulation
from .views import hidden_by, muted_by, nothing, view_of
from ..loop.effect import Fit, Model, registry, View


def distribution(evidence: Evidence, fit: Fit) -> View:
    """Return the whitened samples in equiprobable cells beside the normal distribution."""
    if hidden_by(evidence, fit, 'distribution'):
        return nothing('distribution', 'quantile')
    cells = evidence.cells_of(fit.model).astype(float)
    # cells narrower than a few steps of the output would show the converter's own unevenness
    sigma = np.sqrt(np.median(evidence.whole.power[-20:]) / (2 * evidence.dt))
    merge = int(
        np.clip(2 ** np.ceil(np.log2(max(50 * evidence.resolution / max(sigma, 1e-300), 1))), 1, 4)
    )
    cells = cells.reshape(-1, merge).sum(axis=1)
    total, k = cells.sum(), len(cells)
    share, fitted = cell_shares(evidence, fit.model, cells)
    pull = (cells - share * total) / np.sqrt(share * total * (1 - share))
    # mean and spread were taken from the samples: three degrees of freedom are gone
    excess = pull**2 - (k - 3 - fitted) / (k - 1)
    view = view_of(
        'distribution', (np.arange(k) + 0.5) / k, pull, excess, np.full(k, 2.0), 'quantile'
    )
    return replace(view, muted=muted_by(fit, 'distribution'))


def cell_shares(evidence: Evidence, model: Model, cells: np.ndarray) -> tuple[np.ndarray, int]:
    """
    Return (shares, fitted): what a model expects in each of the equiprobable cells (k,).

    More in the tails of a mix, and where a defect says that the samples have such; ``fitted`` is
    how many values were fitted to them besides their mean and spread.

    """
    k, tails = len(cells), model_tails(model, evidence)
    scale = np.ones(1)
    if model.of(Modulation):
        t, x, w = power_in_time(evidence, model)
        scale = np.sqrt(pooled(modulated(model, t, x, w), w))
        scale /= np.sqrt(np.mean(scale**2))
    if tails is not None:
        return tails.fitted(cells, scale)[0], int(np.isfinite(tails.degrees))
    inner = ndtri(np.arange(1, k) / k)
    below = np.mean(ndtr(inner[:, None] / scale), axis=1)
    return np.diff(np.concatenate([[0.0], below, [1.0]])), 0


def of_nats(name: str, t: np.ndarray, nats: np.ndarray, part: str, known: bool) -> View:
    """
    Return the view of a part of what samples say at times t (k,), s, for what a model has or not.

    ``nats`` (k,) of them, of which the first half is of the first half of the record; where it is
    ``known`` to the model nothing is left.

    """
    half = len(t) // 2
    here = {'first': slice(half), 'second': slice(half, None)}.get(part, slice(None))
    pull = np.sqrt(2 * nats[here]) * (not known)
    return View(name, t[here], pull, float(np.mean(pull**2)), float(np.sqrt(2 / len(pull))), 's')


def of_samples(evidence: Evidence, part: str, fit: Fit) -> list[View]:
    """Return the views of a part that defects have of their own (:meth:`Defect.held_out`)."""
    found = (cls.held_out(evidence, part, fit) for cls in registry('noise').values()
             if issubclass(cls, Defect))
    return [view for view in found if view is not None]
