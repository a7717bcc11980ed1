# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether what is loud for a while dies out, or keeps one level as long as it lasts.

A knock is loudest when it comes, and dies out: of whitened samples the variance is 1 + A
e^(-2t/tau) from a moment on. Noise that is louder while something runs, and outliers in bursts,
end as they began: the variance is 1 or A. Both have a beginning, a length and a size, so that
their likelihoods tell.

"""

import numpy as np

CELLS = 48  # at least, in which the power is looked at, unless there are fewer samples
LENGTHS = 14  # time constants that are tried, half a cell to all of them
FREE_LEVELS = 8  # of parts of what is at one level, which say whether it is
TURNS = 4  # in which levels and course are found
STEPS = 8  # of Fisher's scoring


def lasting(w: np.ndarray) -> tuple[float, float, int]:
    """
    Return what speaks for one level that comes and goes, and what against.

    Parameters
    ----------
    w : ndarray (n,)
        Whitened samples of variance 1 around what is loud, as many before it and behind.

    Returns
    -------
    float
        Nats by which it is likelier than what dies out.
    float
        Nats by which levels that are free in parts of it are likelier than the one.
    int
        How many more levels these are.

    """
    degrees = max(1, len(w) // CELLS)
    count = len(w) // degrees
    power = np.mean(w[:count * degrees].reshape(count, degrees) ** 2, axis=1)
    gain, inside = _of_one_level(power, degrees)
    parts = [x for x in np.array_split(power[inside], FREE_LEVELS) if len(x)]
    free = 0.5 * degrees * (_log_mean(power[inside]) - sum(_log_mean(x) for x in parts))
    return gain - _of_dying(power, degrees), free, len(parts) - 1


def _of_one_level(power: np.ndarray, degrees: int) -> tuple[float, np.ndarray]:
    """
    Return the nats of the likeliest course between 1 and one other level, and where it is there.

    What comes and goes once is not paid for, each time more at what its two moments cost.

    """
    n = len(power)
    total = np.concatenate([[0.0], np.cumsum(power)])
    i, j = np.triu_indices(n + 1, 1)
    level = np.maximum((total[j] - total[i]) / (j - i), 1.0)
    k = int(np.argmax((j - i) * (level - 1 - np.log(level))))
    inside = (np.arange(n) >= i[k]) & (np.arange(n) < j[k])
    best = -np.inf, inside
    for _ in range(TURNS):
        level = max(float(np.mean(power[inside])), 1.0)
        cost = 0.5 * degrees * np.column_stack([power, np.log(level) + power / level])
        switches = np.count_nonzero(np.diff(inside, prepend=False, append=False))
        gain = np.sum((cost[:, 0] - cost[:, 1])[inside]) - np.log(n) * (switches - 2)
        best = max(best, (float(gain), inside), key=lambda x: x[0])
        inside = course(cost, np.log(n))
        if not np.any(inside):
            break
    return best


def _of_dying(power: np.ndarray, degrees: int) -> float:
    """Return the nats of the likeliest power that is there at once and dies out."""
    n, best = len(power), 0.0
    since = np.arange(n) - np.arange(n)[:, None]    # of each beginning
    for tau in np.geomspace(0.5, n, LENGTHS):
        mean = 0.5 * tau * -np.expm1(-2 / tau)      # over the first cell
        form = np.where(since >= 0, mean * np.exp(-2 * np.maximum(since, 0) / tau), 0.0)
        size = np.maximum(form @ (power - 1) / np.sum(form**2, axis=1), 0.1)[:, None]
        for _ in range(STEPS):
            v = 1 + size * form
            share = 1 - 1 / v
            step = np.sum(share * (power / v - 1), axis=1) / np.sum(share**2, axis=1)
            size = size * np.exp(np.clip(step, -1, 1))[:, None]
        v = 1 + size * form
        best = max(best, float(np.max(np.sum(power - power / v - np.log(v), axis=1))))
    return 0.5 * degrees * best


def _log_mean(power: np.ndarray) -> float:
    """Return the sum over cells (k,) of the logarithm of their mean power."""
    return len(power) * float(np.log(max(np.mean(power), 1e-300)))


def course(cost: np.ndarray, switch: float) -> np.ndarray:
    """Return in which of two states, (n,) bool, each block is, of least total cost (n, 2)."""
    best, came = cost[0].copy(), np.zeros((len(cost), 2), int)
    for k in range(1, len(cost)):
        stay, change = best, best[::-1] + switch
        came[k] = np.where(change < stay, [1, 0], [0, 1])
        best = np.minimum(stay, change) + cost[k]
    state = [int(np.argmin(best))]
    for k in range(len(cost) - 1, 0, -1):
        state.append(int(came[k, state[-1]]))
    return np.array(state[::-1], bool)
