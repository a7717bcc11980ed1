# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fitting a calibration by one of :data:`METHODS`; any model, observable or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from . import faces
from .effects import BASE, Regressor, Scatter
from .linear import elements, Equations, equations, MAGNITUDES, tilt_of
from .poses import Poses
from ..core.errors import FitError, unknown, UsageError
from ..core.statistics import CHI2_90, CHI2_95, interval, ONE_SIDED, TWO_SIDED
from ..core.units import si
from ..loop.effect import Estimate, Fit, Model, model_of

METHODS = ('faces', 'wls', 'ols', 'norm', 'few')
TILT = np.radians(1.0)
_CLOSE = {'norm': 1e-10, 'few': 1e-10, 'faces': 1e-7}
_TURNS = 60             # iterations; the norm fit converges quadratically, in five or six


@dataclass(frozen=True)
class Solved:
    """
    What a fit of a calibration holds besides its values: ``Fit.details``.

    Parameters
    ----------
    scale : ndarray (3, 3)
        S, scale factors and cross-axis sensitivities.
    bias : ndarray (3,)
        b, in units of the output.
    theta : ndarray (m,)
        Coefficients in the order of ``equations.keys``.
    cov : ndarray (m, m)
        Their covariance, tilt and leakage included; for ``faces`` about the middles of their
        intervals.
    equations : Equations
        What was solved.
    inputs : ndarray (3, n)
        Inputs; for ``norm`` with the directions found.
    residual : ndarray (3, n)
        Outputs less what the model says of them.
    tilt : float
        Tilt of the faces, rad: stated, or for ``faces`` found.
    method : str
        One of :data:`METHODS`.

    """

    scale: np.ndarray
    bias: np.ndarray
    theta: np.ndarray
    cov: np.ndarray
    equations: Equations
    inputs: np.ndarray
    residual: np.ndarray
    tilt: float
    method: str

    @property
    def keys(self) -> tuple[tuple[str, str], ...]:
        """What the coefficients are, (label, parameter) each."""
        return self.equations.keys

    @property
    def chi2(self) -> float:
        """Sum of squared residuals over their variance."""
        return self.equations.chi2

    @property
    def dof(self) -> int:
        """Equations left over."""
        return self.equations.dof

    @property
    def condition(self) -> float:
        """Condition number of the equations."""
        return self.equations.condition


def ols(outputs: np.ndarray, regressor: np.ndarray) -> np.ndarray:
    """
    Return G = O I' (I I')^-1, (3, rows): the plain least-squares solution of O = G I.

    outputs O (3, n), regressor I (rows, n), e.g. [i; 1]. Inputs are scaled to their largest by the
    caller where condition matters (I/g: 1.73 for six faces).

    Raises
    ------
    FitError
        I I' is singular: the poses do not determine G.

    """
    square = regressor @ regressor.T
    if np.linalg.matrix_rank(square) < len(square):
        raise FitError(f'the regressor has rank {np.linalg.matrix_rank(square)} of {len(square)}',
                       'add poses: each axis up and down')
    return outputs @ regressor.T @ np.linalg.inv(square)


def base_model() -> Model:
    """Return scale + cross_axis + bias."""
    return model_of('calibration', BASE)


