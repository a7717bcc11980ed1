# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What differs between two records of an axis, whatever their models say: power in bands, and lines.

Two records differ in length and rate, so their bins do. What is compared is the mean over a band
of measured over expected power, expected of one and the same spectrum in the bins of each: then
neither where bins lie nor how many there are says anything. Of w coefficients such a mean is
chi-squared/w, and the ratio of two is Fisher's F.

Rounding to one step adds the more power the slower the samples come, step^2/(6 rate): that is no
change of the sensor, and is expected in each record by its own rate. Of noise of less than a step
the power goes with the place of the mean between two: it has fewer degrees of freedom then.

"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.special import fdtr, fdtrc, ndtri

from .behind import leaks_behind
from .evidence import Evidence
from .in_frequency import independent
from .kinds import Coupling, Mean, Response, Spectrum
from .likelihood import Likelihood
from ..core.spectrum import Bins
from ..core.statistics import TWO_SIDED
from ..loop.effect import Estimate, Fit, Model
from ..loop.problem import Difference

BANDS = 6       # from the longest wave of the shorter record to the lower Nyquist frequency
APART = 2.0     # resolutions of the shorter record, up to which two lines are the same, ...
CLOCKS = 1e-3   # ... or by which clocks may differ
SLOWEST = 8.0   # waves that a record must hold for a line of it to be looked for
MISSED = 1e-3   # chance to take noise for a line, which a line that is not seen stays below
RAREST = 1e-300
ALIKE = 0.01    # relative difference of steps that are one


def differences(a: Evidence, a_fit: Fit, b: Evidence, b_fit: Fit) -> list[Difference]:
    """Return how power and lines of one record differ from those of another."""
    return [*_lines(a, b), *_power(a, a_fit, b, b_fit)]


def without_rounding(
    a: Evidence, a_fit: Fit, b: Evidence, b_fit: Fit
) -> dict[tuple[str, str], tuple[str, Estimate, Estimate]]:
    """
    Return white noise as it is compared, where rounding is told in it.

    By label and parameter: what it is then called, and its estimates. They are less what rounding
    adds where that is another in each record, and no surer than the place of the mean allows.

    """
    both = (a, a_fit), (b, b_fit)
    parts = [_step_of_both(a, b)**2 * e.dt / 12 * _holds_rounding(fit.model) for e, fit in both]
    places = [_by_place(e) for e, _ in both]
    apart = max(parts) - min(parts) > ALIKE * max(parts)
    if not apart and not any(places):
        return {}
    out = {}
    for e in a_fit.model.of(Spectrum):
        for p in e.parameters if e.never_absent and e.label in b_fit.model else ():
            x, y = (_less(fit.estimates[e.label][p.name], part * apart, place)
                    for (_, fit), part, place in zip(both, parts, places))
            out[e.label, p.name] = f'{e.label}.{p.name}{" less rounding" * apart}', x, y
    return out


def _step_of_both(a: Evidence, b: Evidence) -> float:
    """Return the step of the grid that both records stand on; 0 where they have none in common."""
    return a.resolution if abs(a.resolution - b.resolution) <= ALIKE * a.resolution else 0.0


def _holds_rounding(model: Model) -> bool:
    """Tell whether what rounding adds is in the white noise of a model, not an effect beside."""
    beside = any('grid' in e.explains and e.psd(np.ones(1), 1.0)[0] > 0
                 for e in model.of(Spectrum))
    return not beside and not leaks_behind(model)


def _by_place(e: Evidence) -> float:
    """
    Return the variance of the logarithm of the power from where between two steps the mean is.

    The first wave of the variance of normal noise of s steps that is rounded has the amplitude
    (4 s^2 + 1/pi^2) e^(-2 pi^2 s^2), of s^2 + 1/12 (Widrow and Kollar, Quantization Noise, 2008):
    2 % at half a step, all of it at a fifth. Another bias is no other noise.

    """
    s2, seen, wave = _rounded(e)
    return 0.5 * (wave * (4 * s2 + 1 / np.pi**2) / seen) ** 2 if wave else 0.0


