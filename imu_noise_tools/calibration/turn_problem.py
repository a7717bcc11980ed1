# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The loop's view of a gyroscope calibrated by the turns between rests: turns left out in turn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtri, fdtrc, stdtrit

from . import places, solve
from .between import begins, ends, integrated, misses, sums, tangents, Turns
from .correction import Correction
from .effects import Regressor, Scatter
from .linear import elements, Equations, keys_of, terms_of
from .poses import joined, Poses
from .problem import CalibrationProblem, score_of
from ..core.errors import FitError
from ..core.statistics import TWO_SIDED
from ..loop.effect import Finding, Fit, Model, Score

_ROUNDS = 30
_CLOSE = 1e-9
_WILD = np.radians(20.0)        # a turn that misses by more is linearised in vain
SCALE_STD = 0.01                # a scale known worse is no calibration
_DOF_SCALE = 20         # equations left, from which a scatter is known to a sixth
_ALIKE = 0.02                   # hands do not reach the same rate again as closely as this


@dataclass(frozen=True)
class TurnsProblem(CalibrationProblem):
    """
    One gyroscope's turns between rests, and the rests.

    The errors of the turns (rad) and of the rests (rad/s) are noise and a scatter each, which is
    found in every fit so that chi-squared is what chance makes it, where noise alone explains
    less.

    """

    turns: Turns | None = None
    _last: list = field(default_factory=list, init=False, repr=False, compare=False)
    _least: list = field(default_factory=list, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, turns: Turns) -> TurnsProblem:
        """Return the problem of some turns."""
        return cls(_as_poses(turns), 'turns', 0.0, turns=turns)

    @property
    def data(self) -> Turns:
        """The turns."""
        assert self.turns is not None
        return self.turns

    @property
    def _free(self) -> bool:
        return True

    def split(self) -> list[tuple[Any, Any]]:
        """Return (all but one turn, that turn), for every turn."""
        return [(TurnsProblem.of(self.data.without(k)), TurnsProblem.of(self.data.take(k)))
                for k in range(self.data.n)]

    def without(self, k: int) -> CalibrationProblem:
        """Return the problem without one pose: a turn, or all of it where a rest is named."""
        return TurnsProblem.of(self.data.without(k)) if k < self.data.n else self

    def _solved(self, model: Model) -> Fit:
        """Fit a model; see :mod:`.between`; raise FitError where it does not converge."""
        with np.errstate(over='ignore', invalid='ignore'):      # of a fit that diverges
            return _fit(model, self.data, self.poses)

    @property
    def _held(self) -> Poses:
        """The rests."""
        return self.data.rests

    def score(self, fit: Fit) -> Score:
        """Score a fit made on other turns by these: squared angle over predicted variance."""
        details = fit.details
        at = _At(fit.model, self.data, details.keys, details.theta)
        basis = tangents(self.data.before)
        rows = np.einsum('nri,nik->nrk', basis, at.change)
        # turns dither what rests hide of the bias: it is no error of theirs
        known = details.cov - _hidden(self.data, details.keys)
        cov = np.einsum('nrk,kl,nsl->nrs', rows, known, rows)
        cov += np.eye(2) * (self.data.spread ** 2 + details.tilt ** 2)[:, None, None]
        value, vector = np.linalg.eigh(cov)
        error = np.einsum('nri,ni->nr', basis, misses(self.data, at.rotation))
        pull = np.einsum('nrs,nr->ns', vector, error) / np.sqrt(value)
        return score_of(np.repeat(self.data.rests.time.mean(), pull.size), pull.ravel(),
                        np.sqrt(2 / max(1, pull.size)),
                        float(np.sum(pull ** 2 + np.log(value))))

    def held_out(self, model: Model) -> Score:
        """
        Return the score of all turns left out, with one scatter for all models.

        What a model lacks is in the scatter that it is fitted with, so that by its own scatter no
        model would be worse than another. The error counts by the scatter that is left with all
        effects in the model (as of Mallows, Technometrics 15, 1973); the likelihood by its own.

        """
        said, fit = super().held_out(model), self.fit(model)
        least, dof = self._least_scatter()
        view = said.views.get('poses')
        if view is None or dof < _DOF_SCALE:
            return said
        noise = np.r_[self.data.spread, np.sqrt(np.mean(self.data.rests.std ** 2, axis=0))]
        of = np.repeat([0, 1], [self.data.n, self.data.rests.n])
        own = np.array([fit.details.tilt, _of_rests(fit, self.data)])[of]
        times = np.hypot(noise, own) / np.hypot(noise, least[of])
        pull = view.pull * np.repeat(times, self.left_out(fit).bins)
        std = np.hypot(view.std, np.sqrt(2 / dof))
        return score_of(view.x, pull, std, view.log_score)

    def _least_scatter(self) -> tuple[np.ndarray, int]:
        """Return the scatter of turns and rests with all effects in the model, and its dof."""
        if not self._least:
            fit = self.fit(solve.base_model())
            system = fit.details.equations
            able = [e for e in self._others(fit.model) if isinstance(e, Regressor)
                    and not self._why_not(e)]
            best = [max(places.everywhere(e, self._held), key=lambda x: self._gain(fit, x)[0])
                    for e in able]
            more = [system.matrix, *(self.columns(fit, e) for e in best)]
            whole = Equations(np.hstack(more), system.right, system.pose, (), system.whitener)
            now = np.array([fit.details.tilt, _of_rests(fit, self.data)])
            self._least[:] = _scatter(whole, self.data, now), whole.dof
        return self._least[0], self._least[1]

    def columns(self, fit: Fit, effect: Regressor) -> np.ndarray:
        """Return the whitened columns, (k, p), that an effect would add to a fit's k equations."""
        if not self._last or self._last[0] is not fit:     # all candidates of a fit in a row
            self._last[:] = fit, _At(fit.model, self.data, fit.details.keys, fit.details.theta)
        at = self._last[1]
        return _rows(fit.details.equations.whitener,
                     sums(self.data, at.rotation, at.scale, effect.terms(at.samples, at.scale)),
                     effect.terms(self.data.rests, at.scale))

    def omnibus(self, fit: Fit) -> list[Finding]:
        """
        Return the tests of the whole, and whether the turns tell the scale with all they miss by.

        The scatter is found in every fit, so that no chi-squared says that it is absurd.

        """
        said = self.too_wide(fit)
        return [*super().omnibus(fit),
                Finding('scatter', 0.0, view='turns', p_value=0.0 if said else 1.0, evidence=said)]

    def missed(self, fit: Fit) -> np.ndarray:
        """Return the angle by which each turn misses gravity as it is fitted, (n,), rad."""
        return np.linalg.norm(fit.details.residual[:, :self.data.n], axis=0)

    def too_wide(self, fit: Fit) -> str:
        """Say by how much turns miss, where they tell the scale no better than 1 % for it."""
        of_scale = [k for k, _, _ in elements(fit.details.keys)]
        std = float(np.sqrt(np.diag(fit.details.cov)[of_scale].max()))
        if std <= SCALE_STD:
            return ''
        miss = fit.details.residual[:, :self.data.n]
        k = int(np.argmax(self.missed(fit)))
        return (f'turns miss gravity by {np.degrees(_rms(miss)):.2g} deg rms, '
                f'{self.poses.names[k]} at {self.poses.time[k]:.0f} s by '
                f'{np.degrees(np.linalg.norm(miss[:, k])):.2g} deg: they tell scale factors and '
                f'cross-axis terms to {100 * std:.1f} % only{self._ceiling()}')

    def _ceiling(self) -> str:
        """Say that several turns reach the same rate, beyond which the range may end."""
        peak = np.maximum.reduceat(np.abs(self.data.gyro).max(axis=1), begins(self.data))
        alike = int(np.sum(peak > (1 - _ALIKE) * peak.max()))
        return '' if alike < 3 else (
            f'; {alike} of them reach {np.degrees(peak.max()):.0f} deg/s and none more: where the '
            f'range of the gyroscope ends there, turn more slowly')

    def summary(self, fit: Fit) -> dict[str, float]:
        """Return rms angles (rad) of turns as fitted and left out, with chi-squared."""
        n = self.data.n
        return {'residual_rms': _rms(fit.details.residual[:, :n]),
                'left_out_rms': _rms(self.left_out(fit).outputs()[:n].T),
                'chi_squared': fit.details.chi2, 'dof': float(fit.details.dof)}

    def to_arrays(self) -> dict[str, np.ndarray]:
        """Return everything as plain arrays by name, for an npz file: of turns and rests."""
        rests = {f'rest_{k}': v for k, v in self.data.rests.to_arrays().items()}
        return {**super().to_arrays(), **self.data.to_arrays(), **rests}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, Any]) -> TurnsProblem:
        """Return the problem that :meth:`to_arrays` wrote."""
        rests = Poses.from_arrays({k.removeprefix('rest_'): v for k, v in arrays.items()
                                   if k.startswith('rest_')})
        return cls.of(Turns.from_arrays(arrays, rests))

    def _why_not(self, effect: Regressor | Scatter) -> str:
        if isinstance(effect, Scatter):
            return 'the scatter of turns and rests is found in every fit'
        why = effect.why_not(self.data.rests)
        return why if why else effect.why_not(self.data.samples)

    def _gain(self, fit: Fit, effect: Regressor) -> tuple[float, int]:
        """
        Return the gain with the scatter found anew: by F, as the chi-squared of equal chance.

        What is missing is in the scatter of the model without it.

        """
        system = fit.details.equations
        gain, rank = system.gain(self.columns(fit, effect))
        dof = system.dof - rank
        if not rank or dof < 1 or not fit.details.tilt:
            return gain, rank
        left = max(system.chi2 - 2 * gain, 1e-9 * system.chi2)
        chance = fdtrc(rank, dof, 2 * gain / rank * dof / left)
        return float(chdtri(rank, max(chance, 1e-304))) / 2, rank

    def _scatter_gain(self, fit: Fit, effect: Scatter) -> tuple[float, int]:
        return 0.0, 0


