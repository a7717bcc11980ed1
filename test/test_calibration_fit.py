# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Solutions, intervals and refusals, against sessions made without the package."""

from __future__ import annotations

from dataclasses import replace

import calibration_sessions as sim
import numpy as np
from params import daily, seldom
import pytest
from scipy.spatial.transform import Rotation

from imu_noise_tools import calibration as core
from imu_noise_tools.calibration.faces import polar
from imu_noise_tools.calibration.linear import Equations
from imu_noise_tools.core.errors import degrees_of_freedom, FitError, InputError, UsageError
from imu_noise_tools.plots.calibration import before_and_after, residuals
from imu_noise_tools.plots.style import new_figure

DEG = np.pi / 180


def six(rng, device, tilt=1.0, times=1, temperature=None, names=True):
    """Return the poses of faces tilted by hand, inputs nominal."""
    labels, directions = sim.faces(times)
    true = sim.G * sim.tilted(directions, tilt * DEG, rng)
    out = device.output(true, rng, temperature)
    return core.Poses.of('accel', out.T, device.noise, sim.G,
                         sim.G * directions.T if names else None,
                         temperature=temperature, reference_temperature=25.0,
                         names=labels if names else None)


def spread(rng, device, n=24):
    """Return poses in all directions, of unknown input."""
    out = device.output(sim.G * sim.spread_directions(n, rng), rng)
    return core.Poses.of('accel', out.T, device.noise, sim.G)


def truth(device):
    """Return S and b as the fit names them."""
    out = {f'S_{"xyz"[k]}{"xyz"[m]}': device.scale[k, m] for k in range(3) for m in range(3)}
    return {**out, **{f'b_{"xyz"[k]}': device.bias[k] for k in range(3)}}


def estimates(fit):
    """Return all estimates by parameter."""
    return {k: e for label in ('scale', 'cross_axis', 'bias') for k,
            e in fit.estimates[label].items()}


def test_ols_is_the_formula():
    """G = O I' (I I')^-1, against its normal equations solved one row at a time."""
    rng = np.random.default_rng(0)
    inputs = np.vstack([rng.normal(size=(3, 9)), np.ones(9)])
    outputs = rng.normal(size=(3, 9))
    g = core.ols(outputs, inputs)
    for k in range(3):
        row = np.linalg.lstsq(inputs.T, outputs[k], rcond=None)[0]
        np.testing.assert_allclose(g[k], row, rtol=1e-12)
    nominal = np.array([core.DIRECTIONS[f] for f in core.FACES]).T
    assert np.linalg.cond(np.vstack([nominal, np.ones(6)])) == pytest.approx(np.sqrt(3))
    with pytest.raises(FitError, match='rank 3 of 4'):
        core.ols(outputs, np.vstack([inputs[:2], inputs[:1], np.ones(9)]))