def _line_by_place(e: Evidence, amplitude: float) -> float:
    """
    Return the deviation of a line from where between two steps the mean is.

    Of what moves the mean rounding passes 1 + 2 e^(-2 pi^2 s^2) cos, and it swings by step/pi
    times that at a line's harmonics.

    """
    _, _, wave = _rounded(e)
    return float(wave * np.hypot(np.sqrt(2) * amplitude, e.resolution / np.pi))


def _rounded(e: Evidence) -> tuple[float, float, float]:
    """Return the noise before and after its rounding, steps^2, and the wave of the mean in it."""
    if not e.resolution > 0:
        return 0.0, 0.0, 0.0
    fast = e.whole.bins.f > 0.25 / e.dt
    level = float(np.average(e.whole.power[fast], weights=e.whole.bins.count[fast]))
    seen = 0.5 * level / e.dt / e.resolution**2
    s2 = max(seen - 1 / 12, 0.0)
    return s2, seen, float(np.exp(-2 * np.pi**2 * s2))


def _less(x: Estimate, part: float, place: float) -> Estimate:
    """Return a density without a part of its square, which ``place`` makes less sure."""

    def less(square: float) -> float:
        return float(np.sqrt(max(square - part, 0.0)))

    if x.value is None or not x.std or x.ci95 is None:
        return replace(x, upper95=x.upper95 and less(x.upper95**2),
                       ci95=x.ci95 and (less(x.ci95[0]**2), less(x.ci95[1]**2)))
    square, more = x.value**2, np.sqrt(place) * x.value**2
    value, std = less(square), float(np.hypot(2 * x.value * x.std, more))
    low, high = (np.hypot(end**2 - square, TWO_SIDED * more) for end in x.ci95)
    return replace(x, value=value, std=std / 2 / value if value else None,
                   ci95=(less(square - low), less(square + high)))


def _power(a: Evidence, a_fit: Fit, b: Evidence, b_fit: Fit) -> Iterator[Difference]:
    """
    Compare the power in bands of frequency.

    Lines are compared for themselves: bins near one of either record are left out in both.

    """
    longer, fit = max((a, a_fit), (b, b_fit), key=lambda x: x[0].duration)
    same = Model(e for e in fit.model if isinstance(e, (Spectrum, Response)))
    rounding = _step_of_both(a, b)**2 / 6 * longer.dt * _holds_rounding(same)
    at = np.concatenate([a.line_table[:, 0], b.line_table[:, 0]])
    blur = APART / min(a.duration, b.duration)

    def expected(e: Evidence) -> np.ndarray:
        v = Likelihood(e, 'whole', same).spectra(same)[0]
        return v + np.minimum(rounding, v) * (e.dt / longer.dt - 1)

    found = [(e.whole.bins.f, *_relative(e, fit, expected(e), at, blur))
             for e, fit in ((a, a_fit), (b, b_fit))]
    places = [_by_place(a), _by_place(b)]
    edges = np.geomspace(max(f[0] for f, *_ in found), min(f[-1] for f, *_ in found), BANDS + 1)
    for low, high in zip(edges, edges[1:]):
        last = high == edges[-1]
        (x, v), (y, w) = (
            _mean(*(z[(f >= low) & ((f < high) | last & (f <= high))] for z in (r, weight)))
            for f, r, weight in found)
        if v and w and x and y:
            v, w = (2 / (2 / n + place) for n, place in zip((v, w), places))
            yield Difference(f'power {low:.3g} to {high:.3g} Hz', Estimate(1.0, None, None),
                             Estimate(y / x, None, None), '1', as_sigmas(y / x, w, v))


def _relative(e: Evidence, fit: Fit, expected: np.ndarray, lines: np.ndarray,
              blur: float) -> tuple[np.ndarray, np.ndarray]:
    """Return measured over expected power (b,) and how many coefficients tell it, (b,)."""
    own = Likelihood(e, 'whole', fit.model, fit)
    power = own.without_couplings(fit.model) if fit.model.of(Coupling) else own.power
    weight = independent(e, fit.model, own.weight)
    # what was solved for in a mean took about as many of the first coefficients with it
    weight[:sum(p.linear for m in fit.model.of(Mean) for p in m.parameters)] = 0.0
    weight[_near(e.whole.bins, lines, blur)] = 0.0
    return power / expected, weight