class _At:
    """A model at some values, over the samples of turns."""

    def __init__(self, model: Model, turns: Turns, keys: Any, theta: np.ndarray):
        samples = turns.samples
        state = solve.State(samples, keys, theta)
        self.filled = state.filled(model)
        self.scale = state.scale
        correction = Correction('gyro', state.scale, state.bias, self.filled,
                                samples.reference_temperature)
        heat = turns.temperature if np.isfinite(turns.temperature).all() else None
        self.rates = correction.apply(turns.gyro, heat, turns.force, turns.time)
        self.samples = samples.with_inputs(self.rates.T)
        self.rotation = integrated(turns, self.rates)
        self.terms = terms_of(model, self.samples, self.scale, False)
        self.change = sums(turns, self.rotation, self.scale, self.terms)


def _as_poses(turns: Turns) -> Poses:
    """Return turns and rests as poses: mean outputs, for people and pictures."""
    begin, last = begins(turns), ends(turns)
    span = turns.time[last] - turns.time[begin]
    mean = np.add.reduceat(turns.gyro, begin, axis=0).T / (last - begin + 1)
    angle = np.degrees(np.linalg.norm(mean, axis=0) * span)
    force = np.add.reduceat(turns.force, begin, axis=0).T / (last - begin + 1)
    heat = np.add.reduceat(turns.temperature, begin) / (last - begin + 1)
    turned = Poses.of('gyro', mean, turns.spread / np.maximum(span, 1e-9), turns.rests.magnitude,
                      mean, force=force, temperature=heat,
                      reference_temperature=turns.rests.reference_temperature,
                      time=(turns.time[last] + turns.time[begin]) / 2,
                      names=[f'turn {k + 1} ({a:.0f} deg)' for k, a in enumerate(angle)])
    return joined([turned, turns.rests])