def fit(model: Model, poses: Poses, method: str = 'wls', tilt: float = TILT,
        known: Mapping[str, Any] | None = None) -> Fit[Solved]:
    """
    Fit a model to poses; what the poses do not determine is flagged, never refused.

    ``ols`` weighs every reading alike, ``wls`` by noise and tilt (rad, rms of each of two angles),
    ``faces`` finds tilt and directions along with them (:mod:`.faces`), with values for axes
    square within 1 % and intervals for 3 %, ``norm`` uses the magnitude of the input alone and
    sets S_yx = S_zx = S_zy = 0: it cannot see a common rotation.
    ``few`` does so with the angles between axes right to within 2 deg, until poses say otherwise.

    ``known`` (amplitude by label) are scatters that are not estimated here but were on more poses;
    for ``faces`` with the ``tilt`` that was found there.

    ``Fit.details`` are :class:`Solved`.

    Raises
    ------
    UsageError
        An unknown method, or a model without scale and bias.
    FitError
        The norm fit does not converge, or an effect is not one of this sensor or needs what was
        not recorded.

    """
    if method not in METHODS:
        raise unknown('method', method, METHODS)
    missing = [name for name in ('scale', 'bias') if name not in model]
    if missing:
        raise UsageError(f'the calibration model lacks {" and ".join(missing)}',
                         'keep scale and bias in it')
    if method in ('ols', 'wls') and not poses.known:
        raise UsageError(f'{method} needs poses of known direction', 'use --method norm')
    for e in model.of(Regressor):
        why = e.why_not(poses)
        if why and (poses.sensor not in e.sensors or not np.isfinite(e.columns(poses)).all()):
            raise FitError(f'{e.name}: {why}', e.needs or 'leave it out')
    dof = None
    if method == 'faces' and known is None:
        tilt, dof = faces.tilt_found(poses, *start(poses))
    system, state, log_det = _iterate(model, poses, method, tilt)
    for e in model.of(Scatter):
        amplitude = known[e.label] if known else best_amplitude(model, e, state.poses, state.scale,
                                                                tilt, method)[0]
        model = model.with_effect(e.with_values(**{e.parameters[0].name: amplitude}))
    if model.of(Scatter):
        system, state, log_det = _iterate(model, state.poses, method, tilt)
    theta, cov = system.theta, system.cov
    if method == 'ols':
        theta, cov = _unweighted(system)
    if method in ('ols', 'wls'):
        rms = tilt_of(model, tilt)
        cov = cov + _common_tilt(system.keys, theta, rms)
        if method == 'wls':
            cov = cov + _leak(State(state.poses, system.keys, theta), system, cov, rms)
    state = State(state.poses, system.keys, theta)
    around = state.values
    if method == 'faces':
        state, cov, around = _of_faces(model, poses, tilt, dof)
    return report(model, state, system, cov, log_det, method, tilt, known, around)


def _of_faces(model, poses, tilt, dof):
    """Return the state of a usual sensor; covariance and middles of intervals of a poor one."""
    wide = tilt * np.sqrt(faces.wider(dof))     # it may well be larger than it was found
    found = []
    for cross in (faces.CROSS, faces.POOR):
        system, state, _ = _iterate(model, poses, 'faces', wide, cross)
        free = State(state.poses, system.keys, system.theta)
        found.append((free, *_settled(free, system, system.cov, dof)))
    (_, state, _), (free, away, cov) = found
    # what is not beyond chance is left out of a value, but not out of its interval
    return state, cov, {k: free.values[k] if k[0] == 'cross_axis' else v
                        for k, v in away.values.items()}


def _settled(state, system, cov, dof):
    """Return state and covariance with no more common rotation than the poses speak of."""
    where = {(i, j): k for k, i, j in elements(system.keys)}
    at = [where[i, j] for i in range(3) for j in range(3)]
    turn, small = faces.settled(state.scale, cov[np.ix_(at, at)], dof)
    move = np.eye(len(cov))
    move[np.ix_(at, at)] = np.kron(np.eye(3), turn.T)
    theta = move @ np.array(list(state.values.values()))
    cov = move @ cov @ move.T
    cov[np.ix_(at, at)] = small
    return State(state.poses.with_inputs(turn.T @ state.poses.inputs), system.keys, theta), cov


class State:
    """Where the iteration stands: inputs and coefficients."""

    def __init__(self, poses: Poses, keys: Any = (), theta: Any = ()):
        self.poses = poses
        self.values = {k: float(v) for k, v in zip(keys, theta)}

    def _matrix(self, diagonal):
        s = np.diag([diagonal] * 3).astype(float)
        for i, row in enumerate('xyz'):
            for j, column in enumerate('xyz'):
                label = 'scale' if i == j else 'cross_axis'
                s[i, j] = self.values.get((label, f'S_{row}{column}'), s[i, j] if i == j else 0.0)
        return s

    def filled(self, model: Model) -> Model:
        """Return the model with the coefficients as its values."""
        return Model(e.with_values(
            **{p.name: self.values.get((e.label, p.name), 0.0) for p in e.coefficients})
                     if isinstance(e, Regressor) else e for e in model)

    @property
    def scale(self) -> np.ndarray:
        """S, (3, 3)."""
        return self._matrix(1.0)

    @property
    def bias(self) -> np.ndarray:
        """b, (3,)."""
        return np.array([self.values.get(('bias', f'b_{k}'), 0.0) for k in 'xyz'])


