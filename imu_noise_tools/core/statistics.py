# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statistics that everything shares: 95 % intervals, robust scales, the grid of samples."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.special import chdtr, chdtrc, digamma, gammaincinv, ndtr, ndtri, polygamma

#: standard deviations within which, and below which, 95 % of a normal distribution lies
TWO_SIDED, ONE_SIDED = 1.959963984540054, 1.6448536269514722
#: 99.5 %, 95 % and 90 % of chi-squared with one degree of freedom: half of it is how many nats a
#: log-likelihood falls at zero where an amplitude is surely there, at the ends of a 95 % interval,
#: and at a one-sided 95 % limit
CHI2_995, CHI2_95, CHI2_90 = 7.879438576622417, 3.841458820694124, 2.705543454095404
MEDIAN = 0.4549     # of chi-squared with one degree of freedom
MAD = 1.482602218505602         # standard deviation over median absolute deviation, if normal
LEVELS = 4096       # of a grid, at most
FAR = (101, 149, 211)  # samples: longer than any hold
LENGTHS = 3, 50     # of equal samples, that rounding makes seldom and a sensor holds
FEWEST_RUNS = 5     # of one length
STRETCH, STRETCHES = 500, 16    # samples whose noise is looked at, at least, and how many such
QUIET, SHOWN = 0.25, 0.5    # quantile of them that is quiet; deviations in a step that shows


def interval(value: Any, std: Any, positive: bool = False) -> tuple[Any, Any]:
    """
    Return (low, high), within which 95 % of what is normal about a value lies.

    Of what is ``positive``, low is not below zero.

    """
    low, high = value - TWO_SIDED * std, value + TWO_SIDED * std
    return (max(low, 0.0), high) if positive else (low, high)


def level_below(level: float, count: float) -> float:
    """
    Return the deviance at the upper end of a variance that so many normal values tell.

    Of many a squared normal deviation, the ``level``, is the deviance where the variance is too
    small by chance as often as that deviation is exceeded on one side. Of k it is
    k (r - 1 - ln r), k r the quantile of chi-squared_k of the same chance, and more.

    """
    k = max(count, 1.0)
    r = 2 / k * float(gammaincinv(0.5 * k, ndtr(-np.sqrt(level))))
    return float(k * (r - 1 - np.log(r)))


def sum_of_squares(y: np.ndarray) -> float:
    """
    Return y @ y of y (n,), without a copy.

    By pieces too short for OpenBLAS to spread over threads (it does from 10 000; on a busy machine
    they cost thirty times what they bring).

    """
    return float(sum(some @ some for some in (y[i:i + 8192] for i in range(0, len(y), 8192))))


def means_of_blocks(y: np.ndarray, length: int) -> np.ndarray:
    """Return the means of blocks of so many of y (n,), one after the other; a rest is left out."""
    count = len(y) // length
    return np.asarray(np.asarray(y, float)[:count * length].reshape(count, length).mean(axis=1))


def row_medians(rows: np.ndarray) -> np.ndarray:
    """Return the median of each row (n, k), finite: numpy's takes three times as long."""
    ordered, half = np.sort(rows, axis=1), rows.shape[1] // 2
    if rows.shape[1] % 2:
        return np.array(ordered[:, half])
    return np.asarray(0.5 * (ordered[:, half - 1] + ordered[:, half]))


def median_of(x: np.ndarray) -> float:
    """
    Return the median of x (n,), finite: of some dozens numpy's takes five times as long.

    Of one long series this is quicker than :func:`row_medians`, of many short ones that.

    """
    half = len(x) // 2
    if len(x) % 2:
        return float(np.partition(x, half)[half])
    low, high = np.partition(x, (half - 1, half))[half - 1:half + 1]
    return float(0.5 * (low + high))


def median_sigma(x: np.ndarray, axis: int | None = None) -> Any:
    """
    Return the standard deviation of what is normal about zero, from the median of its size.

    In the unit of x, of its shape without ``axis``.

    """
    return MAD * np.median(np.abs(x), axis=axis)


def quantile_sigma(x: np.ndarray, share: float, axis: int | None = None, *,
                   keepdims: bool = False) -> Any:
    """
    Return the standard deviation of x about zero if its middle ``share`` is normal.

    In the unit of x, of its shape without ``axis``.

    """
    size = np.quantile(np.abs(x), share, axis=axis, keepdims=keepdims)
    return size / ndtri(0.5 + share / 2)


