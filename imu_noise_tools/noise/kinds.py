# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Kinds of noise effect: what each can do to one axis of a static record.

Each kind also says how it combines with the others.

A kind is a capability; an effect derives from one or two. ``psd``, ``columns`` and the like give
mathematics only; fitting, scoring, pictures and export are derived from them.

"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any, ClassVar, TYPE_CHECKING, TypeAlias, TypeGuard

import numpy as np
from scipy.fft import dct, idct

from .lines import sure
from .tails import Tails
from ..core.spectrum import Bins, bins_of, expected, quadrature_avar
from ..core.statistics import interval
from ..loop.effect import Effect, Estimate, Finding, Fit, Model, Parameter, View

if TYPE_CHECKING:       # evidence knows the kinds; they know it by its type alone
    from .evidence import Evidence

#: (Phi, Q, H)
StateSpace: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]

#: draws so many samples, (n,)
Drawing: TypeAlias = Callable[[int, np.random.Generator], np.ndarray]


@dataclass(frozen=True)
class Inputs:
    """
    What an effect may depend on besides its parameters; all arrays (n,).

    ``t`` s from the beginning of the record, ``dt`` the interval of the *samples*, ``covariates``
    (temperature in degrees Celsius ...) and the axes by name, all at ``t``; ``axis``: the name of
    that which is looked at; ``slower``: whether the sensor is, than its reader, so that its
    values are sent again. ``known`` is what was :meth:`remembered` of the record.

    """

    t: np.ndarray
    dt: float
    covariates: Mapping[str, np.ndarray] = field(default_factory=dict)
    axes: Mapping[str, np.ndarray] = field(default_factory=dict)
    axis: str = ''
    slower: bool = False
    known: dict[Hashable, Any] = field(default_factory=dict, repr=False, compare=False)

    def remembered(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """Return what is made once of a record for all of its axes; later it is as it was then."""
        if key not in self.known:
            self.known[key] = make()
        return self.known[key]


@dataclass(frozen=True)
class Portrait:
    """
    What shows one effect where no view of an axis does: measured points, and its own line.

    ``x``, ``y`` and ``line_x``, ``line_y`` (k,) each; ``units`` of x and y as for a
    :class:`Parameter` (``1``: none), the titles without them.

    """

    titles: tuple[str, str]
    units: tuple[str, str]
    x: np.ndarray
    y: np.ndarray
    line_x: np.ndarray
    line_y: np.ndarray


class NoiseEffect(Effect):
    """Base of every noise effect."""

    domain = 'noise'
    field_units = True

    #: values with which it leaves a record as it is, of parameters for which that is not zero
    neutral: ClassVar[Mapping[str, float]] = {}
    #: views that are not judged while it is in the model and there
    hides: tuple[str, ...] = ()
    #: views that fail by themselves while it is there: then no test, but compared between models
    mutes: tuple[str, ...] = ()
    #: features of the samples that it accounts for: what has none beyond the model's is not tried
    explains: ClassVar[tuple[str, ...]] = ()
    #: in which turn it is measured on the samples: defects of earlier turns are out of them then
    turn: ClassVar[int] = 1
    #: whether it is measured on all that was read: of a slower sensor, repeats too
    of_readings: ClassVar[bool] = False
    #: whether no sensor is without it: a fit that leaves nothing of it pays for that
    never_absent: ClassVar[bool] = False
    #: whether it moves a mean by where that lies between two steps of the output, as rounding does
    moves_means: ClassVar[bool] = False
    #: whether it is believed only if what it explains is Gaussian on every time scale
    must_be_normal: ClassVar[bool] = False
    #: whether it bends to any form: all of its parameters are priced, so that a form as good wins
    free: ClassVar[bool] = False
    #: whether it may bend the spectrum over decades: it falls if a knee of any steepness does more
    broad: ClassVar[bool] = False
    #: the same word for all with the same spectrum, which only the samples tell apart
    alike: ClassVar[str] = ''
    #: what a record must hold for it to apply
    needs: ClassVar[str] = 'leave it out'
    #: what to record to tell it from its rivals
    decide: ClassVar[str] = ''

    def elsewhere(self) -> list[Effect]:
        """Return what a part of a record may have of a peak that is now here, now there."""
        return []

    def otherwise(self, evidence: Evidence, fit: Fit, claim: float) -> str:
        """Say that the samples are not such as it makes, or that others make what it claims."""
        return ''

    def lacking(self, evidence: Evidence) -> str:
        """Say what to record along, which may be what it is due to, where that is not there."""
        return ''

    def manner(self, evidence: Evidence) -> str:
        """Say what the samples tell of it beside the numbers, or nothing."""
        return ''

    def hides_loudness(self, evidence: Evidence) -> bool:
        """Tell whether beside it nothing of how loud noise is in time is the noise's own doing."""
        return False

    def by_chance(self, evidence: Evidence) -> float:
        """Return what levels that it takes from the record gain once in a thousand, nats."""
        return 0.0

    def others(self, parameter: Parameter, evidence: Evidence) -> list[float]:
        """Return the choices that it may have instead, none whose levels the record lacks."""
        return [k for k in parameter.others(self[parameter.name]) if np.isfinite(
            self.with_values(**{parameter.name: k}).by_chance(evidence))]

    def muting(self) -> tuple[str, ...]:
        """Return the views that it mutes as it is, of those it may mute."""
        return self.mutes

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Return what it must keep of the samples y (n,) of one axis.

        Small arrays by name, stored in evidence.npz.

        """
        return {}

    def starts(self, evidence: Evidence) -> list[Effect]:
        """
        Return where a fit should start from, one effect for each.

        An empty list means: not applicable here.

        By default each searched parameter starts at three points spread over its range (amplitudes
        are then set from the measured spectrum); what is measured is not searched, and has one.

        """
        if isinstance(self, MEASURED):
            return [self]
        grid: list[dict[str, float]] = [{}]
        for p in self.parameters:
            if p.linear or p.name in self.values:
                continue
            if p.amplitude:
                spread = [np.sqrt(p.lower * p.upper)]
            elif p.choices:
                spread = range(len(p.choices))
            elif p.log:
                spread = np.geomspace(p.lower, p.upper, 5)[1:-1]
            else:
                spread = np.linspace(p.lower, p.upper, 5)[1:-1]
            grid = [{**g, p.name: float(s)} for g in grid for s in spread]
        return [self.with_values(**g) for g in grid]

    @property
    def linear(self) -> tuple[str, ...]:
        """Names of its linear parameters, in their order."""
        return tuple(p.name for p in self.parameters if p.linear)

    @property
    def amplitudes(self) -> tuple[str, ...]:
        """Names of those of its parameters that say how much there is of it."""
        return tuple(p.name for p in self.parameters if p.amplitude)

    @property
    def knees(self) -> int:
        """
        How many parameters it spends on a knee of one steepness in the spectrum.

        Several such imitate any other (:mod:`~imu_noise_tools.noise.knee`); 0: it makes none.

        """
        return 0

    @property
    def always_fitted(self) -> int:
        """How many of its parameters are: what is discrete is chosen, what is optional may do."""
        return sum(not p.discrete and p.name not in self.optional for p in self.parameters)

    def idle(self, parameter: Parameter) -> float:
        """Return the value of a parameter with which it leaves a record as it is."""
        p = parameter
        return self.neutral.get(
            p.name, 0.0 if p.amplitude or not p.log else float(np.sqrt(p.lower * p.upper)))

    def bounds(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """
        Return bounds narrower than the parameters' own.

        They hold what this record can tell from other effects.

        """
        return {}

    def told(self, evidence: Evidence) -> dict[str, tuple[float, float]]:
        """
        Return (value, error) of what the samples tell of searched parameters beyond the spectrum.

        The error is one of the search scale, ln value where the parameter is on a log scale.

        """
        return {}

    def bonus(self, evidence: Evidence, fit: Fit) -> float:
        """Return what the samples say for it, fitted so, beyond the spectrum (nats)."""
        return 0.0

    def portraits(self, evidence: Evidence, fit: Fit) -> dict[str, Callable[[], Portrait]]:
        """Return what shows it best beside the views, by name, worked out when called."""
        return {}

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Return x (n,) with the effect in it, (n,): its simulation."""
        raise NotImplementedError(f'{self.name} has no simulation')


class Spectrum(NoiseEffect):
    """Adds power: a stationary Gaussian process, independent of all others."""

    views: ClassVar[tuple[str, ...]] = ('frequency', 'time')
    uncovers = True     # the floor falls with it, and what stood beside it stands out the more
    #: whether the sensor's own response acts on it (quantization happens behind the filter)
    filtered = True
    #: whether it is the noise of the element itself, ahead of every filter
    own: ClassVar[bool] = False
    #: whether it is the same at all frequencies
    flat: ClassVar[bool] = False

    def path(self, evidence: Evidence) -> np.ndarray | None:
        """Return what it adds to the slow means (s,), where the samples show it; or None."""
        return None

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the one-sided PSD of the sampled process at f (n,), Hz: (n,), unit^2/Hz."""
        raise NotImplementedError

    def colour(self, evidence: Evidence,
               part: str = 'whole') -> Callable[[np.ndarray], np.ndarray] | None:
        """Return by what samples show its PSD to differ, (n,) of f (n,), Hz; None: by nothing."""
        return None

    @property
    def centre(self) -> float | None:
        """Frequency (Hz) around which its power may be narrower than a grid resolves, or None."""
        return None

    @property
    def middle(self) -> float | None:
        """Frequency (Hz) around which its power is, resolved or not; None of what is broad."""
        return self.centre

    @property
    def uneven(self) -> bool:
        """Whether its power may come and go by more than Gaussian noise does, as a machine's."""
        return self.middle is not None

    def heard_by_all(self, f: np.ndarray) -> np.ndarray:
        """Tell at which f (n,), Hz, it is from outside, so that other axes hear it: (n,) bool."""
        return np.zeros(np.shape(f), bool)

    @property
    def jumps(self) -> float:
        """How far it jumps at once, to come back later: as far as a step may; 0 if it does not."""
        return 0.0

    def binned(self, bins: Bins) -> np.ndarray:
        """Return what the power of a record is expected to be in each bin, (b,)."""
        return expected(lambda f: self.psd(f, bins.dt), bins)

    def slopes(self, bins: Bins) -> dict[str, np.ndarray]:
        """Return d ``binned``/d ln parameter (b,) of those that have it in closed form."""
        return {}

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """
        Return the Allan variance at cluster sizes m (k,): (k,), unit^2.

        By default the quadrature of ``psd``.

        """
        return quadrature_avar(lambda f: self.psd(f, dt), m, dt)

    def state_space(self, dt: float) -> StateSpace | None:
        """
        Return (Phi, Q, H) with this PSD: x_{k+1} = Phi x_k + w, w ~ Q, y_k = H x_k.

        None where no finite one exists.

        """
        return None

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """
        Add a realisation drawn through the DCT.

        It is exact in power, stationary but for the record's ends.

        """
        n, dt = len(x), inputs.dt
        k = np.arange(1, n)
        s = self.psd(k / (2 * n * dt), dt)
        low = expected(lambda f: self.psd(f, dt), bins_of(n, dt))[:32]
        s[: len(low)] = low
        c = np.concatenate([[0.0], rng.standard_normal(n - 1) * np.sqrt(s / (2 * dt))])
        return x + idct(c, type=2, norm='ortho')

    def drawing(self, evidence: Evidence, fit: Fit) -> Drawing:
        """Return what draws it as a record shows it, which may be more than its parameters say."""
        return lambda n, rng: self.apply(
            np.zeros(n), Inputs(np.arange(n) * evidence.dt, evidence.dt, {}), rng)


class Mean(NoiseEffect):
    """
    Adds to the mean: columns times linear parameters.

    The columns come in the order in which the effect lists its linear parameters.

    All other parameters are nonlinear and passed to ``columns`` by name.

    """

    views: ClassVar[tuple[str, ...]] = ('time',)
    paired = True
    #: whether nothing of it jumps, so that it may be asked for between the blocks
    smooth: ClassVar[bool] = False
    #: whether it takes a good part of the record to change: the rest of the spectrum lacks it
    slow: ClassVar[bool] = False
    #: parameters that a fit chooses anew where the others are known: beside more, more is seen
    anew: ClassVar[tuple[str, ...]] = ()

    def columns(self, inputs: Inputs, *_: Any, **nonlinear: Any) -> np.ndarray:
        """
        Return (n, p), slowly varying; zero where a parameter is no part of a form.

        In the unit of the samples over that of the linear parameter of each.

        """
        raise NotImplementedError

    def finer(self, evidence: Evidence) -> list[Effect]:
        """Return what to compare with it where it is among the best of its ``starts``."""
        return []

    def ways(self, evidence: Evidence) -> list[list[Mean]]:
        """
        Return all ways to choose what is chosen of it, which may be as likely as it is.

        In rows in which neighbours are alike, and what lies between two of them is one as well.

        """
        return []

    def plain(self) -> Mean | None:
        """Return it with nothing to choose, where it then follows what is recorded beside."""
        return None

    def unread(self, evidence: Evidence) -> float:
        """Return how far the mean may go by what it follows and the steps of its readings hide."""
        return 0.0

    @property
    def nonlinear(self) -> dict[str, float]:
        """Values of all but its linear parameters, by name, as ``columns`` takes them."""
        return {p.name: self[p.name] for p in self.parameters if not p.linear}

    @property
    def placed(self) -> bool:
        """Whether all that its columns depend on has a value."""
        return all(p.linear or p.name in self.values for p in self.parameters)

    def missed(self, evidence: Evidence) -> float:
        """
        Return how far it is off, rms, by what the readings do not tell of what it follows.

        Ways to choose it that differ by no more are as likely.

        """
        return 0.0

    def mean(self, inputs: Inputs) -> np.ndarray:
        """Return what it adds, (n,)."""
        rest = {k: v for k, v in self.values.items() if k not in self.linear}
        # a study of before an effect had a parameter does without
        return self.columns(inputs, **rest) @ np.array(
            [self.values.get(k, 0.0) for k in self.linear])

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """Return what it adds to the Allan variance, (k,), unit^2, in a closed form; else zero."""
        return np.zeros(len(np.atleast_1d(m)))

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the mean."""
        return x + self.mean(inputs)


class Line(NoiseEffect):
    """
    Adds coherent lines.

    Their amplitudes, frequencies and phases are measured on the samples when the evidence is made:
    the rows of its line table.

    """

    views: ClassVar[tuple[str, ...]] = ('frequency', 'time')
    certain = True
    counted = False     # a coherent line is a few coefficients of a bin that may hold thousands
    #: whether it takes its rows before those that take one each
    family: ClassVar[bool] = False

    @classmethod
    def _frequency(cls) -> str:
        return next(p.name for p in cls.parameters if p.unit == 'Hz')

    @classmethod
    def _amplitude(cls) -> str:
        return next(p.name for p in cls.parameters if p.amplitude)

    def lines(self) -> list[tuple[float, float]]:
        """
        Return (frequency Hz, amplitude) of each line it consists of.

        By default one: of the first parameter in Hz, and the first that is an amplitude.

        """
        return [(self[self._frequency()], self[self._amplitude()])]

    def share(self, duration: float) -> float:
        """Return in what part of a record of so many seconds they are there, 0 to 1."""
        return 1.0

    def rows(self, evidence: Evidence, free: list[int]) -> list[int]:
        """
        Return which of the free rows of the line table (strongest first) it would hold.

        None where there is nothing of the kind. Values that it has say which are meant: by default
        the row near its frequency, else the strongest of those that need no company to be sure.

        """
        wanted = self.values.get(self._frequency())
        width = max(2 / evidence.duration, 1e-3 * (wanted or 0))
        near = [i for i in free if wanted and abs(evidence.line_table[i, 0] - wanted) < width]
        known = len(evidence.line_table) - len(free)
        return (near or [i for i in free
                         if sure(evidence.line_table[i, 3], evidence.n, known)])[:1]

    def read(self, evidence: Evidence, rows: list[int]) -> dict[str, Estimate]:
        """
        Return an estimate of each parameter, units left out, from its rows or from none.

        By default amplitude and frequency of the one row, an upper limit where there is none;
        other parameters keep the value they have, or a neutral one.

        """
        found = {p.name: Estimate(None, None, None, note='not read from the lines',
                                  point=self.values.get(p.name, self.idle(p)))
                 for p in self.parameters}
        if rows:
            line = evidence.line(rows[0])
            found.update({self._amplitude(): line.amplitude, self._frequency(): line.frequency})
        else:
            found[self._amplitude()] = evidence.no_line()
            found[self._frequency()] = Estimate(None, None, None, point=0.25 / evidence.dt,
                                                note='no line')
        return found

    def otherwise(self, evidence: Evidence, fit: Fit, claim: float) -> str:
        """Say that they are where a machine with more power stays for a while, or nothing."""
        f, amplitude = np.reshape(self.lines(), (-1, 2)).T
        for e, heard in heard_by_all(fit.model, f):
            power = sum(e.values.get(k, 0.0) ** 2 for k in e.amplitudes)
            if np.all(heard & (amplitude * amplitude / 2 < power)):
                return f'{e.label}, in which it is, has more power and stays there for a while'
        return ''

    def in_words(self, evidence: Evidence, rows: list[int]) -> str:
        """Say what these rows are evidence of: where a line is, and how far it stands out."""
        frequency, _, _, z, begin, end = evidence.line_table[rows[0]]
        when = ' and '.join(said for part, said in (
            (begin > 0, f'from {begin * evidence.dt:.4g} s on'),
            (end < evidence.n, f'until {end * evidence.dt:.4g} s')) if part)
        rpm = f' ({60 * frequency:.0f} rpm)' if 5 <= frequency <= 500 else ''
        return (
            f'a line at {frequency:.6g} Hz, {z:.0f} standard deviations above the spectrum around '
            f'it, coherent {when or "through the record"}{rpm}'
        )

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """
        Omega0^2 sin^4(pi f m dt) / (m sin(pi f dt))^2: the sampled form of IEEE 952 C.1.7.

        While they are there.

        """
        m = np.asarray(m, float)
        out = np.zeros(m.shape)
        for frequency, amplitude in self.lines():
            x = np.pi * frequency * dt
            out = out + amplitude**2 * np.sin(m * x) ** 4 / (m * np.sin(x)) ** 2
        return out

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add its lines, each with a random phase."""
        for frequency, amplitude in self.lines():
            phase = rng.uniform(0, 2 * np.pi)
            x = x + amplitude * np.sin(2 * np.pi * frequency * inputs.t + phase)
        return x


class Coupling(NoiseEffect):
    """Adds other signals, recorded at the full rate, times linear parameters (one each)."""

    views: ClassVar[tuple[str, ...]] = ('coherence', 'frequency', 'time')
    certain = True      # what another channel tells is not the spectrum's doing
    stays = True

    def channels(self, evidence: Evidence) -> tuple[str, ...]:
        """Return the names of the signals, one for each linear parameter; empty: not recorded."""
        raise NotImplementedError

    def motion(self, evidence: Evidence, fit: Fit) -> str:
        """Say that what it explains, fitted so, is motion that the sensor tells, or nothing."""
        return ''

    def gains(self, evidence: Evidence) -> Iterator[tuple[str, float]]:
        """Return each of its channels with its gain."""
        return zip(self.channels(evidence), (self[k] for k in self.linear))


#: what a filter of the sensor acts on: what shakes the sensor may enter behind it, and so may all
#: that is slow, where the filter is the element's bandwidth and the bias that of its electronics
FILTERS = Parameter.choice('filters', ('everything', 'own_noise', 'white_noise'),
                           title='what it filters')


class Response(NoiseEffect):
    """Multiplies power: the sensor's own low-pass."""

    views: ClassVar[tuple[str, ...]] = ('frequency',)
    uncovers = True     # with the fall the slow end is no steeper than it is
    #: whether it comes behind everything else, quantization too
    last: ClassVar[bool] = False
    #: whether it may leave so little that rounding and the record's ends show behind it
    leaks: ClassVar[bool] = True

    def gain2(self, f: np.ndarray, dt: float) -> np.ndarray:
        """Return the squared gain at f (n,), Hz: (n,)."""
        raise NotImplementedError

    def scattered(self, before: Sequence[Response], f: np.ndarray, dt: float) -> np.ndarray:
        """
        Return the level at f (n,), Hz, of what it scatters over all frequencies, a filter nothing.

        Before it passes it, of white noise that has passed the responses before it, over its level
        at zero frequency.

        """
        return np.zeros(np.shape(f))

    def unscattered(self, gain2: np.ndarray, bins: Bins) -> np.ndarray:
        """Return the squared gain (b,) of filters before it from what is seen, over that of 1."""
        return gain2

    @property
    def scatters(self) -> bool:
        """Whether it scatters anything."""
        return False

    def least(self, bins: Bins, dt: float) -> float:
        """Return the least of its squared gain where a record shows it."""
        return float(np.min(self.gain2(bins.f, dt)))

    def acts_on(self, effect: Spectrum) -> bool:
        """Tell whether it filters what an effect adds."""
        only = (True, effect.own, effect.flat)[int(self.values.get('filters', 0))]
        return self.last or effect.filtered and only

    def crowd(self) -> float:
        """
        Return how many times more the sum of products of two axes scatters than for noise.

        Axes that it acts on alike share more than their spectrum where it is no filter.

        """
        return 1.0

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Filter through the DCT: the even extension has no transient at the ends."""
        c = dct(x, type=2, norm='ortho')
        k = np.arange(1, len(x))
        c[1:] *= np.sqrt(self.gain2(k / (2 * len(x) * inputs.dt), inputs.dt))
        return idct(c, type=2, norm='ortho')


class Modulation(NoiseEffect):
    """Changes the variance in time."""

    views: ClassVar[tuple[str, ...]] = ('variance', 'distribution')

    def variance(self, t: np.ndarray) -> np.ndarray:
        """Return the factor of the variance at t (n,), s: (n,)."""
        raise NotImplementedError

    def measure(self, evidence: Evidence) -> Finding | None:
        """
        Return a Finding from the power in time, or None.

        It holds the gain, the effect with values and its estimates.

        """
        return None

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Scale the deviations from the mean."""
        mean = np.mean(x)
        return mean + (x - mean) * np.sqrt(self.variance(inputs.t))


class Defect(NoiseEffect):
    """Acts on samples (spikes, held samples): found in the samples, not in the spectrum."""

    def find(self, evidence: Evidence) -> Finding | None:
        """
        Return a Finding from kept statistics, or None.

        It holds the gain in log-likelihood, the effect with values and the evidence in words.

        """
        return None

    def tails(self, evidence: Evidence) -> Tails | None:
        """Return how the samples are distributed that it leaves; None: normally."""
        return None

    @classmethod
    def held_out(cls, evidence: Evidence, part: str, fit: Fit) -> View | None:
        """
        Return a view of a part (a half, or whole) by what it kept of the samples there.

        Whether it is in the fit's model or not, where that was fitted to the other half; None
        where the samples show nothing of the kind, or another view shows it.

        """
        return None

    @classmethod
    def screen(cls, y: np.ndarray, kept: Mapping[str, np.ndarray], inputs: Inputs) -> np.ndarray:
        """Return y (n,) without the defect, (n,), for the spectrum that others are fitted to."""
        return y

    @classmethod
    def screens(cls) -> bool:
        """Tell whether it is taken out of the samples, by a ``screen`` of its own."""
        return next(c for c in cls.__mro__ if 'screen' in vars(c)) is not Defect


#: kinds whose values come from the samples, not from the spectral fit
MEASURED = (Line, Defect, Modulation)


def measured(value: float, std: float) -> Estimate:
    """Return what was measured on the samples, with a normal interval, its unit left out."""
    return Estimate(value, std, interval(value, std), point=value, fixed=True)


def model_hides(model: Model, view: str) -> bool:
    """Tell whether a defect of a model hides a view."""
    return any(view in d.hides and all(d[k] > 0 for k in d.amplitudes)
               for d in model.of(Defect) if d.values)


def model_tails(model: Model, evidence: Evidence) -> Tails | None:
    """Return how the whitened samples are distributed by a model's defects; None: normally."""
    found = (d.tails(evidence) for d in model.of(Defect) if d.values)
    return next((t for t in found if t is not None), None)


def owners(effects: Iterable[NoiseEffect]) -> np.ndarray:
    """Return the labels (p,) of whose the linear parameters of effects are, in their order."""
    return np.array([e.label for e in effects for _ in e.linear], dtype=str)


def is_peak(effect: Effect) -> TypeGuard[Spectrum]:
    """Tell whether an effect is noise around one frequency."""
    return isinstance(effect, Spectrum) and effect.centre is not None


def heard_by_all(model: Model, f: np.ndarray) -> list[tuple[Spectrum, np.ndarray]]:
    """Return what of a model other axes hear at some of f (n,), Hz, and at which, (n,) bool."""
    heard = ((e, e.heard_by_all(f)) for e in model.of(Spectrum))
    return [(e, at) for e, at in heard if np.any(at)]


def foreign(model: Model) -> list[Spectrum]:
    """Return the noise of a model that is fitted and may be none of the sensor's own."""
    return [e for e in model.of(Spectrum) if not (e.own or isinstance(e, MEASURED))]


def model_crowd(model: Model) -> float:
    """Return how many times more sums of products of two axes scatter (:class:`Response`)."""
    return prod((r.crowd() for r in model.of(Response)), start=1.0)
