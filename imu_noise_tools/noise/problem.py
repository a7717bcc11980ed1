# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The noise of one axis as a problem of the loop: how it is cut, fitted, scored and tested."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from . import block_means, classic, flexible, in_frequency, in_samples, in_time, rivals, views
from .candidates import candidates, no_more_than_chance, no_more_than_less, Tried
from .curve import model_curve
from .differences import differences, without_rounding
from .doubts import at_bound, hidden_by_steps
from .evidence import Evidence, from_arrays, to_arrays
from .fit import beside, fit as fit_part
from .gains import of_its_kind, price_by_chance
from .kinds import Coupling, Defect, Line, Mean, MEASURED, NoiseEffect, Response, Spectrum
from .level import clipped, in_motion, with_level_notes
from .materiality import Materiality, materiality
from .plan import durations_for, range_in_words
from .sweep import test_of
from ..core.allan import dominant_shape
from ..core.errors import unknown
from ..loop.effect import Effect, Estimate, Finding, Fit, Model, registry, Score, unfitted, View
from ..loop.findings import rivals as rivals_of
from ..loop.problem import Difference, Problem
from ..loop.verdict import SURE

NEAR = 2  # effects by which models may differ, so that the fit of one begins that of the other
METHODS = ('likelihood', 'avar', 'slopes')
#: views whose worst place is one to look at: of a distribution or of what axes share it is not
PLACED = {'frequency': 'Hz', 'shape': 'Hz', 'time': 's', 'variance': 's'}