def _iterate(model, poses, method, tilt, cross=faces.CROSS):
    """Solve with the S (and for unknown directions these) of the last time, until they stay."""
    free = method in (*MAGNITUDES, 'faces')
    scale, bias = start(poses, method) if free else (_rough_scale(poses), np.zeros(3))
    if method in MAGNITUDES and not poses.known or method == 'faces':
        poses = poses.directed(scale, bias[:, None])
    # without unknown directions S enters the weights alone, unless an effect changes the input
    weights = 1e-10 if any(e.at_input for e in model.of(Regressor)) else 1e-4
    for _ in range(_TURNS):
        system, log_det = equations(model, poses, scale, tilt, method, cross=cross)
        state = State(poses, system.keys, system.theta)
        new = state.scale if free else _sound(state.scale, system)
        change = np.abs(new - scale).max() / np.abs(scale).max()
        scale = new
        if free:
            state.poses, moved = poses, _directed(model, state, poses)
            change = max(change, np.abs(moved.inputs - poses.inputs).max() / poses.magnitude)
            poses = state.poses = moved
        if change < (_CLOSE[method] if free else weights):
            return system, state, log_det
    raise FitError(f'the {"weighted" if not free else method} fit does not converge',
                   'add poses in other directions, or look for a pose that moved')


def _directed(model, state, poses):
    """Return poses with the directions that S and b see in their outputs."""
    scale = state.scale
    size = np.abs(scale).max() ** 3
    if not np.isfinite(size) or abs(np.linalg.det(scale)) < 1e-12 * size:
        raise FitError('the norm fit diverges', 'add poses in other directions')
    return poses.directed(scale, rest_of(state.filled(model), scale, poses))


def _sound(scale, system):
    """Return S for the weights: an undetermined scale factor is the mean of the others."""
    sound = dict(zip(system.keys, system.determined))
    known = np.array([sound.get(('scale', f'S_{2 * k}'), False) for k in 'xyz'])
    if known.all() or not known.any():
        return scale if known.any() else np.eye(3)
    scale = scale.copy()
    scale[~known, ~known] = np.diag(scale)[known].mean()
    return scale


def rest_of(model: Model, scale: np.ndarray, poses: Poses) -> np.ndarray:
    """Return what a fitted model puts out beyond S i: bias and all else, (3, n)."""
    rest = np.zeros((3, poses.n))
    for e in model.of(Regressor):
        if e.name not in ('scale', 'cross_axis'):
            rest += e.terms(poses, scale) @ np.array([e.values.get(p.name, 0.0) for p
                                                      in e.coefficients])
    return rest


def _rough_scale(poses):
    """Start from the ratio of outputs to inputs: 1 for SI."""
    spread = np.abs(poses.outputs - poses.outputs.mean(1, keepdims=True)).max()
    size = np.abs(poses.inputs - poses.inputs.mean(1, keepdims=True)).max()
    return np.eye(3) * (spread / size if size > 0 and spread > 0 else 1.0)


def start(poses: Poses, method: str = 'norm') -> Any:
    """
    Return (S, b) of the axis-aligned ellipsoid through the outputs: sum_k a_k o_k^2 + c_k o_k = 1.

    Works for counts as for SI; where no ellipsoid fits, S = 1 and b = 0. Through few poses of axes
    that are not square it may be a wild one: theirs is the sphere about zero.

    """
    if method == 'few':
        size = np.linalg.norm(poses.outputs, axis=0).mean()
        return np.eye(3) * size / poses.magnitude, np.zeros(3)
    middle, size = poses.outputs.mean(1, keepdims=True), poses.outputs.std()
    o = (poses.outputs - middle) / (size or 1.0)
    a = np.vstack([o ** 2, o]).T
    square, linear = np.split(np.linalg.lstsq(a, np.ones(len(a)), rcond=None)[0], 2)
    if (square <= 0).any():
        return np.eye(3), np.zeros(3)
    centre = -linear / (2 * square)
    radius = np.sqrt((1 + np.sum(square * centre ** 2)) / square)
    return np.diag(radius * size / poses.magnitude), centre * size + middle[:, 0]