def _rows(whitener, of_turns, of_rests):
    """Return whitened rows of terms of turns (n, 3, k) and rests (3, rests, k)."""
    rests = of_rests.transpose(1, 0, 2)
    return np.concatenate([w @ m for w, m in zip(whitener, [*of_turns, *rests])])


def _fit(model: Model, turns: Turns, poses: Poses) -> Fit:
    for e in model.of(Regressor):
        why = e.why_not(turns.rests)
        if why:
            raise FitError(f'{e.name}: {why}', e.needs or 'leave it out')
    keys = keys_of(model, False)
    theta = _begun(turns, keys)
    scatter = np.zeros(2)
    for _ in range(_ROUNDS):
        system, at = _equations(model, turns, keys, theta, scatter)
        change = system.theta - theta
        theta = system.theta
        found = _scatter(system, turns, scatter)
        settled = np.allclose(found, scatter, rtol=0.01, atol=1e-12)
        scatter = found
        if settled and np.max(np.abs(change)) < _CLOSE * max(1.0, np.abs(theta).max()):
            break
    else:
        if not np.isfinite(theta).all() or np.max(np.abs(change)) > 1e-5:
            raise FitError('the fit of the turns does not converge',
                           'turn about all axes, with a rest between; check the units')
    miss = misses(turns, at.rotation)
    dof = max(1, 2 * turns.n - len(keys) + 3)
    widen = (stdtrit(dof, 0.975) / TWO_SIDED) ** 2 if scatter[0] else 1.0
    state = solve.State(poses.with_inputs(_mean_rates(turns, at.rates, poses)), keys, theta)
    cov = system.cov * widen + _hidden(turns, keys)
    # what is told counts the axes that all turns refer to; what turns tell of each other does not
    fit = solve.report(model, state, system, cov + _turned(turns, keys), _log_det(system), 'turns',
                       float(scatter[0]), None, state.values)
    residual = fit.details.residual.copy()
    residual[:, :turns.n] = miss.T
    return replace(fit, details=replace(fit.details, residual=residual, cov=cov))


