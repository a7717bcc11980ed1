# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""One axis of a filter as a problem of the loop: how it is cut, fitted, scored and tested."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import numpy as np
from scipy.optimize import minimize_scalar

from .chunks import Chunks
from .design import quiet_variance
from .evaluate import omnibus, score_of
from .fitting import estimates, kept, Likelihood, maximise, NULL, start
from .placed import bridged, LEAST, placed
from .predict import predict, Prediction
from .rival import Beside
from .statespace import (
    DOMAIN, FilterEffect, Look, Motion, oscillates, OutputNoise, white_of
)
from .still import is_as_strong, is_coloured, outlasts_motion
from ..core.errors import InputError
from ..core.spectrum import cosine_transform
from ..core.statistics import grid_step
from ..core.units import shown
from ..loop.effect import Estimate, Finding, Fit, Model, registry, Score, unfitted
from ..loop.findings import failures, rivals
from ..loop.problem import Problem
from ..loop.verdict import HEALED

ONE_RATE = 0.01     # relative difference of rates that are one
MOVES = 2.0         # times the variance of the noise that samples at rest stay below (a choice)
START = ('constant_rate', 'ar_increment', 'white')
WORTH = 1.0  # nats below what chance gains that a candidate is still worth its intervals
BEHIND = 12.0  # nats behind the best from which a candidate has no chance beside it (1 in 10^5)
MOST_OF = 0.9           # of the samples: where fewer are judged, a verdict says so
AT = 1e-3               # of a bound, from which a value lies there
AS_MOTION = ('a motion that goes on all the time does the same: a record with rests in it would '
             'tell; if it was taken at rest, add it by hand')
TOO_SLOW = ('at the highest frequencies, where no motion comes to, the noise is no stronger: a'
            ' fast motion does the same')
SLACK = 15.0  # nats that a line may gain from where it begins: its phase is half known there


def covers(model: Model) -> bool:
    """Tell whether a model stands for every motion: then it is coarse in each."""
    return any(e.every for e in model.of(Motion))