def restricted(model: Model, effect: Scatter, amplitude: float, poses: Poses, scale: np.ndarray,
               tilt: float, method: str) -> float:
    """Return the restricted log-likelihood, nats, at a scatter's amplitude; scale (3, 3) is S."""
    trial = effect.with_values(**{effect.parameters[0].name: amplitude})
    trial = model.with_effect(trial) if effect.label in model else model + trial
    system, log_det = equations(trial, poses, scale, tilt, method)
    return system.log_restricted(log_det)


def best_amplitude(
    model: Model, effect: Scatter, poses: Poses, scale: np.ndarray, tilt: float, method: str
) -> tuple[float, float]:
    """Return (amplitude of greatest restricted likelihood, that log-likelihood)."""
    lower, upper = np.log(effect.bounds(poses, scale))
    grid = np.linspace(lower, upper, 25)

    def loss(x):
        return -restricted(model, effect, np.exp(x), poses, scale, tilt, method)

    values = [loss(x) for x in grid]
    k = int(np.argmin(values))
    found = minimize_scalar(loss, bounds=(grid[max(k - 1, 0)], grid[min(k + 1, 24)]),
                            method='bounded',
                            options={'xatol': 1e-3})
    return (float(np.exp(found.x)), -float(found.fun)) if found.fun < values[k] else (
        float(np.exp(grid[k])), -values[k])


def _unweighted(system: Equations):
    """Return plain least squares (readings count alike) and its covariance."""
    # (n, 3, 3): back to units of the output
    readings = np.linalg.inv(system.whitener)
    n, m = len(readings), system.matrix.shape[1]
    matrix = np.einsum('nij,njk->nik', readings, system.matrix.reshape(n, 3, m)).reshape(-1, m)
    right = np.einsum('nij,nj->ni', readings, system.right.reshape(n, 3)).ravel()
    size = np.linalg.norm(matrix, axis=0)
    size = np.where(size > 0, size, 1.0)
    inverse = np.linalg.pinv(matrix / size) / size[:, None]
    spread = np.einsum('kni,nij->knj', inverse.reshape(m, n, 3), readings).reshape(m, -1)
    return inverse @ right, spread @ spread.T


def _common_tilt(keys, theta, tilt):
    """
    Return the covariance that the mean effect of tilt adds.

    A tilt by two angles of rms theta shortens the axial input by theta^2 on average, in every pose
    alike: all of S is low by that fraction, which no residual shows.

    """
    low = np.array([v * tilt ** 2 if label in ('scale', 'cross_axis') else 0.0
                    for (label, _), v in zip(keys, theta)])
    return np.outer(low, low)


def _leak(state, system, cov, tilt):
    """
    Return the covariance of lateral tilt that reaches an axis by cross-axis sensitivity.

    Left out of the weights, where the uncertainty of these sensitivities would do harm; here only
    what they exceed their own variance by counts.

    """
    variance = dict(zip(system.keys, np.diag(cov)))
    uncertain = np.array([[variance.get(('cross_axis', f'S_{k}{m}'), 0.0) for m in 'xyz'] for k
                          in 'xyz'])
    sensitivity = np.maximum(state.scale ** 2 - uncertain, 0.0) * (1 - np.eye(3))
    lateral = tilt ** 2 * (np.sum(state.poses.inputs ** 2, axis=0) - state.poses.inputs ** 2)
    spread = np.linalg.pinv(system.matrix).reshape(len(cov), -1, 3)
    per_reading = np.einsum('mnr,nrk->mnk', spread, system.whitener)
    return np.einsum('mnk,kn,lnk->ml', per_reading, sensitivity @ lateral, per_reading)