def off_axes(fit: Fit) -> np.ndarray:
    """
    Return by what angle about x, y and z, rad rms (3,), an accelerometer's axes may be off.

    Errors of its cross-axis terms change the directions that it tells by a shear, of which turns
    in all directions see the mean alone, and a rotation: half the difference of S_ij and S_ji.

    """
    of = np.zeros((3, len(fit.details.keys)))
    for k, i, j in elements(fit.details.keys):
        if i != j:
            of[3 - i - j, k] = 0.5 if (j - i) % 3 == 1 else -0.5
    return np.sqrt(np.einsum('ak,kl,al->a', of, fit.details.cov, of))


def _turned(turns: Turns, keys: Any) -> np.ndarray:
    """
    Return the covariance of the coefficients, (k, k), that axes leave which may be off.

    A small rotation changes cross-axis terms by its angle, to the first order of scale factors
    near 1, and scale factors by half of its square.

    """
    by = np.zeros((len(keys), 3))
    square = np.zeros(len(keys))
    for k, i, j in elements(keys):
        if i == j:
            square[k] = (np.sum(turns.axes ** 2) - turns.axes[i] ** 2) / 2
        else:
            by[k, 3 - i - j] = 1 if (j - i) % 3 == 1 else -1
    return by @ np.diag(turns.axes ** 2) @ by.T + np.diag(square ** 2)


def _hidden(turns, keys) -> np.ndarray:
    """Return the covariance of the coefficients, (k, k), that the step of the output leaves."""
    least = {('bias', f'b_{k}'): v ** 2 for k, v in zip('xyz', turns.hidden)}
    return np.diag([least.get(key, 0.0) for key in keys])


