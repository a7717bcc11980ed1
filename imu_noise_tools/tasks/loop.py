# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Go on with a study on disk, and tell what changed between two."""

from __future__ import annotations

from collections.abc import Callable
import importlib

import numpy as np

from .. import store
from ..core import files
from ..core.errors import InputError
from ..loop.study import Study

BEYOND = 3.0  # standard deviations
# Where the files of a domain's study are made.
_OUTPUTS = {'noise': 'noise', 'calibration': 'calibration', 'filter': 'filter'}


def change(folder, what: Callable[[Study], object]) -> tuple[Study, object]:
    """Load a study, do something to it, rewrite all of its files; return it and what came back."""
    study = store.load(folder)
    result = what(study)
    files.replace_files(folder, outputs(study, folder))
    return study, result


def outputs(study: Study, folder) -> dict[str, str | bytes]:
    """Return all files of a study of any domain by name; ``folder`` is what the page names."""
    module = importlib.import_module(f'{__package__}.{_OUTPUTS[study.domain]}')
    return module.outputs(study, folder)


def compare_two(first: Study, second: Study) -> list[dict]:
    """
    Return what differs between two studies of one domain, target by target.

    Motor off and on, say, or cold and warm.

    Every parameter that both models hold is compared by value and interval; for noise, the spectra
    too, in a few bands.

    Raises
    ------
    InputError
        The studies have no target in common.

    """
    targets = [t for t in first.targets if t in second.targets]
    if first.domain != second.domain or not targets:
        raise InputError(
            'the two studies have no axis in common', 'compare two studies of the same kind'
        )
    out = []
    for t in targets:
        a, b = first.states[t], second.states[t]
        for label in a.model.labels:
            for name, x in a.fit.estimates.get(label, {}).items():
                y = b.fit.estimates.get(label, {}).get(name)
                if y is not None:
                    out.append(_of_estimates(t, f'{label}.{name}', x, y))
        for label in set(a.model.labels) ^ set(b.model.labels):
            out.append(
                {
                    'target': t,
                    'what': label,
                    'first': 'in the model' if label in a.model else '-',
                    'second': 'in the model' if label in b.model else '-',
                    'sigmas': '',
                    'verdict': 'only in one model',
                }
            )
        if first.domain == 'noise':
            out += _of_spectra(t, a.problem.evidence, b.problem.evidence)
    return out


def _of_estimates(target, what, x, y):
    row = {
        'target': target,
        'what': what,
        'first': _shown(x),
        'second': _shown(y),
        'sigmas': '',
        'verdict': 'not to be told',
    }
    if x.value is not None and y.value is not None and x.std and y.std:
        sigmas = (y.value - x.value) / float(np.hypot(x.std, y.std))
        row.update(
            sigmas=f'{sigmas:+.1f}', verdict='changed' if abs(sigmas) > BEYOND else 'the same'
        )
    elif (x.value is None) != (y.value is None):
        seen, hidden = (x, y) if x.value is not None else (y, x)
        if seen.ci95 and hidden.upper95 is not None:
            row['verdict'] = 'changed' if seen.ci95[0] > hidden.upper95 else 'the same'
    return row


def _shown(e):
    return (
        f'{e.value:.4g} +- {e.std:.2g}'
        if e.value is not None and e.std
        else f'{e.value:.4g}'
        if e.value is not None
        else f'< {e.upper95:.3g}'
        if e.upper95 is not None
        else '?'
    )


def _of_spectra(target, a, b, bands=6):
    """
    Compare measured power in bands of frequency.

    The ln of a mean of w chi-squared has variance 2/w.

    """
    low = max(a.whole.bins.f[0], b.whole.bins.f[0])
    high = min(a.whole.bins.f[-1], b.whole.bins.f[-1])
    edges = np.geomspace(low, high, bands + 1)
    out = []
    for f0, f1 in zip(edges, edges[1:]):
        logs = []
        for e in (a, b):
            some = (e.whole.bins.f >= f0) & (e.whole.bins.f <= f1)
            w = e.whole.bins.count[some]
            if not w.sum():
                break
            p = e.whole.power[some] + e.whole.lines[:, some].sum(axis=0)
            # relative power against a smooth line through the band, so that a slope does not weigh
            logs.append((float(np.sum(w * np.log(np.maximum(p, 1e-300))) / w.sum()), 2 / w.sum()))
        if len(logs) == 2:
            sigmas = (logs[1][0] - logs[0][0]) / np.sqrt(logs[0][1] + logs[1][1] + 2 * 0.002)
            out.append(
                {
                    'target': target,
                    'what': f'power {f0:.3g} to {f1:.3g} Hz',
                    'first': '1',
                    'second': f'{np.exp(logs[1][0] - logs[0][0]):.3g}',
                    'sigmas': f'{sigmas:+.1f}',
                    'verdict': 'changed' if abs(sigmas) > BEYOND else 'the same',
                }
            )
    return out