def report(model: Model, state: State, system: Equations, cov: np.ndarray, log_det: float,
           method: str, tilt: float, known: Mapping[str, Any] | None,
           around: Mapping[tuple[str, str], float]) -> Fit[Solved]:
    """
    Return the fit that a state and its equations make.

    ``cov`` (k, k) is the covariance of its k coefficients in the order of the equations,
    ``around`` has the centres of their intervals.

    """
    poses, keys = state.poses, system.keys
    std = np.sqrt(np.diag(cov))
    value = dict(zip(keys, zip(state.values.values(), std, system.determined, around.values())))
    sensor, flags, estimates = poses.sensor, [], {}
    effects: list[Any] = []
    e: Any
    for e in model.effects:
        if isinstance(e, Scatter):
            name = e.parameters[0].name
            estimates[e.label] = {name: Estimate(e[name], None, None, point=e[name], fixed=True)
                                  if known else
                                  _scatter_estimate(model, e, poses, state.scale, tilt, method)}
            effects.append(e)
            continue
        mine = {p.name: _estimate(p, value.get((e.label, p.name)), sensor, e.name in BASE)
                for p in e.coefficients}
        estimates[e.label] = mine
        effects.append(e.with_values(**{n: m.point for n, m in mine.items()}))
        unseen = [n for n, m in mine.items() if m.std is None and not m.fixed]
        if unseen:
            flags.append(f'{e.label}: {", ".join(unseen)} not determined by these poses'
                         + (f'; needs {e.needs}' if e.needs else ''))
    model = Model(effects)
    residual = poses.outputs - state.scale @ poses.inputs - rest_of(model, state.scale, poses)
    details = Solved(state.scale, state.bias, np.array(list(state.values.values())), cov, system,
                     poses.inputs, residual, tilt, method)
    return Fit(model, estimates, -0.5 * (system.chi2 + log_det), tuple(flags), details)


def _estimate(parameter, found, sensor, base: bool) -> Estimate:
    """Return the estimate of a coefficient; null where it may be zero and is not of the base."""
    unit_ = si(parameter.unit, sensor)
    if found is None:
        return Estimate(0.0, None, None, unit_, point=0.0, fixed=True,
                        note='set to zero: a common rotation cannot be seen from magnitudes alone')
    value, std, determined, centre = found
    if not determined:
        return Estimate(None, None, None, unit_, point=value, note='not determined by these poses')
    ci95 = interval(centre, std)
    std = float(np.hypot(std, centre - value))      # of the value, which may be off the middle
    if not base and ci95[0] <= 0 <= ci95[1]:
        return Estimate(None, std, ci95, unit_, upper95=abs(value) + ONE_SIDED * std,
                        point=value,
                        note='interval reaches zero')
    return Estimate(value, std, ci95, unit_, point=value)


def _scatter_estimate(model, effect, poses, scale, tilt, method) -> Estimate:
    """Return the estimate of a scatter's amplitude by its restricted profile likelihood."""
    parameter = effect.parameters[0]
    lower, upper = effect.bounds(poses, scale)
    grid = np.exp(np.linspace(np.log(lower), np.log(upper), 400))
    coarse = grid[::8]
    profile = np.array([restricted(model, effect, a, poses, scale, tilt, method) for a in coarse])
    profile = np.interp(np.log(grid), np.log(coarse), profile)
    best = effect.values[parameter.name]
    top = max(profile.max(), restricted(model, effect, best, poses, scale, tilt, method))
    inside = grid[profile > top - CHI2_95 / 2]
    unit_ = si(parameter.unit, poses.sensor)
    ci95 = (float(inside[0]), float(inside[-1])) if len(inside) else (best, best)
    if profile[0] > top - CHI2_95 / 2:
        limit = float(grid[profile > top - CHI2_90 / 2][-1])
        return Estimate(None, None, (0.0, ci95[1]), unit_, upper95=limit, point=best,
                        note='interval reaches zero')
    return Estimate(best, (ci95[1] - ci95[0]) / (2 * TWO_SIDED), ci95, unit_, point=best)