def _near(bins: Bins, at: np.ndarray, blur: float) -> np.ndarray:
    """Tell which bins (b,) hold a frequency, or lie within ``blur`` Hz of it."""
    reach = blur + bins.count / (4 * bins.n * bins.dt)
    return np.any(np.abs(bins.f[:, None] - at) < reach[:, None], axis=1)


def _mean(x: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """
    Return the mean of relative powers (b,) and its degrees of freedom, 0 where there are none.

    Where the spectrum is another than expected, what is loud tells the mean, and it has fewer:
    2 mean^2 over its variance (Satterthwaite 1946), that of each bin being 2 E[x^2]/(w + 2).

    """
    total = float(weight.sum())
    if not total:
        return 0.0, 0.0
    mean = float(weight @ x) / total
    spread = float(np.sum(weight**2 * x**2 / (weight + 2)))
    return mean, min(total, (total * mean) ** 2 / spread) if spread else 0.0


def as_sigmas(ratio: float, w: float, v: float) -> float:
    """Return how rare a ratio of two mean powers of w and v degrees of freedom is, as sigma."""
    above = ratio > 1
    p = fdtrc(w, v, ratio) if above else fdtr(w, v, ratio)
    sigmas = -float(ndtri(np.clip(p, RAREST, 0.5)))
    return sigmas if above else -sigmas


def _lines(a: Evidence, b: Evidence) -> Iterator[Difference]:
    """Compare the amplitudes of the lines of two records, each with the nearest of the other."""
    left = list(range(len(b.line_table)))
    for i, f in enumerate(a.line_table[:, 0]):
        reach = max(APART / min(a.duration, b.duration), CLOCKS * f)
        near = [j for j in left if abs(b.line_table[j, 0] - f) < reach]
        j = min(near, key=lambda j: abs(b.line_table[j, 0] - f), default=None)
        x = _line(a, i)
        assert x.value is not None
        if j is not None:
            left.remove(j)
            y = _line(b, j)
            assert y.value is not None
            yield Difference(f'line {f:.6g} Hz', x, y, '{rate}', float(
                (y.value - x.value) / np.hypot(x.std or 0.0, y.std or 0.0)))
        elif (none := _unseen(b, f, x.value)) is not None:
            yield Difference(f'line {f:.6g} Hz', x, none, '{rate}', -_beyond(x, none))
    for j in left:
        f, y = float(b.line_table[j, 0]), _line(b, j)
        assert y.value is not None
        if (none := _unseen(a, f, y.value)) is not None:
            yield Difference(f'line {f:.6g} Hz', none, y, '{rate}', _beyond(y, none))


def _line(e: Evidence, i: int) -> Estimate:
    """Return the amplitude of a line, no surer than the place of the mean allows."""
    x = e.line(i).amplitude
    return replace(x, std=float(np.hypot(x.std or 0.0, _line_by_place(e, x.value or 0.0))))


def _unseen(e: Evidence, frequency: float, amplitude: float) -> Estimate | None:
    """
    Return below what a line stays that is not among those of a record; None where none is sought.

    ``amplitude`` is what it has in the other.

    (A/std)^2/2 is what it gains, nats, and ln of the number of places, over the chance to take
    noise for one, is asked. What stands above the level around may be one that is not coherent.

    """
    bins = e.whole.bins
    if not SLOWEST / e.duration < frequency < bins.f[-1]:
        return None
    std = (e.no_line(frequency).upper95 or 0.0) / 2.45
    k = int(bins.index(int(2 * e.duration * frequency)))
    here = slice(max(k - 1, 0), k + 2)
    level = std**2 * e.duration
    excess = float(np.sum((e.whole.power[here] - level) * bins.count[here])) / (2 * e.duration)
    most = np.sqrt(2 * std**2 * np.log(e.n / MISSED) + 2 * max(excess, 0.0))
    std = float(np.hypot(std, _line_by_place(e, amplitude)))
    return Estimate(None, std, (0.0, float(most)), upper95=float(most))


def _beyond(seen: Estimate, unseen: Estimate) -> float:
    """Return by how many standard deviations a line is larger than one that was not seen is."""
    assert seen.value is not None and unseen.upper95 is not None
    return max(0.0, float((seen.value - unseen.upper95)
                          / np.hypot(seen.std or 0.0, unseen.std or 0.0)))