class NoiseProblem(Problem):
    """
    One axis, or a part of it.

    Parts: ``whole``; the halves ``first`` and ``second``, which are fitted and scored for
    themselves but for the mean, which comes from the whole; ``odd`` and ``even`` blocks in time,
    of which one is predicted from the other.

    """

    domain = 'noise'

    def __init__(self, evidence: Evidence, part: str = 'whole', whole: NoiseProblem | None = None,
                 method: str = 'likelihood', bias_at: str = 'flat'):
        if method not in METHODS:
            raise unknown('method', method, METHODS)
        self.evidence, self.part = evidence, part
        self.method, self.bias_at = method, bias_at
        self.whole = whole or self
        self._fits: dict = {}
        self._points: dict = {}
        self._settled: dict[tuple[str, ...], Fit] = {}
        self._candidates: dict = {}
        self._begun: dict[frozenset[str], Fit] = {}
        self.tried: dict[tuple[str, ...], Tried] = {}
        self.complete: set[tuple[str, ...]] = set()     # beside what all were tried
        self._matters: dict = {}
        self._times: dict[tuple, View] = {}
        self._shapes: dict[tuple, str] = {}
        self._parts: tuple[NoiseProblem, ...] = ()

    @property
    def target(self) -> str:
        """Name of the axis."""
        return self.evidence.axis

    def split(self) -> list[tuple[Problem, Problem]]:
        """
        Return (to fit, to score).

        Each half is scored by the other, each parity of blocks by the other.

        """
        first, second, odd, even = self._parts = self._parts or tuple(
            NoiseProblem(self.evidence, p, self) for p in ('first', 'second', 'odd', 'even')
        )
        return [(first, second), (second, first), (odd, even), (even, odd)]

    def fit(self, model: Model) -> Fit:
        """Fit a model; a half borrows the mean of the whole, and starts from its values."""
        if self.part != 'whole':
            return self.point(model)
        if model not in self._fits:
            found = self._by_method(fit_part(self.evidence, model, smaller=self._smaller(model)))
            self._fits[model] = replace(found, estimates=self._planned(found))
        return self._fits[model]

    def begin_from(self, fit: Fit) -> None:
        """Keep a fit, from which a later one of much the same effects begins: the best one."""
        key = frozenset(self.spectral(fit.model))   # in whichever order they came
        if key not in self._begun or _explains(self._begun[key]) <= _explains(fit):
            self._begun[key] = fit

    def _near(self, model: Model) -> dict[str, Any]:
        """
        Return what a fit begins with: a fit of the nearest model, and what that rests on.

        Of the same effects it rests on the same; where a form of the spectrum makes the
        difference, what the other rests on says nothing of this one.

        """
        wanted = set(self.spectral(model))
        # of two as near the smaller one: of what it rests on this one may rest on more
        near = min(self._begun, default=None, key=lambda k: (
            len(wanted ^ k), len(k), -_explains(self._begun[k])))
        if near is None or len(wanted ^ near) > NEAR:
            return {}
        fit = self._begun[near]
        out: dict[str, Any] = {'start': fit.model}
        if near - wanted:
            # beside noise that is no longer there a filter had another form
            out['start'] = Model(e for e in fit.model
                                 if isinstance(e, MEASURED) or not isinstance(e, Response))
        other = {label.partition('.')[0] for label in wanted ^ near}
        if not other and any(fit is settled for settled in self._points.values()):
            return {**out, 'basis': fit.details.hint}
        if not any(issubclass(registry('noise')[k], (Spectrum, Response)) for k in other) \
                or wanted > near:
            out['hint'] = fit.details.hint
        return out

    @staticmethod
    def spectral(model: Model) -> tuple[str, ...]:
        """Return the labels of what is fitted to the spectrum and the mean, in their order."""
        return tuple(e.label for e in model if isinstance(e, (Spectrum, Response, Mean, Coupling)))

    def point(self, model: Model) -> Fit:
        """Fit a model without the intervals of its values, which cost most of the time."""
        if self.part in ('odd', 'even'):
            return self.whole.point(model)
        if model in self._fits:
            return self._fits[model]
        if model not in self._points:
            key = self.spectral(model) if model == unfitted(model) else None
            found = self._settled.get(key) if key is not None else None
            # lines, shocks and what changes in time are read from the samples beside any fit
            found = beside(self.evidence, found, model) if found else self._point(model)
            if key is not None:
                self._settled[key] = found
            self._points[model] = self._by_method(found)
            if self.part == 'whole':
                self.begin_from(self._points[model])
        return self._points[model]

    def _point(self, model: Model) -> Fit:
        if self.part == 'whole':
            near = self._near(model)
            return fit_part(self.evidence, model, intervals=False, cautious=True, **near,
                            smaller=None if near else self._smaller(model))
        whole = self.whole.point(model)
        return fit_part(self.evidence, model, self.part, mean=whole, intervals=False,
                        start=whole.model)

    def _smaller(self, model: Model) -> Model | None:
        """
        Return the fit of a model less the last of its effects that have shapes, if several do.

        What each proposes by the measured spectrum is far from what it is beside the others, and
        of several together no more than a few of all pairs are tried. Beside those before it, one
        after the other, each is looked for by what they leave.

        """
        shaped = [e.label for e in model.of(NoiseEffect) if not isinstance(e, MEASURED)
                  and any(not p.amplitude and not p.linear for p in e.parameters)]
        return self.point(model.minus(shaped[-1])).model if len(shaped) > 1 else None

    def _by_method(self, found):
        if self.method == 'avar':
            return classic.fit_avar(self.evidence, found)
        if self.method == 'slopes':
            return classic.fit_slopes(self.evidence, found, self.bias_at)
        return found

    def _planned(self, fit):
        """
        Say what the level is that of, where the curve shows another.

        And how long a record would show each spectral amplitude that is not observable.

        """
        out = with_level_notes(self.evidence, fit)
        if not self.matters(fit).sufficient:
            return out  # a model that does not hold plans no record
        for e in fit.model.of(Spectrum):
            for name, estimate in out.get(e.label, {}).items():
                if estimate.value is None and estimate.upper95:
                    t = durations_for(fit.model, fit.estimates, e.label, name, self.evidence.dt,
                                      begin=self.evidence.duration)
                    more = f'record {range_in_words(*t, self.evidence.duration)} for 20 %'
                    out[e.label][name] = replace(estimate, note=f'{estimate.note}; {more}')
        return out

    def score(self, fit: Fit) -> Score:
        """Score a fit made on other data."""
        e = self.evidence
        if self.part in ('odd', 'even'):
            return Score.of([self.whole.time(fit, 'even' if self.part == 'odd' else 'odd')])
        if self.part == 'whole':
            return Score.of(
                [in_frequency.frequency(e, 'whole', fit, fitted_here=True), self.time(fit, 'odd')]
            )
        # what acts on the samples and the mean was estimated on the whole: the fit that knows it
        # is the whole's
        whole = self.whole.point(unfitted(fit.model))
        found = [in_frequency.frequency(e, self.part, fit, mean=whole),
                 *in_samples.of_samples(e, self.part, whole)]
        if self.part == 'second':  # these views have no fitted part that could be held out
            found += [
                in_time.variance(e, fit),
                in_samples.distribution(e, fit),
                in_frequency.coherence(e, whole),
            ]
        return Score.of(found)

    def time(self, fit: Fit, known: str) -> View:
        """Return the view in time, worked out once for all models that say the same of it."""
        said = (e for e in fit.model if isinstance(e, Spectrum) or not isinstance(e, Defect))
        key = known, *said
        if key not in self._times:
            self._times[key] = block_means.time(self.evidence, fit, known)
        return self._times[key]

    def omnibus(self, fit: Fit) -> list[Finding]:
        """
        Return one test a view, on the whole record.

        What fails says that something is missing; its gain is what there is to explain, nats.

        """
        e = self.evidence
        out = [flexible.smooth_misfit(e, fit), flexible.slow_misfit(e, fit), test_of(e.sweep)]
        for view in (
            in_frequency.frequency(e, 'whole', fit, fitted_here=True),
            self.time(fit, 'odd'),
            self.time(fit, 'even'),
            in_time.variance(e, fit),
            in_samples.distribution(e, fit),
            in_frequency.coherence(e, fit),
            *in_samples.of_samples(e, 'whole', fit),
        ):
            if len(view.pull) and not view.muted:
                worst = int(np.argmax(np.abs(view.pull)))
                out.append(
                    Finding(
                        view.name,
                        0.5 * len(view.pull) * view.excess,
                        view=view.name,
                        p_value=views.p_value(view),
                        evidence=_worst(view, worst),
                        log_score=view.log_score,
                        where=_place(view, worst),
                    )
                )
        return out

    def candidates(self, fit: Fit) -> list[Finding]:
        """Return what could be added, best gain first."""
        if fit.model not in self._candidates:
            self._candidates[fit.model] = candidates(self, fit)
        return list(self._candidates[fit.model])

    def falls_by_chance(self, effect: Effect) -> float:
        """
        Return the deviance by which an effect that is not there lowers the error by chance.

        Each half of what it gains in all by chance is predicted by the other: a fit to one half
        begins, and of a place ends, where the whole record has it.

        """
        assert isinstance(effect, NoiseEffect)
        return max(super().falls_by_chance(effect), 2 * price_by_chance(effect, self.evidence))

    def some_candidates(self, fit: Fit, wanted: Callable[[type[Effect]], bool]) -> list[Finding]:
        """Return the candidates of the kinds that are wanted, fitted without the others."""
        if self.knows_candidates(fit):
            return super().some_candidates(fit, wanted)
        return candidates(self, fit, wanted)

    def exchanges(self, effect: Effect | None,
                  later: Sequence[Effect | None]) -> Collection[str]:
        """Return those of its kind, which the samples may know better beside what came later."""
        moved = any(isinstance(e, (Mean, Response)) for e in later)
        return of_its_kind(effect) if moved and isinstance(effect, NoiseEffect) else ()

    def knows_candidates(self, fit: Fit) -> bool:
        """Tell whether all that is fitted was tried beside such a model already."""
        return self.spectral(fit.model) in self.complete

    def shape(self, fit: Fit, label: str, claim: float) -> str:
        """
        Say that a flexible form does better than an effect of the model, which gains claim.

        Or that beside the others its form is none: what is refused as a candidate is no member.

        """
        key = (*fit.model.labels, label, claim)
        if key not in self._shapes:
            without = fit.model
            for k in rivals.joined(fit, label, self.evidence.dt):
                without = without.minus(k)
            without = self.point(unfitted(without))
            self._shapes[key] = at_bound(
                self.evidence, fit.model[label], fit.estimates.get(label, {})) \
                or hidden_by_steps(self.evidence, fit.model.minus(label), fit.model[label]) \
                or no_more_than_less(self, fit, label) \
                or rivals.shape(self.evidence, fit, without, label, claim) \
                or no_more_than_chance(self, fit, without, label)
        return self._shapes[key]

    def materiality(self, fit: Fit) -> tuple[float, float, bool]:
        """Return the share of power that a model leaves, the largest ratio, and if it suffices."""
        found = self.matters(fit)
        return sum(f.share for f in found.failures), found.largest_ratio, found.sufficient

    def matters(self, fit: Fit) -> Materiality:
        """Return what the failures of a fit change in the curve and in the coefficients."""
        if fit.model not in self._matters:
            self._matters[fit.model] = materiality(self.evidence, fit)
        return self._matters[fit.model]

    def in_motion(self) -> float:
        """Return what N is while the sensor moves over a coarse grid, 0 where there is none."""
        return in_motion(self.evidence)

    def basis(self, fit: Fit) -> dict:
        """Return what the numbers of a fit rest on, and whether what they do not matters."""
        found = self.matters(fit)
        out: dict = {'sufficient': found.sufficient}
        if found.failures or not found.sufficient:
            out['largest_ratio'] = found.largest_ratio
            out['at_tau'] = found.at_tau
            out['failures'] = [
                {'from_hz': f.low, 'to_hz': f.high, 'share': f.share, 'ratio': f.ratio,
                 'tau': f.tau} for f in found.failures
            ]
        if fit.details.set_aside:
            out['set_aside'] = [
                {'from_hz': s.low, 'to_hz': s.high, 'share': s.share, 'power_ratio': s.ratio,
                 'direction': s.direction} for s in fit.details.set_aside
            ]
        if np.isfinite(fit.details.hint.quiet):
            out['quiet_from_hz'] = fit.details.hint.quiet
            out['switched_on_s'] = self.evidence.loud.tolist()
        return out

    def advice(self, verdict: str, ranked: list[Finding], failed: list[Finding]) -> str:
        """Return which recording would decide, or where to look."""
        said = self._advice(verdict, ranked, failed)
        end = clipped(self.evidence)
        if not end:
            return said
        if verdict == 'unknown' and {f.name for f in failed} == {'distribution'}:
            said = ''       # no effect, but known
        return f'{end.capitalize()}: mean and N are wrong; choose a larger range. {said}'.rstrip()

    def _advice(self, verdict: str, ranked: list[Finding], failed: list[Finding]) -> str:
        if verdict == 'undecidable':
            able = rivals_of(ranked) or [f for f in ranked if f.gain > f.penalty] or ranked[:1]
            said = dict.fromkeys(f'{f.name}: {f.effect.decide}' for f in able[:3]
                                 if isinstance(f.effect, NoiseEffect))
            return f'This record cannot tell. What would: {"; ".join(said)}.'
        if verdict == 'unknown':
            near = [f.effect for f in ranked if f.gain > f.penalty and f.against
                    and isinstance(f.effect, NoiseEffect) and f.effect.decide]
            return where_to_look(failed) or ''.join(
                f'To see whether it is {e.name} after all: {e.decide}.' for e in near[:1])
        found = [f.effect for f in ranked if verdict == 'missing' and not f.against
                 and (f.probability or 0.0) >= SURE]
        return ' '.join(dict.fromkeys(filter(None, (
            e.lacking(self.evidence) for e in found if isinstance(e, NoiseEffect)))))

    def summary(self, fit: Fit) -> dict[str, float]:
        """
        Return the rms relative difference of model and measured Allan deviation, in percent.

        It is taken over tau <= T/10.

        ``misfit_expected`` is what a true model would show: the scatter of the measured deviation
        itself.

        """
        c = self.evidence.curve
        some = c.tau <= c.n * c.dt / 10
        if some.sum() < 2 or c.deviation not in ('oadev', 'adev'):
            return {}
        model = np.sqrt(model_curve(self.evidence, fit.model, c.m[some]))
        return {
            'misfit_percent': 100 * float(np.sqrt(np.mean((model / c.dev[some] - 1) ** 2))),
            'misfit_expected': 100 * float(np.sqrt(np.mean(1 / (2 * c.edf[some])))),
        }

    def remarks(self, fit: Fit) -> list[str]:
        """Return whether failures matter, and what the curve of a model that holds looks like."""
        found = self.matters(fit)
        shape = [dominant_shape(self.evidence.curve)] if found.sufficient else []
        return [str(found)] * bool(found.failures or not found.sufficient) + shape

    def differences(self, fit: Fit, other: Problem, other_fit: Fit) -> list[Difference]:
        """Return how power differs from another record's, band by band, and how its lines do."""
        assert isinstance(other, NoiseProblem)
        return differences(self.evidence, fit, other.evidence, other_fit)

    def comparable(self, fits: Mapping[str, Fit], other: Problem, other_fits: Mapping[str, Fit],
                   ) -> dict[tuple[str, str], tuple[str, Estimate, Estimate]]:
        """Return white noise without what goes with rate and bias where samples are rounded."""
        assert isinstance(other, NoiseProblem)
        return without_rounding(self.evidence, fits[self.target], other.evidence,
                                other_fits[self.target])

    def differs_in_data(self, effect: Effect) -> bool:
        """Tell so of lines: those of one label in two models need not be the same."""
        return isinstance(effect, Line)


