# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Values for samples that were lost, such as keep the spectrum of those that were not.

What is interpolated is smoother than what was measured: of white noise the mean of both neighbours
has half the variance and goes with them, so that the slow half of the spectrum rises and the fast
one falls, as behind a filter. So each value is drawn as the samples beside it have it: about their
level, with the mean and variance that the covariances of the column give it (simple kriging), one
after the other, each beside those that are drawn already (sequential Gaussian simulation: Deutsch
and Journel, GSLIB, 1998, V.2). Drift is in the level, lines and filters are in the covariances.

"""

from __future__ import annotations

import numpy as np

from ..core.statistics import grid_step

REACH = 8  # samples on either side that a value is drawn from; as many lost in a row are drawn
STRETCHES, LENGTH = 64, 4096  # that tell the covariances, and their samples
USUAL = 0.75  # share of them, by their variance, that tells: a knock is in few
BLOCK, WIDE = 128, 8  # samples in a block, and blocks on either side, whose mean is the level
_ROUNDS = 8  # of making covariances such as noise has
_LEAST = 1e-6  # of the greatest variance of any sum of samples, that is in every one


def drawn(x: np.ndarray, there: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """
    Return a column (n,) with what is lost in it drawn; ``there`` (n,) tells which samples are not.

    What is there stays. More than ``REACH`` in a row, and at the ends, stay as they are in ``x``.

    """
    out = np.array(x, float)
    lost = _short(there)
    cov = _covariances(out, there)
    if not len(lost) or not cov[0] > 0:
        return out
    noise = rng.standard_normal(len(lost))
    level = _levels(out, there)[lost // BLOCK]
    after = np.zeros(len(lost), np.int64)       # which of those after it are known, bit by bit
    for k in range(1, REACH + 1):
        after |= there[lost + k].astype(np.int64) << (k - 1)
    alone = np.diff(lost, prepend=-REACH - 1) > REACH
    alone &= after == (1 << REACH) - 1
    weights = {p: _weights(cov, p) for p in np.unique(after).tolist()}
    around = np.r_[-REACH:0, 1:REACH + 1]
    w, std = weights.get((1 << REACH) - 1, (np.zeros(2 * REACH), 0.0))
    some = level[alone]
    out[lost[alone]] = some + (out[lost[alone, None] + around] - some[:, None]) @ w \
        + std * noise[alone]
    for i, p, m, e in zip(*(z[~alone].tolist() for z in (lost, after, level, noise))):
        w, std = weights[p]
        out[i] = m * (1 - np.sum(w)) + w[:REACH] @ out[i - REACH:i] \
            + w[REACH:] @ out[i + 1:i + 1 + REACH] + std * e
    known = out[there]
    step = grid_step(known)[0]
    if step > 0:
        out[lost] = known[0] + step * np.round((out[lost] - known[0]) / step)
    return out


def _short(there: np.ndarray) -> np.ndarray:
    """Return the indices of what is lost in short runs, and not at an end."""
    lost = np.flatnonzero(~there)
    run = np.cumsum(np.diff(lost, prepend=-2) > 1) - 1
    lost = lost[np.bincount(run)[run] <= REACH] if len(lost) else lost
    return lost[(lost >= REACH) & (lost < len(there) - REACH)]


def _levels(x: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the mean of what is known around each block of samples, (blocks,)."""
    begins = np.arange(0, len(x), BLOCK)
    total = np.add.reduceat(np.where(there, x, 0.0), begins)
    count = np.add.reduceat(there.astype(float), begins)
    around = np.ones(2 * WIDE + 1)
    wide = [np.convolve(z, around)[WIDE:WIDE + len(begins)] for z in (total, count)]
    return wide[0] / np.maximum(wide[1], 1.0)


def _covariances(x: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return those of samples about their level, 0 to 2 REACH apart, (2 REACH + 1,)."""
    begins = np.linspace(0, max(len(x) - LENGTH, 0), max(1, min(STRETCHES, len(x) // LENGTH)))
    out = np.zeros((len(begins), 2 * REACH + 1))
    for row, i in zip(out, begins.astype(int)):
        y, known = x[i:i + LENGTH], there[i:i + LENGTH]
        y = np.where(known, y - np.repeat(_levels(y, known), BLOCK)[:len(y)], 0.0)
        for k in range(2 * REACH + 1):
            row[k] = y[k:] @ y[:len(y) - k] / max(np.sum(known[k:] & known[:len(y) - k]), 1)
    unusual = np.argsort(np.abs(out[:, 0] - np.median(out[:, 0])))
    return _possible(np.mean(out[unusual[:int(np.ceil(USUAL * len(out)))]], axis=0))


def _possible(cov: np.ndarray) -> np.ndarray:
    """
    Return covariances (k,) that some noise has, near those given.

    Each is of other pairs of samples, and together they may leave a negative variance to some sum:
    what is drawn by such grows without end.

    """
    apart = np.abs(np.subtract.outer(np.arange(len(cov)), np.arange(len(cov))))
    count = np.bincount(apart.ravel())
    for _ in range(_ROUNDS):
        size, sums = np.linalg.eigh(cov[apart])
        least = _LEAST * size[-1]
        if size[0] >= least:
            return cov
        near = sums * np.maximum(size, least) @ sums.T
        cov = np.bincount(apart.ravel(), near.ravel()) / count
    return cov + (apart[0] == 0) * max(least - np.linalg.eigvalsh(cov[apart])[0], 0.0)


def _weights(cov: np.ndarray, after: int) -> tuple[np.ndarray, float]:
    """Return the weights (2 REACH,) of samples before and after, and the deviation of the rest."""
    some = np.r_[-REACH:0, [k + 1 for k in range(REACH) if after >> k & 1]].astype(int)
    right = cov[np.abs(some)]
    found = np.linalg.solve(cov[np.abs(some[:, None] - some)], right)
    out = np.zeros(2 * REACH + 1)
    out[some + REACH] = found
    return np.delete(out, REACH), float(np.sqrt(max(cov[0] - found @ right, 0.0)))
