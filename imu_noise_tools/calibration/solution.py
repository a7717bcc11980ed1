# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A calibration: the solution with what speaks for and against it, or a refusal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import chdtrc, stdtrit

from . import faces, solve
from .axes import refuse_crossed_axes, size_of_turns
from .between import time_offset, Turns
from .correction import Correction
from .linear import elements, equations, MAGNITUDES, SKEW
from .poses import FACES, nearest_face, Poses, unit
from .positions import because, CONE_DEG, counted, faced, named, spread
from .problem import CalibrationProblem
from .turn_problem import off_axes, SCALE_STD, TurnsProblem
from ..core.errors import degrees_of_freedom, FitError, InputError, listed
from ..loop.diagnosis import diagnose
from ..loop.effect import Fit, Model
from ..loop.findings import fresh
from ..loop.study import assess, Study

SPREAD_POSES = 12               # from which the norm fit is to be had
_FACES = 5                      # of six, from which poses are faces, not some directions
_CONDITION = 50.0
_UNKNOWN = 0.1                  # a scale factor known no better is not known
_UNTOLD = 0.5                   # of what was known before: poses that leave more say nothing
_TURN_ROWS = 12                 # equations of turns that nine coefficients are asked of
_TURNED = np.radians(2.0)       # a rotation that a person would want to hear of
_TILTED_DEG = 3.0              # faces further off are said to be: no table is that bad
_MISSED = np.radians(20.0)      # turns that miss gravity by more, fitted, were other ones
_SCALES = (0.6, 1.6)            # a scale factor outside, relative to the others, is a mistake


@dataclass(frozen=True)
class Calibration:
    """
    A solved calibration: ``raw = S x + b + rest(x)``, so ``x = S^-1 (raw - b - rest)``.

    Parameters
    ----------
    problem : CalibrationProblem
        The poses and how they were fitted.
    fit : Fit
        The fitted model with its estimates.
    plain : Fit
        The same faces by ``ols`` where there are all six: its distance shows the tilt.
    notes, warnings : tuple of str
        What was done, and what is doubtful.

    """

    problem: CalibrationProblem
    fit: Fit
    plain: Fit
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def sensor(self) -> str:
        """``accel`` or ``gyro``."""
        return self.problem.target

    @property
    def poses(self) -> Poses:
        """The poses that were used."""
        return self.problem.poses

    @property
    def S(self) -> np.ndarray:      # noqa: N802
        """Scale factors and cross-axis sensitivities, (3, 3)."""
        return self.fit.details.scale

    @property
    def bias(self) -> np.ndarray:
        """Biases, (3,)."""
        return self.fit.details.bias

    @property
    def G(self) -> np.ndarray:      # noqa: N802
        """[S | b], (3, 4)."""
        return np.column_stack([self.S, self.bias])

    @property
    def std(self) -> tuple[np.ndarray, np.ndarray]:
        """Standard deviations of S (3, 3) and bias (3,), as estimated; 0 for what was set."""
        return _table({(label, name): e.std for label, found in self.fit.estimates.items()
                       for name, e in found.items() if e.std is not None})

    @property
    def correction(self) -> Correction:
        """What turns raw samples into corrected ones."""
        return Correction(self.sensor, self.S, self.bias, self.fit.model,
                          self.poses.reference_temperature)

    def apply(self, raw: np.ndarray, temperature: np.ndarray | None = None,
              force: np.ndarray | None = None) -> np.ndarray:
        """Return corrected samples, (n, 3) or (3,); see :class:`Correction`."""
        return self.correction.apply(raw, temperature, force)