def gamma_excess(x: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """
    Return (excess, variance) of each bin, x = measured / model power of w coefficients.

    w (x - ln x - 1) less its expectation w (ln(w/2) - psi(w/2)) for x ~ chi^2_w/w; its variance is
    w^2 psi'(w/2) - 2 w.

    """
    w = np.maximum(w, 0.5)
    x = np.maximum(x, 1e-300)
    return (
        w * (x - np.log(x) - 1) - w * (np.log(w / 2) - digamma(w / 2)),
        np.maximum(w**2 * polygamma(1, w / 2) - 2 * w, 0),
    )


def gamma_pull(x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return nearly standard normal pulls (b,) of x ~ chi^2_w/w (Wilson and Hilferty 1931)."""
    spread = 2 / (9 * np.maximum(w, 0.5))
    return (np.cbrt(x) - (1 - spread)) / np.sqrt(spread)


def gamma_pull_exact(x: np.ndarray, w: np.ndarray) -> np.ndarray:
    """
    Return the standard normal pull of x ~ chi^2_w/w, (b,).

    That of :func:`gamma_pull` and, where it says more than 2.5, the exact one: of few degrees of
    freedom the upper tail of the cube root is a thousand times too thin at 4.

    """
    w = np.maximum(w, 0.5)
    pull = np.array(gamma_pull(x, w))
    far = (np.abs(pull) > 2.5) & (np.abs(pull) < 12)
    if far.any():
        some, tail, n = pull[far], (w * x)[far], w[far]
        p = np.where(some > 0, chdtrc(n, tail), chdtr(n, tail))
        pull[far] = np.where(p > 1e-300, np.sign(some) * -ndtri(np.maximum(p, 1e-300)), some)
    return pull


def middle_sigma(x: np.ndarray) -> float:
    """
    Return the standard deviation of a normal distribution with the middle nine tenths of x (n,).

    In the unit of x; 0 of none.

    """
    some = np.abs(x[:: max(1, len(x) // 200_000)])
    count = int(0.9 * len(some))
    if not count:
        return 0.0
    middle = np.partition(some, count)[:count]
    return float(np.sqrt(np.mean(middle**2) / 0.623))  # the variance between -1.645 and 1.645


def robust_sigma(y: np.ndarray) -> float:
    """
    Return the standard deviation of the fast part of y (n,), in its unit.

    It is that of neighbouring differences, over sqrt(2), without up to a twentieth that stand far
    out.

    """
    d = np.diff(y)
    far = 6 * middle_sigma(d)
    if 0 < far < max(np.max(d), -np.min(d)):
        inside = np.abs(d) <= far
        d = d[inside] if np.mean(inside) > 0.95 else d
    return float(np.std(d)) / np.sqrt(2)


def grid_step(y: np.ndarray) -> tuple[float, int]:
    """
    Return (step, levels): the spacing of the grid that y lies on, 0 where there is none.

    Where nearly all samples are on values that come five times and more, these are the levels, and
    one sample in twenty may be off (spikes are added behind the rounding too). Levels are of as
    many samples as it takes to tell. A drift visits more levels than can be told from none;
    neighbours differ by few steps all the same.

    """
    some = y[:200_000]
    blur = 4e-7 * float(np.max(np.abs(some), initial=0.0))  # float32 storage
    step, levels = _spacing(some, blur)
    return step or _spacing(np.abs(np.diff(some)), blur)[0], levels


def _spacing(y: np.ndarray, blur: float) -> tuple[float, int]:
    """Return (step, levels) of y (n,); levels within ``blur`` are one."""
    # a tenth of them tells as well that there is none, and is sorted in a tenth of the time
    few = y[::10]
    levels, _ = _levels(few, blur)
    if len(levels) > max(2 * LEVELS, len(few) // 2):
        return 0.0, len(levels)
    levels, counts = _levels(y, blur)
    if len(levels) < 2 or len(levels) > len(y) // 4:
        return 0.0, len(levels)
    often = counts >= 5
    if np.sum(counts[often]) > 0.95 * len(y):
        levels = levels[often]
    if not 2 <= len(levels) <= LEVELS:
        return 0.0, len(levels)
    gaps = np.diff(levels)
    step = float(np.min(gaps))
    multiples = gaps / step
    step = float(np.sum(gaps) / np.sum(np.round(multiples)))
    on_grid = np.abs(gaps / step - np.round(gaps / step))
    return (step, len(levels)) if np.max(on_grid) < 0.05 else (0.0, len(levels))


def _levels(y: np.ndarray, blur: float) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the values that y takes, and how often each.

    Those that differ by less than a millionth of their spread, and ``blur``, are one.

    """
    levels, counts = np.unique(y, return_counts=True)
    if len(levels) < 2:
        return levels, counts
    near = 1e-6 * (levels[-1] - levels[0]) + blur
    first = np.flatnonzero(np.concatenate([[True], np.diff(levels) > near]))
    return levels[first], np.add.reduceat(counts, first)


class Repeats(NamedTuple):
    """
    Shares of neighbours that are equal, and by chance would be; whether samples are held.

    ``runs`` is what those that are held for one length say, nats (:func:`runs_of_one_length`).

    """

    seen: float
    chance: float
    held: bool
    runs: float = 0.0

    @property
    def share(self) -> float:
        """Share of the samples that are held, beside which chance makes some equal."""
        return (self.seen - self.chance) / (1 - self.chance)


def _by_rounding(y: np.ndarray, step: float) -> float:
    """
    Return the share of neighbours that rounding makes equal, by how many differ by a step or two.

    Whatever the colour of the noise, differences are spread smoothly around zero: ln p(0) = (4 ln
    p(1) - ln p(2))/3 of a normal distribution; a converter's uneven steps show in p(2).

    """
    if not step > 0:
        return 0.0
    steps = np.abs(np.diff(y)) / step
    one, two = (max(0.5 * float(np.mean(np.abs(steps - k) < 0.5)), 0.5 / len(y)) for k in (1, 2))
    return max(float(np.exp((4 * np.log(one) - np.log(two)) / 3)), one, two)


def _equal_over(y: np.ndarray, lag: int) -> float:
    """
    Return the share of samples (n,) that are equal over a lag, or would be without a drift.

    A normal difference of variance v is off zero by a drift of d: exp(-d^2/(2 v)) as often zero.

    """
    over = y[lag:] - y[:-lag]
    v = float(np.var(over))
    less = float(np.mean(over)) ** 2 / (2 * v) if v > 0 else 0.0
    return float(np.mean(over == 0)) * float(np.exp(min(less, 1.0)))


def hold(y: np.ndarray, fresh: np.ndarray) -> np.ndarray:
    """Return samples (n,) of which those that are not ``fresh`` (n,) are the last one that is."""
    return y[np.maximum.accumulate(np.where(fresh, np.arange(len(y)), 0))]


def repeats(y: np.ndarray) -> Repeats:
    """
    Tell whether more neighbours of y (n,) are equal than rounding makes equal by chance.

    So many that are far apart are equal too, and these are not held (spikes hide a grid and widen
    the density). Where chance makes many equal, slow noise makes more of neighbours; but then they
    seldom jump by several steps, which held samples do as often as any that differ.

    """
    n = len(y)
    same = y[1:] == y[:-1]
    seen = float(np.mean(same)) if n > 1 else 0.0
    if seen == 0:
        return Repeats(0.0, 0.0, False)
    step, _ = grid_step(y)
    sigma = robust_sigma(y) / np.sqrt(max(1 - seen, 1e-3))
    # equal by rounding: density of the difference of two neighbours at zero times the step
    near = min(1.0, step / (2 * np.sqrt(np.pi) * max(sigma, 1e-300))) if step > 0 else 0.0
    lags = [k for k in FAR if k < n]
    far = float(np.mean([_equal_over(y, k) for k in lags])) if lags else 0.0
    if max(near, far) <= 0.2:
        chance = max(near, far, _by_rounding(y, step))
        runs = runs_of_one_length(same, chance)
        many = (seen - chance) * n >= 10 + 5 * np.sqrt(4 * chance * n)
        return Repeats(seen, chance, many or runs > 0, runs)
    if not lags or far > 0.8:
        return Repeats(seen, max(near, far), False)
    wide = 1.5 * step
    jumps = float(np.mean(np.abs(np.diff(y)) > wide))
    others = float(np.mean([np.mean(np.abs(y[k:] - y[:-k]) > wide) for k in lags]))
    fresh = (1 - seen) / (1 - far)
    expected = others * fresh * n
    alike = expected > 100 and abs(jumps * n - expected) < 0.1 * expected + 4 * expected**0.5
    return Repeats(seen, far, bool(fresh < 0.95 and alike))


def runs_of_one_length(same: np.ndarray, chance: float) -> float:
    """
    Return what runs of equal samples say that are longer than others, all alike; 0: none are.

    Of runs that rounding makes there are the fewer the longer they are. ``same`` (n - 1,) tells
    which samples equal the one before, ``chance`` how often rounding makes two equal; nats of a
    Poisson count of runs as long.

    """
    count = np.bincount(whole_runs(same), minlength=LENGTHS[1] + 2)
    length = np.arange(LENGTHS[0], LENGTHS[1] + 1)
    seen = count[length]
    alike = (seen >= FEWEST_RUNS) & (seen > 2 * (count[length - 1] + count[length + 1]))
    expected = len(same) * max(chance, 1 / len(same)) ** (length - 1.0)
    gain = seen * np.log(np.maximum(seen, 1) / expected) - (seen - expected)
    return float(np.max(gain, where=alike, initial=0.0))


def in_a_row(some: np.ndarray) -> np.ndarray:
    """Return begin and end, (r, 2), of where some (n,) are in a row."""
    return np.flatnonzero(np.diff(np.r_[False, some, False].astype(np.int8))).reshape(-1, 2)


def longest_in_a_row(some: np.ndarray) -> tuple[int, int]:
    """Return begin and end of the longest of these, the first of equals; (0, 0) of none."""
    ends = in_a_row(some)
    if not len(ends):
        return 0, 0
    begin, end = ends[int(np.argmax(ends[:, 1] - ends[:, 0]))].tolist()
    return begin, end


def whole_runs(same: np.ndarray) -> np.ndarray:
    """
    Return how many samples (k,) show each value that is seen to begin and to end.

    ``same`` (n - 1,) tells which samples equal the one before.

    """
    return np.diff(np.flatnonzero(np.concatenate([[True], ~same, [True]])))[1:-1]


def stretches(y: np.ndarray) -> list[np.ndarray]:
    """Return the stretches of y (n,) in each of which its noise is looked at by itself."""
    return np.array_split(y, int(np.clip(len(y) // STRETCH, 1, STRETCHES)))


def quiet_sigma(y: np.ndarray, step: float) -> tuple[float, float]:
    """
    Return the standard deviation of the fast part of y (n,) where it is quiet.

    And the share of stretches where a grid of a step shows: beside what is loud now and then it is
    as coarse.

    """
    noise = [robust_sigma(part) for part in stretches(y)]
    return float(np.quantile(noise, QUIET)), float(np.mean(step >= SHOWN * np.array(noise)))


def grid_gain(n: float, step: float, sigma: float) -> float:
    """
    Return what a grid says in nats: each sample on it is likelier than under a density.

    By about half the squared ratio of step to noise a sample, and nothing where the step is below
    half a standard deviation: finer grids are part of the white noise.

    """
    if not step >= SHOWN * sigma or not step > 0:
        return 0.0
    return 0.5 * n * min(1.0, (step / max(sigma, step / 12)) ** 2)


def independent_squares(x: np.ndarray) -> float:
    """
    Return how many independent values scatter in their mean square as x (n,) does.

    n over 1 + 2 sum of the autocorrelation of x^2, up to where that is first below what chance
    makes of it (Bartlett, Journal of the Royal Statistical Society 8 suppl., 1946).

    """
    n = len(x)
    z = x * x - np.mean(x * x)
    spectrum = np.abs(np.fft.rfft(z, 2 * n)) ** 2
    r = np.fft.irfft(spectrum)[:n // 2]
    if not r[0] > 0:
        return float(n)
    r = r[1:] / r[0]
    low = np.flatnonzero(r < 2 / np.sqrt(n))
    return n / (1 + 2 * float(np.sum(r[:low[0] if len(low) else len(r)])))


def kurtosis_pull(x: np.ndarray, independent: float | None = None) -> float:
    """
    Return by how many standard deviations the kurtosis of x (n,) is off the normal one's.

    By the transformation of Anscombe and Glynn (Biometrika 70, 1983), which holds for n >= 20;
    the mean of x is known to be zero. ``independent`` says how many of x are, all for None.

    """
    n, square = float(len(x)) if independent is None else independent, float(np.mean(x**2))
    if n < 20 or not square > 0:
        return 0.0
    b2 = float(np.mean(x**4)) / square**2
    spread = 24 * n * (n - 2) * (n - 3) / ((n + 1) ** 2 * (n + 3) * (n + 5))
    return normal_pull((b2 - 3 * (n - 1) / (n + 1)) / np.sqrt(spread), n)


def normal_pull(z: float, n: float) -> float:
    """
    Return the normal pull of what is off by z standard deviations and as skew as a kurtosis.

    That of n independent values; the transformation of :func:`kurtosis_pull`.

    """
    skew = 6 * (n * n - 5 * n + 2) / ((n + 7) * (n + 9)) * np.sqrt(
        6 * (n + 3) * (n + 5) / (n * (n - 2) * (n - 3)))
    a = 6 + 8 / skew * (2 / skew + np.sqrt(1 + 4 / skew**2))
    bottom = 1 + z * np.sqrt(2 / (a - 4))
    term = np.cbrt((1 - 2 / a) / bottom) if bottom != 0 else 0.0
    return float((1 - 2 / (9 * a) - term) / np.sqrt(2 / (9 * a)))