def _explains(fit: Fit) -> float:
    """Return ln L of what a fit explains."""
    return -np.inf if fit.supported is None else fit.supported


def problems(arrays: Mapping[str, np.ndarray]) -> dict[str, NoiseProblem]:
    """Return the problem of each axis from the arrays of evidence.npz, ``axis/field``."""
    arrays = dict(arrays)
    method, bias_at = (str(arrays.pop(k)) for k in ('method', 'bias_at'))
    return {
        axis: NoiseProblem(e, method=method, bias_at=bias_at)
        for axis, e in from_arrays(arrays).items()
    }


def arrays_of(found: dict[str, NoiseProblem]) -> dict[str, np.ndarray]:
    """Return the arrays of evidence.npz, ``axis/field``, which :func:`problems` reads back."""
    some = next(iter(found.values()))
    return {
        **to_arrays({axis: p.evidence for axis, p in found.items()}),
        'method': np.array(some.method),
        'bias_at': np.array(some.bias_at),
    }


def _place(view: View, k: int) -> str:
    """Return where there is something to look for, if anywhere: not where power is missing."""
    there = view.name in PLACED and (PLACED[view.name] != 'Hz' or view.pull[k] > 0)
    return f'{view.x[k]:.4g} {view.unit}' if there else ''


def _worst(view: View, k: int) -> str:
    """Return where a view fails most, and by how much."""
    x, pull = float(view.x[k]), float(view.pull[k])
    place = f'the {100 * x:.3g} % quantile' if view.unit == 'quantile' else f'{x:.4g} {view.unit}'
    return f'worst at {place}, {abs(pull):.1f} standard errors {"above" if pull > 0 else "below"}'


def where_to_look(failed: Sequence[Finding]) -> str:
    """
    Return at which times and at which frequency to look for what makes tests fail, if at any.

    Where the form of the spectrum fails as well, its worst bin is no place: what is missing is
    broad, or the band that form names. Means of so long scatter otherwise than the model says
    at all times then; so they do in a slow course of the mean. A line that sweeps was at many
    frequencies.

    """
    names = {f.name for f in failed}
    broad = {'frequency': {'shape', 'sweep'}, 'shape': {'sweep'}, 'time': {'shape', 'course'},
             'variance': set()}
    told = [f for f in failed if f.where and f.name in PLACED and not names & broad[f.name]]
    times = list(dict.fromkeys(f.where for f in told if PLACED[f.name] == 's'))
    lines = [f.where for f in told if PLACED[f.name] == 'Hz']
    said = [f'at what was going on at {" and at ".join(times)}'] if times else []
    said += [f'for what turns or swings at {lines[0]}'] if lines else []
    said += ['for what ran up or down while the line swept'] if 'sweep' in names else []
    return f'Look {", and ".join(said)}.' if said else ''