class FilterProblem(Problem):
    """
    One axis: a series z (n,), evenly spaced by dt (s), NaN where a sample is missing.

    ``stated`` holds the values of effects (by label) that are given rather than fitted: the model
    whose innovations are judged. The first half is fitted, the second scored.

    """

    domain = DOMAIN
    looks = 0   # a recursion over all samples for each candidate, beside each candidate

    def __init__(self, z: np.ndarray, dt: float, target: str = 'gyro_x',
                 stated: Mapping | None = None, alpha: float = 1.0,
                 whole: FilterProblem | None = None):
        self.z, self.dt, self.alpha = np.asarray(z, float), float(dt), float(alpha)
        self.step: float = whole.step if whole else grid_step(self.seen)[0]
        self._target = target
        self.stated = {k: dict(v) for k, v in (stated or {}).items()}
        self.whole = whole
        self.part = (0, len(self.z))
        self.share = 1.0        # of the samples of the record that are judged
        self._fits: dict[Model, Fit] = {}
        self._seen: dict[Model, Prediction] = {}
        self.chunks = Chunks(self.z, self.dt, self.alpha)
        if len(self.seen) < LEAST and whole is None:
            raise InputError(
                f'{len(self.seen)} samples are too few to judge a filter', f'give at least {LEAST}'
            )
        if np.ptp(self.seen) == 0 and whole is None:
            raise InputError(f'{target} is constant', 'leave it out')

    @property
    def target(self) -> str:
        """Name of the axis."""
        return self._target

    @cached_property
    def seen(self) -> np.ndarray:
        """The samples that are there, (k,), rad/s."""
        return self.z[np.isfinite(self.z)]

    @cached_property
    def bridged(self) -> np.ndarray:
        """The series (n,), rad/s, with something for the samples that are missing: for a look."""
        return bridged(self.z, float(quiet_variance(self.seen[:, None])[0]))

    @cached_property
    def halves(self) -> tuple[FilterProblem, FilterProblem]:
        """The first and the second half, which start from the values of the whole."""
        half = len(self.z) // 2
        first, second = (FilterProblem(z, self.dt, self.target, self.stated, self.alpha, self)
                         for z in (self.z[:half], self.z[half:]))
        return first, second

    def split(self) -> list[tuple[Problem, Problem]]:
        """Return (first half, second half): what is fitted and what is scored."""
        return [self.halves]

    def fit(self, model: Model) -> Fit:
        """Fit what is not stated; a half starts from the values of the whole."""
        if model not in self._fits:
            self._fits[model] = self._fit(model)
        return self._fits[model]

    def _begun(self, model, known=None):
        """Return a model with starting values, or None, and its likelihood."""
        evaluate = Likelihood(self.z, self.dt, self.alpha, self.chunks)
        if self.whole is not None:
            return self.whole.fit(model).model, evaluate
        return start(model, self.stated, self.look, evaluate, known), evaluate

    def _fit(self, model, hope=-np.inf, begun=None):
        """
        Fit a model, from where it is ``begun``.

        Without intervals where its likelihood stays below ``hope``.

        """
        begin, evaluate = begun or self._begun(model)
        if begin is None:
            return Fit(model, {}, -np.inf, ('one of its effects does not apply to these data',))
        if evaluate.recurs(begin) and oscillates(begin):
            log_l = float(evaluate([begin])[0])
            if log_l + SLACK < hope:
                return Fit(begin, {}, log_l, ())
            evaluate.about(begin, last=True)
            begin, evaluate = self._begun(model)        # by phases that are known now
            if self.whole is None:
                begin = kept(begin, self.stated, evaluate)
        best, log_l = maximise(begin, self.stated, evaluate, hope)
        if self.whole is None and log_l >= hope:
            best = self._with_measured(best)
            log_l = evaluate.about(best, last=True)
        found, flags = ({}, ())
        if self.whole is None and log_l >= hope:
            found, flags = estimates(best, self.stated, log_l, evaluate)
        return Fit(best, found, log_l, flags)

    def _with_measured(self, model: Model) -> Model:
        """
        Return the model with the values that are read from the samples.

        The amplitude of a line, read at its frequency.

        """
        for e in model.of(FilterEffect):
            if e.label not in self.stated and e.measured:
                model = model.with_effect(e.read(self.z, self.dt))
        return model

    def prediction(self, model: Model) -> Prediction:
        """Return log-likelihood and scores of a model with values."""
        if model not in self._seen:
            self._seen[model] = predict(
                model, self.z, self.dt, self.alpha, self.step, self.chunks)
        return self._seen[model]

    def score(self, fit: Fit) -> Score:
        """Score a fit made on other data."""
        return self._score(fit.model, covers(fit.model))

    def _score(self, model: Model, coarse: bool = False) -> Score:
        seen = self.prediction(model)
        log_l = seen.log_likelihood if np.isfinite(seen.log_likelihood) else None
        return score_of(seen.u, self.dt, coarse, seen.smooth, log_l)

    def omnibus(self, fit: Fit) -> list[Finding]:
        """Return the tests of the innovations."""
        seen = self.prediction(fit.model)
        return omnibus(seen.u, self.dt, covers(fit.model), seen.smooth)

    def strict(self, model: Model) -> list[Finding]:
        """Return the tests of the innovations that allow nothing to a bank for any motion."""
        seen = self.prediction(model)
        return omnibus(seen.u, self.dt, smooth=seen.smooth)

    def lost(self, model: Model) -> dict[str, tuple[float, float]]:
        """Return by view the nats a sample that a model loses, and that it may lose by itself."""
        count = 2 * len(self.prediction(model).u)
        return {k: (max(v.excess, 0.0) * len(v.pull) / count, v.allowed * len(v.pull) / count)
                for k, v in self._score(model, covers(model)).views.items()}

    def leave(self, model: Model) -> str:
        """Say that a bank for any motion fails by what it loses by itself alone."""
        lost, allowed = self.lost(model)['spectrum']
        return (f'a bank for any motion follows coarsely: {lost:.2g} nats a sample are lost, of '
                f'{allowed:.2g} that it may lose by itself'
                if allowed and failures(self.strict(model)) else '')

    def candidates(self, fit: Fit) -> list[Finding]:
        """
        Return what could be added.

        Gain of log-likelihood refitted, penalty by BIC and by where it was looked for.

        """
        begun = []
        n = len(self.seen)
        known = cast(dict[str, type[FilterEffect]], registry(DOMAIN))
        for name, effect in known.items():
            if self._applies(effect, fit.model):
                more = unfitted(fit.model).plus(effect())
                penalty = 0.5 * len(effect.parameters) * np.log(n) + effect.search + 2.0
                first, evaluate = self._begun(more, fit.model)
                ahead = -np.inf if first is None else float(evaluate([first])[0]) - penalty
                begun.append((ahead, name, effect, more, penalty, (first, evaluate)))
        out: list[Finding] = []
        best = -WORTH
        beside: Beside | None = None
        for _, name, effect, more, penalty, first in sorted(begun, key=lambda b: -b[0]):
            after = self._fits.get(more) or self._fit(
                more, fit.log_likelihood + penalty + max(-WORTH, best - BEHIND), first)
            if after.estimates:
                self._fits[more] = after
            gain = after.log_likelihood - fit.log_likelihood
            if not np.isfinite(gain):
                continue
            new = next(e for e in after.model if e.label not in fit.model)
            rival = max(0.0, best - BEHIND)
            # a bank that is too wide for a motion hides what grows with it
            least = NULL if effect.slopes and not rival else penalty + rival
            if gain > least and covers(fit.model):
                beside = beside or Beside(fit.model, self.stated, Likelihood(
                    self.z, self.dt, self.alpha, self.chunks))
                gain = beside.gain(after.model, gain, penalty, rival)
                if gain > penalty and not after.estimates:
                    after = self.fit(more)      # it was left early
                    new = after.model[new.label]
            best = max(best, gain - penalty)
            heals = effect.heals
            if gain > penalty and self._lost(after) < (1 - HEALED) * self._lost(fit):
                heals = ''  # most is explained: what is left is another effect's
            out.append(
                Finding(name, float(gain), new, after.estimates.get(new.label, {}), float(penalty),
                        heals,
                        f'{effect.signature} (log-likelihood {gain:+.1f}, chance {penalty:.1f})')
            )
        return sorted(out, key=lambda f: f.penalty - f.gain)

    def _applies(self, effect: type[FilterEffect], model: Model) -> bool:
        """Tell whether an effect could be missing from a model, and be seen beside what it has."""
        driven = model.of(Motion)
        white = white_of(model)
        if not effect.sought or (effect.name in model and not effect.several):
            return False
        if effect.scales and (white is None or white.label not in self.stated):
            return False
        if effect.slopes and not any(e.smooth for e in driven):
            return False
        # a bank for any motion drives the rate at random: what repeats it only follows
        if issubclass(effect, Motion) and (
            covers(model) and not effect.keeps or any(e.jumps for e in driven) and effect.jumps
        ):
            return False
        return not effect.after or any(effect.after in e.lineage() for e in model)

    def shape(self, fit: Fit, label: str, claim: float) -> str:
        """
        Say that a motion may do what noise is to do, beside a bank for any motion.

        A motion by name has a form of its own, which noise does not take.

        """
        effect, model = cast(FilterEffect, fit.model[label]), fit.model
        if not covers(model):
            return ''
        if is_coloured(effect) and not outlasts_motion(self.z, self.dt, model, label):
            return AS_MOTION
        if effect.scales and not is_as_strong(self.bridged, model, label):
            return TOO_SLOW
        return self._at_bound(fit, effect) if isinstance(effect, OutputNoise) else ''

    def _at_bound(self, fit: Fit, effect: FilterEffect) -> str:
        """
        Say that noise would be more than it can be: no estimate, and it bends to something else.

        Where the data set the bound, all that there can be may be there: then nothing fails.

        """
        for p in effect.parameters:
            most = effect.within(p, self.dt)[1]
            if effect[p.name] > (1 - AT) * most and p.name != effect.keeps \
                    and (most == p.upper or failures(self.omnibus(fit))):
                return f'its {p.name} lies at its bound, {shown(most, p.unit, "gyro")}'
        return ''

    def _lost(self, fit: Fit) -> float:
        """Return the deviance from what a true model would score."""
        return sum(v.excess * len(v.pull) for v in self._score(fit.model).views.values())

    def summary(self, fit: Fit) -> dict[str, float]:
        """Return the nats lost per sample on the second half by the fit of the first."""
        first, second = self.halves
        model = first.fit(unfitted(fit.model)).model
        u = second.prediction(model).u
        total = sum(v.excess * len(v.pull) for v in second._score(model).views.values())
        return {'nats_per_sample': float(total / (2 * len(u))), 'nis': float(np.mean(u * u))}

    def advice(self, verdict: str, ranked: list[Finding], failed: list[Finding]) -> str:
        """Say what to do next."""
        if verdict == 'missing':
            return f'add {ranked[0].name}: {registry(DOMAIN)[ranked[0].name].hint}'
        if verdict == 'complete':
            said = 'the innovations speak for no effect that is missing'
            return said if self.share > MOST_OF else \
                f'{said}, but {self.share:.0%} of the samples were judged'
        if verdict == 'unknown':
            return ''
        names = ' or '.join(f.name for f in rivals(ranked) or ranked[:1])
        return (
            f'{names}: record longer, at rest and in the motion in question apart from each other'
        )

    def comparable(self, fits: Mapping[str, Fit], other: Problem, other_fits: Mapping[str, Fit],
                   ) -> dict[tuple[str, str], tuple[str, Estimate, Estimate]]:
        """
        Return the variance of white noise as it is at one rate; no more of what counts in samples.

        Noise of one density is the louder the faster it is sampled, but for what rounding adds.
        Beside a bank for any motion it also takes what that is too coarse for, unless at rest.

        """
        assert isinstance(other, FilterProblem)
        fit, other_fit = fits[self.target], other_fits[self.target]
        out: dict[tuple[str, str], tuple[str, Estimate, Estimate]] = {}
        again = abs(other.dt / self.dt - 1) > ONE_RATE
        moves = self._moves_bank(fit) or other._moves_bank(other_fit)
        for e in fit.model.of(FilterEffect):
            for p in e.parameters if e.label in other_fit.estimates else ():
                x, y = (f.estimates[e.label][p.name] for f in (fit, other_fit))
                what = f'{e.label}.{p.name}'
                white = p.name == e.variance
                if white and again:
                    y = _sampled(y, other.dt / self.dt, other.step**2 / 12)
                    what += f' at {1 / self.dt:.4g} Hz'
                if white and moves or e.counts and again:
                    x, y = (replace(v, std=None, ci95=None) for v in (x, y))
                if white or e.counts:
                    out[e.label, p.name] = what, x, y
        return out

    def _moves_bank(self, fit: Fit) -> bool:
        """Tell whether a record holds more than the noise beside a bank for any motion."""
        white = white_of(fit.model)
        return covers(fit.model) and white is not None and bool(
            np.var(self.seen) > MOVES * white[white.variance])

    @cached_property
    def look(self) -> Look:
        """A first look at the series, for starting values."""
        z = self.bridged
        r = float(quiet_variance(z[:, None])[0])
        rough = z - np.mean(z)
        white = np.diff(z, 3) / np.sqrt(20 * r)
        tails = bool(np.max(np.abs(white)) > np.sqrt(2 * np.log(len(white))) + 1.5)
        return Look(z, white, self.dt, r, _lines(rough, self.dt), tails)


