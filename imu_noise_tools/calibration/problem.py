# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The loop's view of a calibration: poses left out in turn, tests, what could be missing."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc

from . import flexible, places, solve
from .advice import advise, HIDES, scatter_in_words
from .effects import Drift, Regressor, Scatter
from .linear import equations, LeftOut, MAGNITUDES, tilt_of, whitened
from .poses import Poses, unit
from ..core.errors import degrees_of_freedom, FitError, UsageError
from ..loop.effect import (
    Effect, Estimate, Finding, Fit, Model, registry, Score, unfitted, View)
from ..loop.problem import Problem
from ..loop.verdict import FLEXIBLE, FLEXIBLE_SHARE

_CHANCE = 0.005
_HIDDEN = 10.0          # times as wide, from which a value holds only without an effect (a choice)
_UNKNOWN = 0.1          # of gravity, or of a scale: known no better, it is not known
_MET = 0.01             # of the variance of noise, left in what is met whatever it is (a choice)
_SAME = 'looks the same as what is already in the model'
_PROMISING = 0.05       # candidates below this p-value are fitted, so that they have values


@dataclass(frozen=True)
class CalibrationProblem(Problem):
    """
    One sensor's poses, and how they are fitted: all that the loop needs.

    Parameters
    ----------
    poses : Poses
        The poses.
    method : str
        ``faces``, ``wls``, ``norm`` or ``few``; ``ols`` fits plainly and is judged with the
        weights of ``wls``.
    tilt : float
        Stated tilt of the faces, rad (rms of each of two angles).

    """

    poses: Poses
    method: str = 'wls'
    tilt: float = solve.TILT
    whole: CalibrationProblem | None = field(default=None, repr=False, compare=False)
    _fits: dict = field(default_factory=dict, init=False, repr=False, compare=False)
    _courses: dict = field(default_factory=dict, init=False, repr=False, compare=False)

    domain = 'calibration'
    looks = 40      # each takes a fraction of a second

    @property
    def target(self) -> str:
        """``accel`` or ``gyro``."""
        return self.poses.sensor

    def exchanges(self, effect: Effect | None,
                  later: Sequence[Effect | None]) -> Collection[str]:
        """Return all names: a fit takes next to nothing."""
        return registry('calibration')

    @property
    def unit(self) -> str:
        """Unit of the outputs."""
        return 'm/s^2' if self.target == 'accel' else 'rad/s'

    @property
    def _free(self) -> bool:
        return self.method in (*MAGNITUDES, 'faces')

    def _with(self, poses: Poses) -> CalibrationProblem:
        return CalibrationProblem(poses, self.method, self.tilt, self)

    def split(self) -> list[tuple[Problem, Problem]]:
        """Return (all but one pose, that pose), for every pose."""
        return [(self._with(self.poses.without(k)), self._with(self.poses.take(k)))
                for k in range(self.poses.n)]

    def fit(self, model: Model) -> Fit:
        """
        Fit a model; see :func:`solve.fit`.

        All but one pose are fitted with the scatter (tilt, repeatability) of all: one number,
        which a pose more or less hardly changes.

        """
        model = unfitted(model)
        if model not in self._fits:
            at, placed = self._placed(model)
            fit = self._solved(at)
            self._fits[model] = replace(fit, estimates={
                k: {**placed.get(k, {}), **v} for k, v in fit.estimates.items()})
        return self._fits[model]

    def _solved(self, model: Model) -> Fit:
        """Fit a model whose effects have their places."""
        known, tilt = None, self.tilt
        if self.whole is not None and model.of(Scatter):
            found = self.whole.fit(model)
            known = {e.label: e.amplitude for e in found.model.of(Scatter)}
            tilt = found.details.tilt
        return solve.fit(model, self.poses, self.method, tilt, known)

    def _placed(self, model: Model) -> tuple[Model, dict[str, dict[str, Estimate]]]:
        """
        Return a model with each effect at its place, and where that is, by label.

        All but one pose are fitted with the place that all have.

        """
        found: dict[str, dict[str, Estimate]] = {}
        for e in (e for e in model.of(Regressor) if e.placed):
            if self.whole is not None:
                at = self.whole.fit(model).estimates[e.label][e.placed]
            else:
                rest = self.fit(model.minus(e.label))
                at = places.best(e, self._held, lambda x: self._gain(rest, x))
            found[e.label] = {e.placed: at}
        return model.with_values({k: {p: float(x.point or 0.0) for p, x in v.items()}
                                  for k, v in found.items()}), found

    @property
    def _held(self) -> Poses:
        """The poses between which something may happen to the biases."""
        return self.poses

    def without(self, k: int) -> CalibrationProblem:
        """Return the problem without one pose."""
        return CalibrationProblem(self.poses.without(k), self.method, self.tilt)

    def score(self, fit: Fit) -> Score:
        """
        Score a fit made on other poses by these: squared error over predicted variance.

        Directions of which the other poses say nothing are not counted (nan where none is left).

        """
        system, theta = fit.details.equations, fit.details.theta
        scale, poses = fit.details.scale, self.poses
        if self._free:
            # the equations' own S: what is reported may be rotated
            theta = system.theta
            scale, poses = _directed(fit, poses)
        mine, _ = equations(fit.model, poses, scale, fit.details.tilt, self.method, before=False)
        residual = mine.right - mine.matrix @ theta
        cov = fit.details.cov if fit.details.method == 'ols' else system.cov
        seen = _complement(system, mine.matrix)
        spread = mine.matrix @ cov @ mine.matrix.T
        value, vector = np.linalg.eigh(seen.T @ (np.eye(len(residual)) + spread) @ seen)
        vector = seen @ vector
        pull = (vector.T @ residual) / np.sqrt(value)
        std = np.sqrt(2 / max(1, len(pull)))
        log_score = _log_score(pull, value, vector, mine.whitener[0]) if poses.n == 1 else None
        return score_of(np.repeat(poses.time.mean(), len(pull)), pull, std, log_score)

    def held_out(self, model: Model) -> Score:
        """Return the score of all poses left out in turn: split, fit and score, closed form."""
        left = self.left_out(self.fit(model))
        log_score = sum(_log_score(e / np.sqrt(v), v, vector, w) for e, v, vector, w in
                        zip(left.error, left.variance, left.vectors, left.equations.whitener))
        return score_of(np.repeat(self.poses.time, left.bins), left.pulls, left.excess_std,
                        log_score)

    def summary(self, fit: Fit) -> dict[str, float]:
        """Return rms of the residuals and of the errors of poses left out, and chi-squared."""
        rms = [float(np.sqrt(np.mean(np.sum(np.square(e), axis=0)))) for e in
               (fit.details.residual, self.left_out(fit).outputs().T)]
        residual = {} if self.meets_any(fit) else {'residual_rms': rms[0]}
        return {**residual, 'left_out_rms': rms[1], 'chi_squared': fit.details.chi2,
                'dof': float(fit.details.dof)}

    def meets_any(self, fit: Fit) -> bool:
        """
        Tell whether as many coefficients as poses meet the magnitudes whatever these are.

        Nothing of noise is left in them then: how well they are met says nothing.

        """
        return self._free and bool(np.mean(fit.details.equations.left_of_noise()) < _MET)

    def left_out(self, fit: Fit) -> LeftOut:
        """Return each pose as the others predict it."""
        return fit.details.equations.left_out()

    def omnibus(self, fit: Fit) -> list[Finding]:
        """Return the tests of the whole: chi-squared, the worst pose, a drift in time."""
        system, left = fit.details.equations, self.left_out(fit)
        total = self._chi2_tail(fit)
        found = [Finding('chi_squared', 0.0, p_value=total, view='poses',
                         evidence=f'chi-squared {system.chi2:.1f} with '
                                  f'{degrees_of_freedom(system.dof)}')]
        tail = self._log_tail(fit, left)
        k = int(np.argmin(tail))
        found.append(Finding(
            'worst_pose', 0.0, view='poses',
            p_value=float(min(1.0, self.poses.n * np.exp(tail[k]))),
            evidence=f'{self.poses.names[k]} at {self.poses.time[k]:.0f} s is '
                     f'{np.sqrt(left.x[k]):.1f} standard errors from what the others predict'))
        gain, rank = system.gain(self.columns(fit, Drift()))
        if rank:
            found.append(Finding('drift', 0.0, p_value=float(chdtrc(rank, 2 * gain)), view='time',
                                 evidence='residual against the time of the pose'))
        return found

    def _tilted_share(self, fit: Fit) -> np.ndarray:
        """Return which part of each pose's axial variance is tilt, (n,)."""
        if self._free:
            return np.zeros(self.poses.n)
        rms = tilt_of(fit.model, self.tilt)
        axis = unit(self.poses.inputs)
        back = np.linalg.inv(fit.details.equations.whitener)
        variance = np.sum(np.einsum('in,nij->nj', axis, back) ** 2, axis=1)
        own = np.sum(axis * (fit.details.scale @ self.poses.inputs), axis=0)
        return (own * rms ** 2) ** 2 / np.where(variance > 0, variance, 1.0)

    def _overdispersion(self, fit: Fit) -> float:
        """
        Return by how much chi-squared scatters more than its name says, as variance.

        The square of a centred exponential has variance 8, of a normal variable 2.

        """
        system, share = fit.details.equations, self._tilted_share(fit)
        return 1 + 3 * float(np.sum(share ** 2)) * max(1, system.dof) / len(system.right) ** 2

    def _chi2_tail(self, fit: Fit) -> float:
        """Return the chance of a larger chi-squared, by its first two moments."""
        system, ratio = fit.details.equations, self._overdispersion(fit)
        return float(chdtrc(system.dof / ratio, system.chi2 / ratio)) if system.dof else 1.0

    def columns(self, fit: Fit, effect: Regressor) -> np.ndarray:
        """Return the whitened columns, (k, p), that an effect would add to a fit's k equations."""
        system, poses = fit.details.equations, self.poses.with_inputs(fit.details.inputs)
        return whitened(system.whitener, effect.terms(poses, fit.details.scale))

    def candidates(self, fit: Fit) -> list[Finding]:
        """
        Return what could be added, the most probable first, as far as these poses show it.

        So is what lives by one bad pose alone: leave that pose out first.

        """
        found = [f if (f.p_value or 0.0) > _PROMISING else self._fitted(fit, f) for f
                 in self._screened(fit)]
        rest = self._without_a_bad_pose(fit)
        found = self._as_likely(fit, [f for f in found if f])
        return sorted((f for f in found if not rest.get(f.name, np.inf) < f.gain / 4),
                      key=lambda f: f.penalty - f.gain)

    def _as_likely(self, fit: Fit, found: list[Finding]) -> list[Finding]:
        """Return candidates: one that leaves nothing to confirm it is no likelier than others."""
        def is_confirmed(effect: Any) -> bool:
            dof = fit.details.dof       # no rank is larger than the coefficients are many
            return not isinstance(effect, Regressor) or len(effect.coefficients) < dof \
                or self._gain(fit, effect)[1] < dof

        confirmed = [is_confirmed(f.effect) for f in found]
        best = max((f.gain - f.penalty for f, yes in zip(found, confirmed) if yes),
                   default=np.inf)
        return [f if yes else replace(f, gain=min(f.gain, best + f.penalty))
                for f, yes in zip(found, confirmed)]

    def _without_a_bad_pose(self, fit: Fit) -> dict[str, float]:
        """
        Return what candidates gain without the worst pose, when that one is beyond chance.

        Of those only that then gain no more than chance does.

        """
        tail = self._log_tail(fit, self.left_out(fit))
        k = int(np.argmin(tail))
        if tail[k] > np.log(_CHANCE / self.poses.n) or self.poses.n <= 6:
            return {}
        rest = self.without(k)
        return {f.name: f.gain for f in rest._screened(rest.fit(fit.model))
                if (f.p_value or 0.0) > _CHANCE}

    def _log_tail(self, fit: Fit, left: LeftOut) -> np.ndarray:
        """
        Return the log of the chance that a pose is further from what the others predict, (n,).

        A tilt shortens the axial reading by an exponential variable, whose tail is longer than the
        normal one.

        """
        with np.errstate(divide='ignore'):
            tail = np.where(left.bins > 0, np.log(chdtrc(np.maximum(left.bins, 1), left.x)), 0.0)
        return np.where(self._tilted_share(fit) > 0.5, np.maximum(tail, -1 - np.sqrt(left.x)),
                        tail)

    def _screened(self, fit: Fit) -> list[Finding]:
        """Return each candidate with its gain, by projection: nothing is fitted."""
        able = [e for e in self._others(fit.model) if not self._why_not(e)]
        found = [(e, *self._projected(fit, e)) for e in able]
        found = [x for x in found if x[2]]
        price = _prices([(rank, tried) for _, _, rank, tried in found],
                        len(fit.details.equations.right))
        return [Finding(e.name, gain, e, penalty=penalty, evidence=_said(gain, rank, e),
                        p_value=min(1.0, tried * float(chdtrc(rank, 2 * gain))))
                for (e, gain, rank, tried), penalty in zip(found, price)]

    def _projected(self, fit: Fit, effect: Regressor | Scatter) -> tuple[float, int, float]:
        """Return the gain, the rank, and how many hypotheses it is: half where it has a sign."""
        if isinstance(effect, Scatter):
            return *self._scatter_gain(fit, effect), 0.5
        some = places.everywhere(effect, self._held)
        return *max(self._gain(fit, e) for e in some), float(len(some))

    def _fitted(self, fit: Fit, finding: Finding) -> Finding | None:
        """Return a candidate with its values; None where it cannot be, by nature or by the fit."""
        effect = finding.effect
        if effect is None:
            return None
        try:
            more = self.fit(fit.model + effect)
        except FitError:
            return None
        effect, estimates = more.model[finding.name], more.estimates[finding.name]
        if not _possible(effect, estimates):
            return None
        gain, said = finding.gain, finding.evidence
        if isinstance(effect, Regressor):
            # what names are told apart by: the likelihood, scatter and directions found anew
            gain = more.log_likelihood - fit.log_likelihood
            said = _said(gain, more.details.equations.rank - fit.details.equations.rank, effect)
        elif gain > finding.penalty and (doubt := scatter_in_words(self, more, finding.name)):
            said = f'{said}; {doubt}'
        # A candidate that leaves a test wrong, with nothing else in sight, has to answer for that
        # test.
        left = [f.name for f in self.omnibus(more) if (f.p_value or 0.0) < _CHANCE / 3]
        others = any(f.gain > f.penalty for f in self._screened(more))
        answers = left[0] if left and not others else 'poses'
        return replace(finding, effect=effect, estimates=estimates, view=answers, gain=gain,
                       evidence=f'{said}; {self._where(fit, more)}')

    def shape(self, fit: Fit, label: str, claim: float) -> str:
        """
        Say that what a scatter explains follows direction or time: then it has no name.

        Nor has what passes in time where what it leaves goes on in time, by more than a formula
        may leave of what is real. And what has more coefficients than it leaves equations may
        follow whatever there is.

        """
        effect, dof = fit.model[label], fit.details.dof
        if isinstance(effect, Regressor):
            against = self._unconfirmed(fit.model)
            if against:
                return against
            left = 0.5 * (fit.details.chi2 - dof)
            if not effect.passing or left < max(FLEXIBLE, FLEXIBLE_SHARE * claim):
                return ''
        course = self.course(fit, label)
        if course is None or not course.refutes:
            return ''
        if isinstance(effect, Regressor):
            return '' if course.of != 'time' else (
                f'it leaves {left:.0f} nats that are a smooth course in time as well: it is one '
                f'without a name')
        return (f'{course.followed(self.target)}: a smooth one without a name explains '
                f'{100 * course.share:.0f} % of it, which scatter reaches in less than one case '
                f'of {1 / flexible.RARE:.0f}')

    def _unconfirmed(self, model: Model) -> str:
        """
        Say that too few equations are left to confirm what is in a model.

        Fewer than its coefficients, which still do not agree; or it took several effects until
        they did, which of many combinations some do by chance.

        """
        some = Model(e for e in unfitted(model) if not isinstance(e, Scatter))
        bare, base = self.fit(some), self.fit(solve.base_model())
        left = bare.details.dof
        rank = base.details.dof - left
        several = len(some) > len(base.model) + 1
        if rank <= left or not several and (not left or self._chi2_tail(bare) > _CHANCE):
            return ''
        return f'{self.poses.n} poses leave {left} equations to confirm {rank} coefficients'

    def course(self, fit: Fit, label: str) -> flexible.Course | None:
        """
        Return what a smooth course does in place of a scatter of the model.

        Or in place of the noise with which all but a scatter of the model is fitted.

        """
        effect, model = fit.model[label], unfitted(fit.model)
        if self.method == 'turns' or isinstance(effect, Scatter) and effect.tilts:
            return None     # a tilt shows in what it leaves
        if (model, label) not in self._courses:
            poses, system = self.poses.with_inputs(fit.details.inputs), fit.details.equations
            noise = 1.0
            if isinstance(effect, Scatter):
                own = effect.covariance(poses, fit.details.scale, effect.amplitude)
                noise -= np.einsum('nra,nab,nrb->nr', system.whitener, own,
                                   system.whitener).mean()
            self._courses[model, label] = flexible.course_of(
                system, poses, float(np.clip(noise, 0.0, 1.0)))
        return self._courses[model, label]

    def refuting(self, fallen: Collection[str]) -> flexible.Course | None:
        """Return the course that refuted one of the scatters that have fallen, if one did."""
        return next((c for (_, label), c in reversed(self._courses.items())
                     if label in fallen and c is not None and c.refutes), None)

    def blind(self, fit: Fit) -> list[tuple[str, str, str]]:
        """
        Return (effect, why, what would show it) for all that these poses cannot show.

        Last what they show only where it is far larger than what would spoil a value of the base.

        """
        out, hidden = [], []
        for e in self._others(fit.model):
            if self.target not in e.sensors:
                continue
            why = self._why_not(e)
            if not why and isinstance(e, Regressor) and not self._projected(fit, e)[1]:
                why = _SAME
            if why:
                out.append((e.name, why, e.needs))
            elif isinstance(e, Regressor) and (values := self._spoilt(fit, e)):
                alike = any(v > _UNKNOWN * (self.poses.magnitude if k == 'bias' else 1.0)
                            for k, v in values.items())
                hidden.append((e.name, _SAME if alike else HIDES + ' and '.join(
                    f'{k} (\u00b1{v:.2g}{" " + self.unit if k == "bias" else ""} with it)'
                    for k, v in values.items()), e.needs))
        return out + hidden

    def _spoilt(self, fit: Fit, effect: Regressor) -> dict[str, float]:
        """
        Return which values of the base are known far worse with an effect in the model, and how.

        The rank alone does not tell: faces held by hand are tilted, so that no column is quite
        another one's multiple. By label, the largest standard deviation.

        """
        if effect.placed:
            return {}
        wide = fit.details.equations.inflation(self.columns(fit, effect))
        worse: dict[str, float] = {}
        for (label, name), times in zip(fit.details.keys, wide):
            std = fit.estimates[label][name].std
            if label in solve.BASE and times > _HIDDEN and std is not None:
                worse[label] = max(worse.get(label, 0.0), times * std)
        return worse

    def _why_not(self, effect: Regressor | Scatter) -> str:
        if self.method == 'faces' and isinstance(effect, Scatter) and effect.tilts:
            return 'the tilt of these faces is found in every fit'
        return effect.why_not(self.poses)

    @staticmethod
    def _others(model: Model) -> list[Regressor | Scatter]:
        every = [cls() for cls in registry('calibration').values() if cls.name not in model]
        return [e for e in every if isinstance(e, (Regressor, Scatter))]

    def _gain(self, fit: Fit, effect: Regressor) -> tuple[float, int]:
        return fit.details.equations.gain(self.columns(fit, effect))

    def _scatter_gain(self, fit: Fit, effect: Scatter) -> tuple[float, int]:
        """Return the gain in restricted likelihood; 0 where less than is stated fits better."""
        poses, scale = self.poses.with_inputs(fit.details.inputs), fit.details.scale
        args = (poses, scale, fit.details.tilt, self.method)
        amplitude, best = solve.best_amplitude(fit.model, effect, *args)
        if effect.tilts and amplitude <= self.tilt:
            return 0.0, 1
        system, log_det = equations(fit.model, *args)
        return max(0.0, float(best - system.log_restricted(log_det))
                   / self._overdispersion(fit)), 1

    def _where(self, fit: Fit, more: Fit) -> str:
        """Say at which poses the residual falls most."""
        fall = (np.linalg.norm(fit.details.residual, axis=0)
                - np.linalg.norm(more.details.residual, axis=0))
        worst = [self.poses.names[k] for k in np.argsort(-fall)[:3] if fall[k] > 0]
        rms = [float(np.sqrt(np.mean(f.details.residual ** 2))) for f in (fit, more)]
        return (f'rms residual {rms[0]:.2g} -> {rms[1]:.2g} {self.unit}'
                + (f', most at {", ".join(worst)}' if worst else ''))

    def advice(self, verdict: str, ranked: list[Any], failed: list[Finding]) -> str:
        """Return one sentence: what to do next, and which poses would tell what these cannot."""
        return advise(self, verdict, ranked)

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return everything as plain arrays by name, for an npz file: the poses' and more."""
        return {**self.poses.to_arrays(), 'method': np.asarray(self.method),
                'tilt': np.asarray(self.tilt)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> CalibrationProblem:
        """
        Return the problem that :meth:`to_arrays` wrote.

        Raises
        ------
        UsageError
            The arrays hold something else.

        """
        if 'method' not in arrays or 'outputs' not in arrays:
            raise UsageError('the evidence holds no poses', 'run calibrate again')
        return cls(Poses.from_arrays(arrays), str(arrays['method']), float(arrays['tilt']))


def _prices(hypotheses: list[tuple[int, float]], rows: int) -> list[float]:
    """
    Return the penalty, nats, of each candidate: (rank, how many hypotheses it is).

    The Bayesian information criterion (Schwarz 1978) over ``rows`` equations, by which names are
    told from each other, and for all the same on top what lets the best of all pass it by chance
    in one case of 200.

    """
    own = [0.5 * rank * np.log(rows) + np.log(max(tried, 1.0)) for rank, tried in hypotheses]

    def beyond(more: float) -> float:
        return sum(tried * chdtrc(rank, 2 * (x + more))
                   for (rank, tried), x in zip(hypotheses, own)) - _CHANCE

    more = brentq(beyond, 0.0, 100.0) if hypotheses and beyond(0.0) > 0 else 0.0
    return [float(x + more) for x in own]


def _said(gain: float, rank: int, effect: Regressor | Scatter) -> str:
    """Say what a candidate gains and by how many coefficients."""
    of = len(effect.coefficients) if isinstance(effect, Regressor) else 1
    unseen = f' ({of - rank} of its {of} cannot be seen here)' if rank < of else ''
    return f'gain {gain:.1f} nats with {rank} coefficient{"s" * (rank > 1)}{unseen}'


def score_of(time: Any, pull: np.ndarray, std: Any, log_score: float | None) -> Score:
    """Return the score of pulls (n,) at times (n,), s: their mean square less one, and its std."""
    excess = float(np.mean(pull ** 2) - 1) if len(pull) else float('nan')
    return Score.of([View('poses', time, pull, excess, float(std), 's', log_score)])


def _complement(system, matrix: np.ndarray) -> np.ndarray:
    """Return a basis of the rows that feel nothing a system leaves undetermined, (N, k)."""
    basis, size = system.undetermined, np.linalg.norm(system.matrix, axis=0)
    if not basis.size:
        return np.eye(len(matrix))
    size = np.where(size > 0, size, 1.0)
    scaled = matrix / size
    u, felt, _ = np.linalg.svd(scaled @ (basis * size[:, None]))
    keep = np.ones(len(matrix), bool)
    keep[:len(felt)] = felt <= 1e-6 * np.linalg.norm(scaled)
    return u[:, keep]


def _log_score(pull, variance, vector, whitener) -> float:
    """Return -2 ln p of one pose's outputs, as far as predicted, up to a constant."""
    if not len(pull):
        return 0.0
    rows = vector.T @ whitener
    return float(np.sum(pull ** 2 + np.log(variance)) - np.linalg.slogdet(rows @ rows.T)[1])


def _directed(fit: Fit, poses: Poses) -> tuple[np.ndarray, Poses]:
    """Return the S of a fit's equations, and poses with the directions it sees in the outputs."""
    system = fit.details.equations
    state = solve.State(poses, system.keys, system.theta)
    scale, bias = state.scale, state.bias
    poses = poses.directed(scale, bias[:, None])
    for _ in range(5):
        poses = poses.directed(scale, solve.rest_of(fit.model, scale, poses))
    return scale, poses


def _possible(effect: Effect, estimates) -> bool:
    """Tell whether the values lie within what nature allows, give or take 3 std."""
    for p in effect.parameters:
        e = estimates[p.name]
        if isinstance(effect, Regressor) and e.std is not None and e.point is not None:
            if not p.lower - 3 * e.std <= e.point <= p.upper + 3 * e.std:
                return False
    return True