def test_ols_fit_is_the_formula():
    """The whole fit with method ols gives the same G as the formula."""
    rng = np.random.default_rng(1)
    poses = six(rng, sim.Device.drawn(rng))
    fit = core.fit(core.base_model(), poses, 'ols')
    g = core.ols(poses.outputs, np.vstack([poses.inputs / sim.G, np.ones(6)]))
    np.testing.assert_allclose(fit.details.scale, g[:, :3] / sim.G, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(fit.details.bias, g[:, 3], rtol=1e-9)


def test_exact_sessions_give_the_truth():
    """Without noise or tilt every method returns the device."""
    rng = np.random.default_rng(2)
    device = sim.Device.drawn(rng, noise=1e-9, upper=True)
    for method, poses in (('ols', six(rng, device, 0)), ('wls', six(rng, device, 0)),
                          ('norm', spread(rng, device))):
        fit = core.fit(core.base_model(), poses, method)
        np.testing.assert_allclose(fit.details.scale, device.scale, atol=1e-8)
        np.testing.assert_allclose(fit.details.bias, device.bias, atol=1e-7)


def test_norm_works_on_counts():
    """A scale of hundreds and an offset of thousands, as an ADC gives them."""
    rng = np.random.default_rng(3)
    device = sim.Device.drawn(rng, upper=True)
    poses = spread(rng, device)
    counts = core.Poses.of('accel', 414.3 * poses.outputs + 32768, 414.3 * poses.std, sim.G)
    fit = core.fit(core.base_model(), counts, 'norm')
    plain = core.fit(core.base_model(), poses, 'norm')
    np.testing.assert_allclose(fit.details.scale, 414.3 * plain.details.scale, rtol=1e-7,
                               atol=1e-6)
    np.testing.assert_allclose(fit.details.bias, 414.3 * plain.details.bias + 32768,
                               rtol=1e-8)


@pytest.mark.parametrize('method', daily(['wls', 'norm'], 'wls'))
def test_intervals_hold_the_truth(method):
    """93 to 97 % of the truths lie inside the 95 % intervals (300 sessions)."""
    rng = np.random.default_rng(4)
    hits = []
    for _ in range(300):
        device = sim.Device.drawn(rng, upper=method == 'norm')
        poses = spread(rng, device) if method == 'norm' else six(rng, device)
        fit, true = core.fit(core.base_model(), poses, method), truth(device)
        hits.append([e.ci95[0] <= true[k] <= e.ci95[1] for k,
                     e in estimates(fit).items() if not e.fixed])
    assert 0.93 <= np.mean(hits) <= 0.97
    assert min(np.mean(hits, axis=0)) > 0.90


def test_tilt_spoils_ols_and_hardly_wls():
    """
    Lateral readings enter the bias of ols: 0.057 m/s^2 at 1 deg.

    Both scale factors are low by theta^2.

    """
    rng = np.random.default_rng(5)
    error, scale = {'ols': [], 'wls': []}, {'ols': [], 'wls': []}
    for _ in range(300):
        device = sim.Device.drawn(rng)
        poses = six(rng, device)
        for method in error:
            fit = core.fit(core.base_model(), poses, method)
            error[method].append(fit.details.bias - device.bias)
            scale[method].append(np.diag(fit.details.scale - device.scale))
    rms = {m: np.sqrt(np.mean(np.square(e))) for m, e in error.items()}
    assert rms['ols'] == pytest.approx(0.057, rel=0.08)
    assert rms['wls'] < 0.0032
    for m in scale:
        assert np.mean(scale[m]) == pytest.approx(-DEG ** 2, rel=0.1)


@pytest.mark.thorough
def test_chi_squared_has_two_degrees_an_axis():
    """Six faces: 18 readings, 12 coefficients; the mean over sessions is 6."""
    rng = np.random.default_rng(6)
    found = [core.fit(core.base_model(), six(rng, sim.Device.drawn(rng))).details for _
             in range(300)]
    assert {d.dof for d in found} == {6}
    assert np.mean([d.chi2 for d in found]) == pytest.approx(6, abs=0.6)


def test_left_out_error_is_three_residuals():
    """For six faces the error of a pose left out is three residuals (leverage 2/3)."""
    rng = np.random.default_rng(7)
    poses = six(rng, sim.Device.drawn(rng), tilt=0)
    problem = core.CalibrationProblem(poses, tilt=0.0)
    fit = problem.fit(core.base_model())
    np.testing.assert_allclose(problem.left_out(fit).outputs().T, 3 * fit.details.residual,
                               rtol=1e-6, atol=1e-12)


def test_left_out_closed_form_is_split_fit_score():
    """Leverage against fitting n times, for wls and norm, base model and with an effect."""
    from imu_noise_tools.loop.effect import find_effect
    from imu_noise_tools.loop.prediction import deviance
    from imu_noise_tools.loop.problem import Problem
    rng = np.random.default_rng(8)
    device = sim.Device.drawn(rng)
    for problem, close in ((core.CalibrationProblem(six(rng, device, times=2)), 5e-3),
                           (core.CalibrationProblem(spread(rng, device), 'norm'), 1e-2)):
        for model in (core.base_model(), core.base_model() + find_effect('calibration',
                                                                         'cubic')()):
            closed, looped = problem.held_out(model), Problem.held_out(problem, model)
            assert closed.excess == pytest.approx(looped.excess, abs=close)
            assert deviance(closed) == pytest.approx(deviance(looped), abs=0.3)


def test_correction_is_the_inverse():
    """What the device does, the correction undoes, with effects that are not linear as well."""
    from imu_noise_tools.loop.effect import find_effect, Model
    rng = np.random.default_rng(9)
    device = sim.Device.drawn(rng, noise=0.0)
    device.quadratic, device.asymmetry = (2e-4, -1e-4, 0), (0, 0, 2e-3)
    device.temperature = (1e-3, 0, -2e-3)
    x, temperature = sim.G * rng.normal(size=(50, 3)), rng.uniform(0, 50, 50)
    names = ('quadratic', 'asymmetry', 'temperature')
    known = [find_effect('calibration', name) for name in names]
    found = [cls(dict(zip((p.name for p in cls.parameters), getattr(device, cls.name))))
             for cls in known]
    correction = core.Correction('accel', device.scale, device.bias, Model(found), 25.0)
    raw = device.output(x, None, temperature)
    np.testing.assert_allclose(correction.apply(raw, temperature), x, atol=1e-9)
    np.testing.assert_allclose(correction.apply(raw[0], temperature[:1]), x[0], atol=1e-9)


@pytest.mark.parametrize('times, word', [(1, 'missing -z'), (2, 'held')])
def test_missing_face(times, word):
    """A missing face is refused by name although the rank is full; twice another does not help."""
    rng = np.random.default_rng(10)
    poses = six(rng, sim.Device.drawn(rng), times=times, names=False)
    keep = [k for k in range(poses.n) if k % 6 != 5]
    with pytest.raises(InputError, match=r'5 of 6 faces seen; missing -z') as refusal:
        core.calibrate(poses.take(keep))
    assert word in str(refusal.value) and 'hold -z up' in refusal.value.remedy


def test_same_face_twice_is_averaged_and_said():
    """Seven poses of six faces: solved, and the notes say so."""
    rng = np.random.default_rng(11)
    poses = six(rng, sim.Device.drawn(rng), times=2, names=False).take([0, 1, 2, 3, 4, 5, 6])
    assert '+x was held 2 times: averaged' in core.calibrate(poses).notes


def test_counts_and_g_are_refused():
    """Readings that cannot be m/s^2 at rest are refused with what they may be."""
    from imu_noise_tools.calibration.positions import check_unit
    for value, word, remedy in (
            (1.0, 'g, not m/s', '--accel-unit g'), (998.0, 'mg, not m/s', '--accel-unit mg'),
            (2061.0, 'counts', '--accel-unit 1/'), (0.02, 'gravity may have', 'raw')):
        with pytest.raises(InputError, match=word) as refusal:
            check_unit(value * np.eye(3), sim.G)
        assert remedy in refusal.value.remedy


def test_upside_down_axis():
    """An axis whose sign is against the known inputs is named."""
    rng = np.random.default_rng(12)
    poses = six(rng, sim.Device.drawn(rng))
    flipped = poses.outputs.copy()
    flipped[1] *= -1
    with pytest.raises(FitError, match='accel_y is upside down'):
        core.calibrate(replace(poses, outputs=flipped))


def test_too_little_spread_for_norm():
    """Twelve poses that are all faces do not do; the number is said."""
    rng = np.random.default_rng(13)
    with pytest.raises(InputError, match='6 poses point in different directions.*needs 12'):
        core.calibrate(six(rng, sim.Device.drawn(rng), times=2, names=False), 'norm')
    near = core.Poses.of('accel', sim.G * np.array([[np.sin(a), 0 * a, np.cos(a)] for a
                                                    in np.linspace(0, 6, 20)]).T,
                         1e-3, sim.G)
    with pytest.raises(InputError, match='too alike'):
        core.calibrate(near, 'norm')


def test_method_is_chosen_from_the_poses():
    """Spread poses are fitted by magnitude alone, faces with what they read across as well."""
    rng = np.random.default_rng(14)
    device = sim.Device.drawn(rng)
    assert core.calibrate(spread(rng, device)).problem.method == 'norm'
    assert core.calibrate(six(rng, device, times=3, names=False)).problem.method == 'faces'


LEVEL = {0: 100, 1: 250, 2: 500, 5: 1500, 10: 4000}     # tilt, deg: ppm of a scale factor


@pytest.mark.parametrize('tilt', daily(LEVEL, 5))
def test_faces_need_no_level(tilt):
    """At any tilt 93 to 97 % of the truths lie inside, and scale factors hardly feel it."""
    rng = np.random.default_rng(17)
    hits, scale = [], []
    for _ in range(200):
        device = sim.Device.drawn(rng, cross=0.01)
        poses = six(rng, device, tilt)
        fit, true = core.fit(core.base_model(), poses, 'faces'), truth(device)
        hits.append([e.ci95[0] <= true[k] <= e.ci95[1] for k, e in estimates(fit).items()])
        scale.append(np.diag(fit.details.scale - device.scale))
        if tilt:
            assert np.degrees(fit.details.tilt) == pytest.approx(tilt, rel=0.95)
    assert 0.93 <= np.mean(hits) <= 0.975
    assert 1e6 * np.sqrt(np.mean(np.square(scale))) < LEVEL[tilt]


@pytest.mark.parametrize('tilt, times', [(1, 1), *(seldom(*row) for row in (
    (0.2, 1), (0.5, 1), (3, 1), (10, 1), (1, 2)))])
def test_intervals_of_faces_hold_for_axes_that_are_not_square(tilt, times):
    """Cross-axis terms of 3 %, which faces cannot tell: intervals hold, and ± about values."""
    rng = np.random.default_rng(26)
    inside, near = [], []
    for _ in range(200):
        device = sim.Device.drawn(rng, cross=0.03)
        found = estimates(core.fit(core.base_model(), six(rng, device, tilt, times), 'faces'))
        true = truth(device)
        inside.append([e.ci95[0] <= true[k] <= e.ci95[1] for k, e in found.items()])
        near.append([abs(true[k] - e.point) < 2 * e.std for k, e in found.items()])
    assert 0.92 <= np.mean(inside) <= 0.975 and np.mean(near) > 0.92


@pytest.mark.parametrize('turn, tilt, low, high', [(0, 3, 0.0, 0.7), (8, 1, 7.0, 9.0),
                                                   (20, 3, 17.0, 23.0)])
def test_a_rotation_is_kept_where_tilt_does_not_explain_it(turn, tilt, low, high):
    """Faces of a straight sensor seem turned by chance (3 deg: 2.6 deg rms); a case may be."""
    rng = np.random.default_rng(20)
    kept = []
    for _ in range(30):
        device = sim.Device.drawn(rng)
        axis = sim.spread_directions(1, rng)[0]
        device.scale = device.scale @ np.array(
            [sim.turned(e, axis, turn * DEG) for e in np.eye(3)])
        scale = core.fit(core.base_model(), six(rng, device, tilt), 'faces').details.scale
        kept.append(np.degrees(np.linalg.norm(Rotation.from_matrix(polar(scale)[1]).as_rotvec())))
    assert low <= np.sqrt(np.mean(np.square(kept))) <= high


def test_a_turned_case_is_kept():
    """A rotation beyond what tilt does is in S; magnitudes of corrected readings are g."""
    rng = np.random.default_rng(18)
    device = sim.Device.drawn(rng)
    turn = np.array([sim.turned(e, (1, 2, 3), 18 * DEG) for e in np.eye(3)])
    poses = six(rng, device)
    poses = replace(poses, outputs=device.scale @ turn @ (np.linalg.solve(
        device.scale, poses.outputs - device.bias[:, None])) + device.bias[:, None])
    c = core.calibrate(poses, 'faces')
    assert np.linalg.norm(c.S - device.scale @ turn) < 0.06
    x = c.apply(c.poses.outputs.T)
    np.testing.assert_allclose(np.linalg.norm(x, axis=1), sim.G, rtol=2e-3)


def test_what_eleven_spread_poses_support():
    """Poses in no face's direction are fitted by their magnitudes; what one more adds is said."""
    rng = np.random.default_rng(19)
    device = sim.Device.drawn(rng)
    c = core.calibrate(spread(rng, device, 11))
    assert c.problem.method == 'few'
    np.testing.assert_allclose(np.diag(c.S), np.diag(device.scale), atol=1e-3)
    assert any(n.startswith('one more pose with') and n.endswith(' better') for n in c.notes)
    assert not any('be told' in n for n in c.notes)


@pytest.mark.parametrize('n', daily([7, 8, 9, 11], 7, 9))
def test_few_poses_in_any_directions(n):
    """Axes up to 2 deg off square: solved, within the stated errors, what is unseen said."""
    rng = np.random.default_rng(46)
    pulls, said, refused = [], [], 0
    for _ in range(12):
        device = sim.Device.drawn(rng, cross=2 * DEG, upper=True)
        true = sim.G * sim.tilted(sim.spread_directions(n, rng), 15 * DEG, rng)
        poses = core.Poses.of('accel', device.output(true, rng).T, device.noise, sim.G)
        try:
            c = core.calibrate(poses, 'few')
        except InputError as error:     # of so few all may lie about a plane
            assert 'one more pose with' in str(error)
            refused += 1
            continue
        std_s, std_b = c.std
        pulls.append(np.r_[np.diag(c.S - device.scale) / np.diag(std_s),
                           (c.bias - device.bias) / std_b])
        said.append(any('not observable' in s and 'the angle between' in s for s in c.notes))
        assert c.fit.details.dof == n - 6
    assert refused <= (n < 9)
    assert np.abs(pulls).max() < 4 and 0.5 < np.sqrt(np.mean(np.square(pulls))) < 1.5
    assert np.mean(said) > 0.9 if n < 9 else np.mean(said) < 0.3


@pytest.mark.parametrize('of, met', [(6, True), (-7, True), (-9, True), (-11, False),
                                     (12, False)])
def test_a_residual_that_is_met_by_construction_is_no_error(of, met):
    """Of six faces, or of as many directions as coefficients, what is left is rounding."""
    rng, left = np.random.default_rng(48), []
    for _ in range(5):
        device = sim.Device.drawn(rng, upper=True)
        c = core.calibrate(six(rng, device, times=of // 6), 'faces') if of > 0 else \
            core.calibrate(spread(rng, device, -of), 'norm' if of < -11 else 'few')
        left.append(np.linalg.norm(c.apply(c.poses.outputs.T), axis=1) - sim.G)
        assert ('residual_rms' not in c.problem.summary(c.fit)) == met
    assert (np.sqrt(np.mean(np.square(left))) < 0.1 * device.noise) == met
    ax = before_and_after(new_figure(4, 4).add_subplot(), c)
    assert any('whatever they say' in t.get_text() for t in ax.texts) == met
    shown = [t.get_text() for t in ax.get_legend().get_texts()]
    assert any(s.startswith('calibrated') for s in shown) == (not met)
    assert len(ax.lines) == (2 if met else 4), 'no point is drawn of it'


def test_too_few_poses_say_what_they_do_not_tell():
    """Six poses of one side are refused in one line, with the pose that would help most."""
    rng = np.random.default_rng(47)
    device = sim.Device.drawn(rng, cross=2 * DEG, upper=True)
    up = sim.tilted([[1, 1, 1]] * 6 / np.sqrt(3), 15 * DEG, rng)
    poses = core.Poses.of('accel', device.output(sim.G * up, rng).T, device.noise, sim.G)
    with pytest.raises(InputError, match='the 6 poses (do not )?tell .*scale factor') as refusal:
        core.calibrate(poses, 'few')
    assert refusal.value.remedy.startswith('one more pose with')


def test_edges_stand_in_for_a_face():
    """Five faces and three edges tell all six numbers; five faces alone are refused."""
    rng = np.random.default_rng(20)
    device = sim.Device.drawn(rng)
    edges = np.array([[1, 0, -1], [0, 1, -1], [-1, -1, -1]]) / np.sqrt([[2], [2], [3]])
    true = sim.G * sim.tilted(np.vstack([sim.faces()[1][:5], edges]), 2 * DEG, rng)
    poses = core.Poses.of('accel', device.output(true, rng).T, device.noise, sim.G)
    c = core.calibrate(poses)
    std_s, std_b = c.std
    np.testing.assert_array_less(np.abs(c.bias - device.bias), 4 * std_b)
    np.testing.assert_array_less(np.abs(np.diag(c.S - device.scale)), 4 * np.diag(std_s))
    assert any('no pose has -z up' in n for n in c.notes)
    with pytest.raises(InputError, match='missing -z'):
        core.calibrate(poses.take(range(5)))
    with pytest.raises(InputError, match='do not tell three') as refusal:
        core.calibrate(poses.take([0, 1, 2, 3, 7]))
    assert 'z' in refusal.value.remedy and refusal.value.remedy.startswith('one more pose with')


def test_the_picture_of_faces_shows_what_chi_squared_counts():
    """Bars of faces and of an edge: their squares are chi-squared, but for what was known."""
    rng = np.random.default_rng(48)
    device = sim.Device.drawn(rng)
    edges = np.array([[1, 0, -1], [0, 1, 1], [-1, -1, 0]]) / np.sqrt(2)
    true = sim.G * sim.tilted(np.vstack([sim.faces()[1], edges]), 2 * DEG, rng)
    out = device.output(true, rng)
    out[7] += 0.02                                          # something happens at an edge
    c = core.calibrate(core.Poses.of('accel', out.T, device.noise, sim.G))
    ax = residuals(new_figure(11, 4).add_subplot(), c)
    height = np.array([b.get_height() for k in ax.containers for b in k])
    system = c.fit.details.equations
    assert c.problem.method == 'faces' and len(height) == 6 * 3 + 3
    assert np.sum(height ** 2) == pytest.approx(np.sum(system.residual[system.pose >= 0] ** 2),
                                                rel=0.1)


@pytest.mark.parametrize('method', [None, 'wls'])
def test_tilted_faces_warn(method):
    """Faces off by more than a table are noticed, with the angle and what to do."""
    rng = np.random.default_rng(15)
    said = ' '.join(core.calibrate(six(rng, sim.Device.drawn(rng), tilt=5, times=3, names=False),
                                   method).warnings)
    assert 'tilted by about' in said and '12 spread poses' in said


def test_scale_of_a_wrong_turn():
    """A wrong angle or rate shows as a scale no gyroscope has."""
    rng = np.random.default_rng(16)
    device = sim.Device.drawn(rng, 'gyro', 1e-4)
    inputs = np.vstack([np.eye(3), -np.eye(3)])
    poses = core.Poses.of('gyro', device.output(2.2 * inputs, rng).T, 1e-4, 1.0, inputs.T)
    with pytest.raises(FitError, match='2.[12]. times as large'):
        core.calibrate(poses)


@pytest.mark.parametrize('latitude, height, value',
                         [(0, 0, 9.7803253359), (90, 0, 9.8321849379), (45, 0, 9.80620),
                          (45, 1000, 9.80311)])
def test_normal_gravity(latitude, height, value):
    """WGS-84 normal gravity at equator, pole and 45 degrees, and 3.086e-6 less per metre."""
    assert core.normal_gravity(latitude, height) == pytest.approx(value, abs=1e-5)


def test_gravity_is_said():
    """Given, computed or standard, with where it is from; contradictions are wrong usage."""
    assert core.gravity()[0] == 9.80665 and 'standard' in core.gravity()[1]
    assert 'WGS-84' in core.gravity(latitude=48)[1]
    for wrong in ({'given': 9.8, 'latitude': 3}, {'height': 3}, {'given': 1.0}, {'latitude': 91}):
        with pytest.raises(UsageError):
            core.gravity(**wrong)


def test_equations_of_a_fit_that_has_gone_astray_are_refused_in_words():
    """Turns of which the rate is wrong take a fit of them to infinity."""
    matrix = np.ones((6, 2))
    matrix[3, 1] = np.inf
    keys = ('bias', 'b_x'), ('bias', 'b_y')
    astray = Equations(matrix, np.ones(6), np.zeros(6, int), keys, None)
    with pytest.raises(FitError, match='the fit diverges'):
        astray.theta


def test_one_degree_of_freedom_is_one():
    """Its word is counted like any other."""
    assert degrees_of_freedom(1) == '1 degree of freedom'
    assert degrees_of_freedom(3) == '3 degrees of freedom'