def _sampled(x: Estimate, ratio: float, rounding: float) -> Estimate:
    """Return the variance of white noise at another rate, of which rounding's part stays."""

    def scaled(r: float) -> float:
        return (r - min(rounding, r)) * ratio + min(rounding, r)

    return replace(x, value=None if x.value is None else scaled(x.value),
                   std=x.std and x.std * ratio,
                   ci95=x.ci95 and (scaled(x.ci95[0]), scaled(x.ci95[1])))


def _lines(z: np.ndarray, dt: float, most: int = 3) -> np.ndarray:
    """
    Return (frequency, amplitude) of the strongest slow lines.

    Then of the fast ones that stand out most.

    """
    n = len(z)
    c2 = cosine_transform(z) ** 2
    f = np.arange(n) / (2 * n * dt)
    size = 65
    padded = np.pad(c2, size // 2, mode='reflect')
    local = np.median(np.lib.stride_tricks.sliding_window_view(padded, size)[::8], axis=1)
    rank = c2 / np.maximum(np.interp(np.arange(n), np.arange(len(local)) * 8, local), 1e-300)
    out = []
    for what, band in ((c2, (f >= 0.02) & (f < 3.0)), (rank, f >= 3.0)):
        some = np.flatnonzero(band)
        for _ in range(most):
            if len(some):
                at = some[int(np.argmax(what[some]))]
                out.append(_line_near(z, f[at], dt))
                some = some[np.abs(some - at) > 3]
    return np.array(out).reshape(-1, 2)


def _line_near(z, f, dt):
    """Return frequency and amplitude of the sinusoid near f (Hz) that fits z best."""
    n = len(z)
    t = np.arange(n) * dt

    def wave(x):
        return np.exp(-2j * np.pi * x * t) @ z

    width = 1 / (n * dt)
    grid = np.clip(f + width * np.linspace(-0.75, 0.75, 7), 0.25 * width, None)
    near = grid[int(np.argmax([abs(wave(x)) for x in grid]))]
    found = minimize_scalar(lambda x: -abs(wave(x)),
                            bounds=(max(near - width / 4, 0.2 * width), near + width / 4),
                            method='bounded', options={'maxiter': 12})
    return float(found.x), 2 * abs(wave(found.x)) / n


def problem_of(
    t: np.ndarray, z: np.ndarray, target: str, stated: Any = None, alpha: float = 1.0,
    held: np.ndarray | None = None
) -> FilterProblem:
    """
    Return the problem of one axis of a record: what :func:`placed` takes of it.

    ``part`` says from which sample of the record to which that goes. What
    :mod:`~imu_noise_tools.filter.held` found, (n,), is left out.

    """
    series = placed(t, z, target, held)
    problem = FilterProblem(series.z, series.dt, target, stated, alpha)
    problem.part = series.part
    problem.share = len(problem.seen) / len(t)
    return problem


def problems(arrays: Mapping[str, Any]) -> dict[str, FilterProblem]:
    """Return the problem of each axis from the arrays of evidence.npz."""
    out = {}
    for target in [str(a) for a in arrays['targets']]:
        stated: dict = {}
        for key, value in zip(arrays[f'{target}.stated_names'], arrays[f'{target}.stated_values']):
            label, _, name = str(key).rpartition(':')
            entry = stated.setdefault(label, {})
            if name:
                entry[name] = float(value)
        dt, alpha, *share = arrays[f'{target}.settings'].tolist()
        out[target] = FilterProblem(arrays[f'{target}.z'], dt, target, stated, alpha)
        out[target].share = share[0] if share else 1.0      # studies of before have none
    return out


def arrays_of(found: Mapping[str, FilterProblem]) -> dict[str, np.ndarray]:
    """Return the arrays of evidence.npz, ``target.field``, which :func:`problems` reads back."""
    out = {'targets': np.array(list(found))}
    for target, p in found.items():
        pairs = [
            (f'{label}:{k}', v)
            for label, values in p.stated.items()
            for k, v in (values or {'': 0.0}).items()
        ]
        out[f'{target}.z'] = p.z
        out[f'{target}.settings'] = np.array([p.dt, p.alpha, p.share])
        out[f'{target}.stated_names'] = np.array([k for k, _ in pairs], dtype=str)
        out[f'{target}.stated_values'] = np.array([v for _, v in pairs], dtype=float)
    return out