def standard_deviations(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """
    Return the standard deviations of S (3, 3) and bias (3,); 0 for what is not fitted.

    Those of turns are beside the accelerometer's axes, whatever these are.

    """
    return _table(dict(zip(fit.details.keys, np.sqrt(np.diag(fit.details.cov)))))


def _table(std: Mapping[tuple[str, str], float]) -> tuple[np.ndarray, np.ndarray]:
    """Return what is known by label and name as S (3, 3) and bias (3,); 0 for what is not."""
    s = np.array([[std.get(('scale' if k == m else 'cross_axis', f'S_{k}{m}'), 0.0) for m in 'xyz']
                  for k in 'xyz'])
    return s, np.array([std.get(('bias', f'b_{k}'), 0.0) for k in 'xyz'])


def calibrate(poses: Poses, method: str | None = None, tilt: float = solve.TILT,
              model: Model | None = None,
              notes: Iterable[str] = ()) -> Calibration:
    """
    Return the calibration of poses, or refuse it with the number that forbids it and what to do.

    Parameters
    ----------
    poses : Poses
        From a record, with or without known inputs. Accelerometer poses without are fitted by
        their magnitudes, cross-axis terms by what faces read across (``faces``); when 12 and more
        point in different directions, by their magnitude alone (``norm``); fewer that are no
        faces too, with axes square to within 2 deg until they say more (``few``).
    method : str, optional
        ``faces``, ``wls``, ``ols``, ``norm`` or ``few``; chosen from the poses when not given.
    tilt : float
        Tilt of the faces, rad (rms of each of two angles), for ``wls``.
    model : Model, optional
        scale + cross_axis + bias unless given.
    notes : iterable of str
        What was done to the poses before.

    Raises
    ------
    InputError
        Faces or turns are missing, or there are too few poses.
    FitError
        The solution is no calibration: an axis upside down, a scale no device has, not enough
        spread.

    """
    model = model or solve.base_model()
    notes = list(notes)
    if not np.isfinite(poses.outputs).all() or not np.isfinite(poses.std).all():
        raise InputError('a pose holds values that are not finite', 'leave it out')
    method = method or _method(poses)
    if method == 'norm':
        _refuse_little_spread(poses, notes)
    elif method in ('faces', 'few'):
        if poses.sensor != 'accel':
            raise InputError('the faces are those of an accelerometer', 'use --method wls')
        called = named(poses)
        said = _refuse_unsupported(called, notes)
        poses, notes = (called, notes + said) if method == 'faces' else (poses, notes)
    elif not poses.known:
        poses, more = faced(poses)
        notes += more
        _refuse_missing_faces(poses.names, notes)
    problem = CalibrationProblem(poses, method, tilt)
    fit, untold = _of_few(problem, model) if method == 'few' else (problem.fit(model), [])
    notes += untold
    _refuse_failure(fit, poses, method)
    notes += [f'{face} was held {k} times: averaged' for face,
              k in counted(poses.names).items() if k > 1]
    return stated(problem, fit, notes, _doubts(fit, method, tilt))


def stated(
    problem: CalibrationProblem, fit: Fit, notes: Iterable[str] = (), warnings: Iterable[str] = ()
) -> Calibration:
    """Return a calibration that was solved before, with ``ols`` beside it."""
    poses, plain = problem.poses, fit
    whole = problem.method == 'faces' and set(FACES) <= set(poses.names)
    if whole:
        poses = poses.take([k for k, name in enumerate(poses.names) if name in FACES])
    if whole or problem.method == 'wls':
        plain = solve.fit(fit.model, poses, 'ols', problem.tilt)
    return Calibration(problem, fit, plain, tuple(notes), tuple(warnings))


def calibrate_turns(turns: Turns, notes: Iterable[str] = (),
                    accel: Calibration | None = None) -> Calibration:
    """
    Return the gyroscope's calibration by the turns between rests, or refuse it.

    Cross-axis terms are no better known than the axes of the accelerometer that they refer to.

    Raises
    ------
    InputError
        The turns do not tell every coefficient.
    FitError
        The two sensors' axes contradict each other, or the solution is no calibration.

    """
    refuse_crossed_axes(turns)
    notes = list(notes)
    if 2 * turns.n < _TURN_ROWS:
        raise InputError(f'{turns.n} turns between poses do not tell nine scale and cross-axis '
                         f'terms of a gyroscope{because(notes)}',
                         f'hold {_TURN_ROWS // 2 + 1} poses or more, '
                         'turning about all axes between them')
    if accel is not None:
        turns = replace(turns, axes=off_axes(accel.fit))
    problem = TurnsProblem.of(turns)
    try:
        fit = problem.fit(solve.base_model())
        _refuse_failure(fit, problem.poses, 'turns')
        miss = float(np.median(problem.missed(fit)))
        if miss > _MISSED:
            raise FitError(f'half of the turns miss gravity by more than {np.degrees(miss):.0f} '
                           'deg as they are fitted',
                           'check the unit of the gyroscope and the sample rate')
    except FitError:
        _refuse_size(turns)         # the fit begins at turns that are as large as they should be
        raise
    # what the turns tell by their geometry: a scatter that an effect explains is the loop's
    noise = np.median(turns.spread)
    worst = float(np.max(standard_deviations(fit)[0]) * noise / np.hypot(noise, fit.details.tilt))
    if worst > SCALE_STD:
        raise InputError(f'the turns between poses tell the gyroscope\'s scale to '
                         f'{100 * worst:.1f} % only', 'turn about all axes, by 90 deg and more')
    said = [*notes, 'the Earth\'s rate (at most 15.04 deg/h) stays in the bias and in the turns']
    turned = _turned_case(fit, 'the gyroscope\'s frame')
    wide = problem.too_wide(fit)
    return stated(problem, fit, said, [*fit.flags, *turned, *([wide] if wide else [])])


def _refuse_size(turns: Turns) -> None:
    size = size_of_turns(turns)
    if size and not _SCALES[0] < size < _SCALES[1]:
        raise FitError(f'the turns between the poses are {size:.3g} times as large as gravity '
                       'tells: what a count is, or the sample rate, is another',
                       'look up the unit in the data sheet, and count the samples of a minute')


def completed(calibration: Calibration) -> Calibration:
    """Return a calibration with what its diagnosis finds, where that leaves nothing to explain."""
    found = diagnose(assess(calibration.problem, calibration.fit.model))
    if not found.found or found.remaining is not None:
        return calibration
    model = calibration.fit.model
    for f in found.found:
        model = model.plus(fresh(f))
    return replace(calibration, fit=calibration.problem.fit(model))


def offset_of(calibration: Calibration) -> dict[str, Any] | None:
    """
    Return by how much the accelerometer's stamps are later than the gyroscope's, s, or None.

    ``value``, ``std``, and ``ci95``: its standard error is known from as many turns as there are.

    """
    problem = calibration.problem
    if not isinstance(problem, TurnsProblem):
        return None
    turns = problem.data
    heat = turns.temperature if np.isfinite(turns.temperature).all() else None
    rates = calibration.correction.apply(turns.gyro, heat, turns.force, turns.time)
    size = float(np.median(np.linalg.norm(turns.rests.force, axis=0)))
    value, std = time_offset(turns, rates, size)
    wide = std * float(stdtrit(max(1, turns.n - 1), 0.975))
    return {'value': value, 'std': std, 'ci95': [value - wide, value + wide]}


def of_study(study: Study, target: str | None = None) -> Calibration:
    """
    Return the calibration a study stands at, of its first sensor or the one named.

    Raise InputError for a study of another domain, UsageError for no such sensor.

    """
    if study.domain != CalibrationProblem.domain:
        raise InputError(f'this is a {study.domain} study', 'name the folder that calibrate wrote')
    target = study.chosen(None if target is None else [target])[0]
    state = study.states[target]
    assert isinstance(state.problem, CalibrationProblem)
    said = study.source
    if target != study.targets[0]:
        said = said.get(target, {})
    return stated(state.problem, state.fit, said.get('notes', ()), said.get('warnings', ()))


def _method(poses: Poses) -> str:
    if poses.known or poses.sensor != 'accel':
        return 'wls'
    if spread(poses) >= SPREAD_POSES and _norm_equations(poses).condition < _CONDITION:
        return 'norm'
    up = [name for name in named(poses).names if name in FACES]
    some = len(set(up)) >= _FACES and 2 * len(up) >= poses.n
    return 'faces' if some or len(up) == poses.n else 'few'


def _norm_equations(poses):
    """Return the equations of the norm fit, near its solution."""
    scale, bias = solve.start(poses)
    poses = poses.directed(scale, bias[:, None])
    return equations(solve.base_model(), poses, scale, 0.0, 'norm')[0]


def _refuse_little_spread(poses: Poses, notes) -> None:
    remedy = (f'hold at least {SPREAD_POSES} poses in all directions, edges and corners too; or '
              'leave --method out')
    apart = spread(poses)
    if apart < SPREAD_POSES:
        raise InputError(f'{apart} poses point in different directions ({poses.n} in all), the '
                         f'norm fit needs '
                         f'{SPREAD_POSES}{because(notes)}', remedy)
    condition = _norm_equations(poses).condition
    if condition > _CONDITION:
        raise InputError(f'the poses are too alike for a norm fit (condition {condition:.0f}, at '
                         f'most '
                         f'{_CONDITION:.0f})', remedy)


def _refuse_unsupported(poses: Poses, notes) -> list[str]:
    """Refuse poses whose magnitudes do not tell scale and bias; else say what one more adds."""
    directions = unit(poses.outputs)
    if faces.condition(directions) > _CONDITION:
        if all(name in FACES for name in poses.names):
            _refuse_missing_faces(poses.names, notes)
        raise InputError(f'the {poses.n} poses do not tell three scale factors and three biases'
                         f'{because(notes)}', faces.next_pose(directions))
    missing = [f for f, k in counted(poses.names).items() if not k]
    said = [f'no pose has {", ".join(missing)} up; the others tell what these would'
            ] if missing else []
    return [*said, faces.next_pose(directions, solved=True)]


def _of_few(problem: CalibrationProblem, model: Model) -> tuple[Fit, list[str]]:
    """Fit few poses and say which angles they do not tell; refuse a scale that they do not."""
    more = faces.next_pose(unit(problem.poses.outputs))
    try:
        fit = problem.fit(model)
    except FitError:
        raise InputError(f'the {problem.poses.n} poses do not tell three scale factors and three '
                         'biases of axes that are square to 2 deg', more) from None
    scale, std = fit.details.scale, standard_deviations(fit)[0]
    size = np.diag(scale).mean()
    worst = float(np.diag(std).max() / size)
    if worst > _UNKNOWN:
        raise InputError(f'the {problem.poses.n} poses tell a scale factor to {100 * worst:.0f} % '
                         'only', more)
    angles = [f'{"xyz"[i]} and {"xyz"[j]}' for _, i, j in elements(fit.details.keys)
              if i < j and std[i, j] > _UNTOLD * SKEW * size]
    untold = [f'not observable from these poses: the angle between {listed(angles, 3)} (taken as '
              'right to within 2 deg)'] if angles else []
    return fit, [*untold, faces.next_pose(unit(problem.poses.outputs), solved=True)]


def _refuse_missing_faces(names, notes) -> None:
    seen = counted(names)
    missing = [f for f, k in seen.items() if not k]
    if not missing:
        return
    twice = [f'{f} {k} times' for f, k in seen.items() if k > 1]
    said = f'{6 - len(missing)} of 6 faces seen; missing {", ".join(missing)}'
    if twice:
        said += f' (held {", ".join(twice)})'
    raise InputError(said + because(notes),
                     f'hold {", ".join(missing)} up, still, and record again (or '
                     f'{SPREAD_POSES} poses in all directions)')


def _refuse_failure(fit: Fit, poses: Poses, method: str) -> None:
    system, scale = fit.details.equations, fit.details.scale
    wanted = len(system.keys)
    if system.rank < wanted and len(fit.model) == 3:
        raise InputError(f'the {poses.n} poses determine {system.rank} of {wanted} coefficients',
                         'add poses: every axis up and down, or turned both ways')
    nominal = np.abs(np.diag(scale)).mean()
    for k, axis in enumerate('xyz'):
        if scale[k, k] < 0:
            raise FitError(f'{poses.sensor}_{axis} is upside down: its scale factor is '
                           f'{scale[k, k]:.3g}',
                           'its sign, or the sign or order of the inputs, is wrong (REP-145: +g '
                           'on the axis that '
                           'points up)')
        if not _SCALES[0] * nominal < scale[k, k] < _SCALES[1] * nominal:
            raise FitError(f'the scale factor of {poses.sensor}_{axis} is {scale[k, k]:.3g}, of '
                           f'all three '
                           f'{nominal:.3g} on average', 'check the units and the poses')
    if poses.sensor == 'gyro' and not _SCALES[0] < nominal < _SCALES[1]:
        raise FitError(f'the turns come out {nominal:.3g} times as large as they should',
                       ('check ' if method == 'turns' else 'check --turn or --rate (degrees), ')
                       + 'the unit of the gyroscope and the sample rate')


def _doubts(fit: Fit, method: str, tilt: float) -> list[str]:
    """Return warnings: off the faces, chi-squared, badly conditioned."""
    said = list(fit.flags)
    x2, dof = fit.details.chi2, fit.details.dof
    residual, inputs = fit.details.residual, fit.details.inputs
    if dof and chdtrc(dof, x2) < 0.005:
        said.append('residuals are larger than noise '
                    f'{"" if method in MAGNITUDES else "and tilt "}explain: chi-squared '
                    f'{x2:.0f} with {degrees_of_freedom(dof)}; diagnose says why')
    said += _turned_case(fit, 'the case')
    if method == 'faces':
        tilt = fit.details.tilt
        if _TILTED_DEG < np.degrees(tilt) and tilt != faces.ANY:
            said.append(f'the faces are tilted by about {np.degrees(tilt):.1f} deg, which '
                        'cross-axis terms feel, and scale factors and biases where axes are not '
                        'orthogonal, which they hide (intervals allow for 3 %): level them, or '
                        f'hold {SPREAD_POSES} spread poses')
    elif method not in MAGNITUDES and dof:
        lateral = inputs == 0
        own = np.diag(fit.details.scale)[:, None]
        size = np.where(lateral, residual / own, 0.0) / np.maximum(np.linalg.norm(inputs, axis=0),
                                                                   1e-300)
        turned = np.linalg.norm(inputs, axis=0) > 0
        if turned.any():
            rms = float(np.sqrt((size[:, turned] ** 2).sum() / dof))
            if rms > 2 * tilt:
                said.append(f'the faces are tilted by about {np.degrees(rms):.1f} deg (stated: '
                            f'{np.degrees(tilt):.1g}); their scale factors are low by some '
                            f'{1e6 * rms ** 2:.0f} ppm: level them, give --tilt '
                            f'{np.degrees(rms):.1f}, or hold '
                            f'{SPREAD_POSES} spread poses')
    return said


def _turned_case(fit: Fit, what: str) -> list[str]:
    """Return a warning where S is close to a rotation, more than tilt and noise make."""
    stretch, turn = faces.polar(fit.details.scale)
    angle = Rotation.from_matrix(turn).as_rotvec()
    size, std = np.linalg.norm(angle), float(np.max(standard_deviations(fit)[0]))
    if size < max(_TURNED, 4 * std):
        return []
    about = ', '.join(f'{v:.2f}' for v in angle / size)
    return [f'{what} is turned by {np.degrees(size):.1f} deg about ({about}) against the axes of '
            f'the sensor: S is that rotation, and scale factors {stretch[0, 0]:.4f}, '
            f'{stretch[1, 1]:.4f}, {stretch[2, 2]:.4f}']


def as_dict(calibration: Calibration) -> Mapping:
    """Return what calibration.yaml holds of the numbers, as plain Python values."""
    c, fit = calibration, calibration.fit
    std_s, std_b = c.std
    poses, left = c.poses, c.problem.left_out(fit)
    out = {
        'sensor': c.sensor, 'method': c.problem.method, 'unit': c.problem.unit,
        'formula': f'x = S^-1 (raw - bias{" - effects(x)" if c.correction.more else ""})',
        'G': c.G.tolist(), 'S': c.S.tolist(), 'bias': c.bias.tolist(),
        'std': {'S': std_s.tolist(), 'bias': std_b.tolist()},
        'chi_squared': float(fit.details.chi2), 'dof': int(fit.details.dof),
        'condition': float(fit.details.condition),
        'magnitude': float(poses.magnitude),
        'reference_temperature': float(poses.reference_temperature),
    }
    if c.problem.method == 'turns':
        out['scatter_deg'] = float(np.degrees(fit.details.tilt))
        out['left_out_deg'] = float(np.degrees(c.problem.summary(fit)['left_out_rms']))
    elif c.problem.method not in MAGNITUDES:
        out['tilt_deg'] = float(np.degrees(fit.details.tilt))
        out['ols'] = {'S': c.plain.details.scale.tolist(), 'bias': c.plain.details.bias.tolist()}
    seen = {n: poses.names.count(n) for n in dict.fromkeys(poses.names)}
    if c.sensor == 'accel':
        near = [nearest_face(u) for u in fit.details.inputs.T]
        seen = counted(face for face, angle in near if angle <= CONE_DEG)
    out['faces' if c.sensor == 'accel' else 'turns'] = {
        'seen': {f: k for f, k in seen.items() if k},
        'missing': [f for f, k in seen.items() if not k]}
    out['effects'] = {e.label: {'effect': e.name,
                                **{p.name: float(e.values[p.name]) for p in e.parameters}}
                      for e in fit.model if e.name not in solve.BASE}
    out['poses'] = [{
        'name': poses.names[k], 'time_s': float(poses.time[k]),
        'output': poses.outputs[:, k].tolist(), 'input': fit.details.inputs[:, k].tolist(),
        'residual': fit.details.residual[:, k].tolist(),
        'left_out_chi_squared': float(left.x[k]), 'left_out_bins': int(left.bins[k])}
        for k in range(poses.n)]
    out['notes'], out['warnings'] = list(c.notes), list(c.warnings)
    return out