def _begun(turns, keys):
    """Return the coefficients to start from: the identity, and the bias seen at rest."""
    start = {('bias', f'b_{k}'): v for k, v in zip('xyz', np.median(turns.rests.outputs, axis=1))}
    return np.array([1.0 if (label, name) in {('scale', f'S_{2 * k}') for k in 'xyz'}
                     else start.get((label, name), 0.0) for label, name in keys])


def _equations(model, turns, keys, theta, scatter):
    """Return the equations around some values, and what was integrated with them."""
    at = _At(model, turns, keys, theta)
    basis = tangents(turns.before)
    size = np.sqrt(turns.spread ** 2 + scatter[0] ** 2)
    miss = misses(turns, at.rotation)
    wild = np.linalg.norm(miss, axis=1)
    size = size * np.maximum(1.0, wild / _WILD)
    rest = 1 / np.sqrt(turns.rests.std.T ** 2 + scatter[1] ** 2)
    whitener = [*(basis / size[:, None, None]), *(np.eye(3) * rest[:, None, :])]
    of_rests = terms_of(model, turns.rests, at.scale, False)
    matrix = _rows(whitener, at.change, of_rests)
    # what the present values explain, less by how much they miss
    right = [w @ (c @ theta - m) for w, c, m in zip(whitener, at.change, miss)]
    right += [w @ o for w, o in zip(whitener[turns.n:], turns.rests.outputs.T)]
    pose = np.repeat(np.arange(len(whitener)), [len(w) for w in whitener])
    return Equations(matrix, np.concatenate(right), pose, keys, whitener), at


def _scatter(system, turns, last):
    """Return (rad, rad/s) of scatter beyond noise: each part's chi-squared is then its dof."""
    out = []
    u = system.basis
    for part, noise, old in ((system.pose < turns.n, turns.spread, last[0]),
                             (system.pose >= turns.n, turns.rests.std, last[1])):
        expected = part.sum() - np.sum(u[part] ** 2)
        ratio = np.sum(system.residual[part] ** 2) / max(expected, 0.5)
        noise2 = float(np.mean(noise ** 2))
        out.append(np.sqrt(max(0.0, (old ** 2 + noise2) * ratio - noise2)))
    return np.array(out)


def _of_rests(fit: Fit, turns: Turns) -> float:
    """Return the scatter of the rests, rad/s, that a fit was whitened with."""
    size = 1 / np.diagonal(np.array(fit.details.equations.whitener[turns.n:]), axis1=1, axis2=2)
    return float(np.sqrt(max(0.0, np.mean(size ** 2 - turns.rests.std.T ** 2))))


def _mean_rates(turns, rates, poses):
    mean = np.add.reduceat(rates, begins(turns), axis=0) / np.bincount(turns.turn)[:, None]
    return np.concatenate([mean.T, np.zeros((3, poses.n - turns.n))], axis=1)


def _log_det(system) -> float:
    return -float(sum(np.linalg.slogdet(w @ w.T)[1] for w in system.whitener))


def _rms(angles) -> float:
    return float(np.sqrt(np.mean(np.sum(np.square(angles), axis=0))))


def problems(arrays: Mapping[str, Any]) -> dict[str, CalibrationProblem]:
    """Return the problems, by target, from the arrays of evidence.npz."""
    found: dict[str, dict] = {}
    for name, value in arrays.items():
        target, _, key = name.partition('/')
        if key:
            found.setdefault(target, {})[key] = value
    return {target: (TurnsProblem if str(some.get('method')) == 'turns' else CalibrationProblem
                     ).from_arrays(some) for target, some in found.items()}


def arrays_of(found: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the arrays of evidence.npz, ``target/field``, which :func:`problems` reads back."""
    return {f'{target}/{key}': value for target, p in found.items() for key,
            value in p.to_arrays().items()}
