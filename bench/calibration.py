# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Figures of the calibration: coverage, bias by tilt, hidden effects, real records.

    OMP_NUM_THREADS=1 python bench/calibration.py [--sessions 200] [--seed N]
        [coverage|tilts|few|turns|hidden|session|flaws|six|real ...]

Sessions are made by test/calibration_sessions.py, which shares no code with the package.

"""

from __future__ import annotations

import argparse
from collections import Counter
import os
from pathlib import Path
import sys
import time

import numpy as np
from scipy.linalg import rq
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / 'test')]

import calibration_sessions as sim  # noqa: E402,I100,I201

from imu_noise_tools import calibration as core  # noqa: E402,I201
from imu_noise_tools.calibration import faces  # noqa: E402
from imu_noise_tools.calibration.poses import DIRECTIONS  # noqa: E402
from imu_noise_tools.calibration.problem import CalibrationProblem  # noqa: E402
from imu_noise_tools.core.errors import FitError, InputError  # noqa: E402
from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from imu_noise_tools.loop.diagnosis import diagnose  # noqa: E402
from imu_noise_tools.loop.effect import find_effect  # noqa: E402
from imu_noise_tools.loop.prediction import deviance, State  # noqa: E402
from imu_noise_tools.tasks import calibration as tasks  # noqa: E402

DEG = np.pi / 180
DATA = Path(os.environ.get('IMU_NOISE_DATA') or ROOT.parent / 'shared' / 'data')
NAMES = [('scale', f'S_{2 * k}') for k in 'xyz'] + [
    ('cross_axis', f'S_{a}{b}') for a in 'xyz' for b in 'xyz' if a != b] + [('bias', f'b_{k}')
                                                                            for k in 'xyz']


# what sessions are made of: a session returns (problem, device)

def six_faces(rng, device, tilt=1.0, times=1, temperature=False):
    """Return a problem of faces held by hand: stated tilt 1 deg, true tilt as given (deg)."""
    names, directions = sim.faces(times)
    inputs = sim.G * directions
    true = sim.G * sim.tilted(directions, tilt * DEG, rng)
    t = rng.uniform(15, 45, len(true)) if temperature else None
    poses = core.Poses.of('accel', device.output(true, rng, t).T, device.noise, sim.G, inputs.T,
                          temperature=t, reference_temperature=25.0, names=names)
    return CalibrationProblem(poses, 'wls', 1.0 * DEG)


def spread_poses(rng, device, n=24, temperature=False):
    """Return a problem of poses in all directions, fitted by their magnitude."""
    true = sim.G * sim.spread_directions(n, rng)
    t = rng.uniform(15, 45, n) if temperature else None
    poses = core.Poses.of('accel', device.output(true, rng, t).T, device.noise, sim.G,
                          temperature=t,
                          reference_temperature=25.0)
    return CalibrationProblem(poses, 'norm')


def fixture(rng, device, n=24):
    """Return a problem of known directions: a dividing head, true to 0.02 deg."""
    true = sim.spread_directions(n, rng)
    t = rng.uniform(15, 45, n)
    poses = core.Poses.of('accel', device.output(sim.G * sim.tilted(true, 0.02 * DEG, rng), rng,
                                                 t).T, device.noise,
                          sim.G, sim.G * true.T, temperature=t, reference_temperature=25.0)
    return CalibrationProblem(poses, 'wls', 0.02 * DEG)


def rate_table(rng, device, rates=(20, 60, 120, 200), tilt=0.05):
    """Return a problem of a rate table: each axis up and down, both ways, several rates."""
    inputs, force = [], []
    for axis in np.eye(3):
        for up in (1, -1):
            for way in (1, -1):
                for r in rates:
                    inputs.append(way * r * DEG * axis)
                    force.append(up * sim.G * axis)
    inputs, force = np.array(inputs), np.array(force)
    t = rng.uniform(15, 45, len(inputs))
    size = np.linalg.norm(inputs, axis=1, keepdims=True)
    true = size * sim.tilted(inputs / size, tilt * DEG, rng)
    poses = core.Poses.of('gyro', device.output(true, rng, t, force).T, device.noise,
                          max(rates) * DEG, inputs.T,
                          force=force.T, temperature=t, reference_temperature=25.0)
    return CalibrationProblem(poses, 'wls', tilt * DEG)


SESSIONS = {'spread': (spread_poses, 'accel', 1e-3), 'fixture': (fixture, 'accel', 1e-3),
            'table': (rate_table, 'gyro', 1e-4),
            'faces x4': (lambda r, d: six_faces(r, d, times=4, temperature=True), 'accel', 1e-3)}
HIDDEN = {'spread': ('quadratic', 'cubic', 'asymmetry'),
          'fixture': ('quadratic', 'cubic', 'asymmetry', 'temperature'),
          'table': ('quadratic', 'cubic', 'asymmetry', 'temperature', 'g_sensitivity'),
          'faces x4': ('temperature', 'tilt')}
TWIN = {'quadratic': 'asymmetry', 'asymmetry': 'quadratic'}


def fitted(problem, *more):
    """Return the fit of the base model and these effects."""
    model = core.base_model()
    for name in more:
        model = model + find_effect('calibration', name)()
    return problem.fit(model)


def verdict(problem):
    """Return the generic loop's diagnosis of the base model."""
    model = core.base_model()
    return diagnose(State(problem, problem.fit(model), problem.held_out(model)))


def inside(fit, device):
    """Return, for each coefficient, whether the truth lies in its 95 % interval."""
    cross = [device.scale[a, b] for a in range(3) for b in range(3) if a != b]
    truth = dict(zip(NAMES, [*np.diag(device.scale), *cross, *device.bias]))
    out = {}
    for label, name in NAMES:
        e = fit.estimates[label][name]
        if e.ci95 is not None:
            out[name] = e.ci95[0] <= truth[label, name] <= e.ci95[1]
    return out


def coverage(n, seed=1):
    """Print how often the truth lies inside the interval, and how tilt biases ``ols``."""
    rng = np.random.default_rng(seed)
    hits = {m: [] for m in ('ols', 'wls', 'norm')}
    bias = {m: [] for m in hits}
    scale = {m: [] for m in hits}
    plain, chi2 = [], []
    for _ in range(n):
        device = sim.Device.drawn(rng)
        problem = six_faces(rng, device)
        for m in ('ols', 'wls'):
            fit = core.fit(core.base_model(), problem.poses, m, problem.tilt)
            hits[m].append(list(inside(fit, device).values()))
            bias[m].append(fit.details.bias - device.bias)
            scale[m].append(np.diag(fit.details.scale) - np.diag(device.scale))
        plain.append(np.abs(fit.details.bias - device.bias).max())
        chi2.append(fit.details.chi2)
        device = sim.Device.drawn(rng, upper=True)
        fit = fitted(spread_poses(rng, device))
        hits['norm'].append(list(inside(fit, device).values()))
        bias['norm'].append(fit.details.bias - device.bias)
        scale['norm'].append(np.diag(fit.details.scale) - np.diag(device.scale))
    print(f'### Coverage, {n} sessions (six faces tilted by 1 deg; 24 spread poses for norm)\n')
    print('| method | inside the 95 % interval | worst coefficient | bias error rms, m/s^2 | '
          'mean scale error, ppm |')
    print('|---|---|---|---|---|')
    for m, h in hits.items():
        h = np.array(h)
        print(f'| {m} | {100 * h.mean():.1f} % | {100 * h.mean(0).min():.1f} % | '
              f'{np.sqrt(np.mean(np.square(bias[m]))):.4f} | {1e6 * np.mean(scale[m]):.0f} |')
    print(f'\nchi-squared of wls: mean {np.mean(chi2):.2f} (6 degrees of freedom)\n', flush=True)


def tilts(n, seed=3):
    """Print, by the tilt of six faces, coverage and errors of faces, wls and ols."""
    print(f'### Six faces without a level, {n} sessions each\n\n'
          '| tilt, deg | method | cross-axis within, % | inside: scale | cross-axis | bias | all '
          '| scale error rms, ppm | bias error rms, m/s^2 |\n|---|---|---|---|---|---|---|---|'
          '---|')
    for tilt in (0, 0.2, 1, 2, 3, 5, 10):
        for m, cross in (*(('faces', c) for c in (0.002, 0.01, 0.02, 0.03)), ('wls', 0.01),
                         ('ols', 0.01)):
            rng = np.random.default_rng(seed)
            hits, error = [], []
            for _ in range(n):
                device = sim.Device.drawn(rng, cross=cross)
                poses = six_faces(rng, device, tilt).poses
                fit = core.fit(core.base_model(), poses, m)
                hits.append(list(inside(fit, device).values()))
                error.append(np.r_[np.diag(fit.details.scale - device.scale),
                                   fit.details.bias - device.bias])
            h, parts = np.array(hits), np.reshape(error, (n, 2, 3))
            e = np.sqrt(np.mean(parts ** 2, axis=(0, 2)))
            share = ' | '.join(f'{100 * x.mean():.1f} %'
                               for x in (h[:, :3], h[:, 3:9], h[:, 9:], h))
            print(f'| {tilt} | {m} | {100 * cross:g} | {share} | '
                  f'{1e6 * e[0]:.0f} | {e[1]:.4f} |', flush=True)
    print()


def few(n, seed=8):
    """Print what poses in random directions come to: axes off by 2 deg, scale 5 %, bias 0.5."""
    print(f'### Poses in random directions, {n} sessions each, noise of a mean 0.0003 to 0.01 '
          'm/s^2\n\n| poses | method | refused | scale inside | bias | angles | error rms: scale, '
          '% | bias, m/s^2 | angle, deg |\n|---|---|---|---|---|---|---|---|---|')
    for k in range(6, 15):
        rng = np.random.default_rng([seed, k])
        how, hits, error = Counter(), [], []
        for _ in range(n):
            device = sim.Device(np.diag(rng.uniform(0.95, 1.05, 3)) @ sim.tilted(
                np.eye(3), 0.8 * DEG, rng), rng.uniform(-0.5, 0.5, 3),
                noise=10 ** rng.uniform(-3.5, -2))
            true = sim.G * random_directions(k, rng)
            poses = core.Poses.of('accel', device.output(true, rng).T, device.noise, sim.G)
            try:
                c = core.calibrate(poses)
            except (FitError, InputError) as failed:
                how[type(failed).__name__] += 1
                continue
            how[c.problem.method] += 1
            if c.problem.method != 'faces':         # its rows are turned into the sensor's axes
                device.scale = rq(device.scale)[0] * np.sign(np.diag(rq(device.scale)[0]))
            angle = np.triu_indices(3, 1)
            off = np.array([np.diag(c.S - device.scale), c.bias - device.bias,
                            (c.S - device.scale)[angle]])
            hits.append(np.abs(off) < 1.96 * np.array([np.diag(c.std[0]), c.std[1],
                                                       c.std[0][angle]]))
            error.append(off)
        inside_ = ' | '.join(f'{100 * x:.1f} %' for x in np.mean(hits, axis=(0, 2)))
        e = np.sqrt(np.mean(np.square(error), axis=(0, 2)))
        refused = how.pop('InputError', 0) + how.pop('FitError', 0)
        print(f'| {k} | {dict(how)} | {refused} | {inside_} | {100 * e[0]:.3f} | {e[1]:.4f} | '
              f'{e[2] / DEG:.3f} |', flush=True)
    print()


def random_directions(n, rng, apart_deg=15):
    """Return n random unit vectors (n, 3) so far apart."""
    out = []
    while len(out) < n:
        u = rng.normal(size=3)
        u /= np.linalg.norm(u)
        if all(u @ v < np.cos(apart_deg * DEG) for v in out):
            out.append(u)
    return np.array(out)


def turned(rng, n=16, **more):
    """Return (problem, device) of turns between poses in all directions, 3 s each."""
    accel = sim.Device.drawn(rng, noise=0.02, upper=True)
    gyro = sim.Device.drawn(rng, 'gyro', noise=2e-3)
    for name, value in more.items():
        setattr(gyro, name, value)
    ups = sim.spread_directions(n, rng)[rng.permutation(n)]
    t, rates, force, _ = sim.stream(accel, ups, rng, gyro=gyro, hold_s=3.0)
    record = ImuRecord(rates, force, t, 100.0)
    return tasks.calibrate_records([record], sensor='gyro').calibration.problem, gyro


def turns(n, seed=4):
    """Print coverage of the gyroscope by turns between poses, and of turns left out."""
    rng = np.random.default_rng(seed)
    hits, left, verdicts, found = [], [], Counter(), Counter()
    for _ in range(n):
        problem, device = turned(rng)
        fit = fitted(problem)
        hits.append(list(inside(fit, device).values()))
        left.append(np.degrees(problem.summary(fit)['left_out_rms']))
        verdicts[verdict(problem).verdict] += 1
        hidden = 3e-4 * rng.choice([-1, 1], (3, 3)) * rng.uniform(0.5, 1, (3, 3))
        found[outcome(verdict(turned(rng, g_sensitivity=hidden)[0]), 'g_sensitivity')] += 1
    h = np.array(hits)
    print(f'### Gyroscope by turns between 16 poses, {n} sessions\n')
    print(f'inside the 95 % interval {100 * h.mean():.1f} %, worst coefficient '
          f'{100 * h.mean(0).min():.1f} %; turns left out {np.mean(left):.3f} deg rms; nothing '
          f'hidden: {dict(verdicts)}; g-sensitivity of 0.15-0.3 mrad/s per m/s^2 hidden: '
          f'{dict(found)}\n', flush=True)


def in_a_session(rng, kind, name):
    """Return a problem of 24 poses in 400 s, with an effect of 5 to 15 mm/s^2 (noise 1)."""
    device = sim.Device.drawn(rng, upper=kind == 'spread')
    t, heat = np.linspace(5, 400, 24), rng.uniform(10, 45, 24)
    if kind == 'spread':
        names, true = None, sim.G * sim.spread_directions(24, rng)[rng.permutation(24)]
    else:
        names, true = sim.faces(4)
        true = sim.G * sim.tilted(true, 1 * DEG, rng)
    size, lag = rng.uniform(5e-3, 15e-3, 3) * rng.choice([-1, 1], 3), rng.uniform(40, 150)
    extra = {'drift': np.outer(t / 400, size), 'warm_up': np.outer(np.exp(-t / lag), size),
             'temperature_curve': np.outer(((heat - 25) / 15) ** rng.integers(2, 4), size),
             'temperature_scale': ((heat - 25) / 15)[:, None] * true / sim.G * size}
    out = device.output(true, rng) + extra.get(name, 0 * true)
    hot = name.startswith('temperature')
    poses = core.Poses.of('accel', out.T, device.noise, sim.G, time=t, names=names,
                          temperature=heat if hot else None, reference_temperature=25.0)
    return CalibrationProblem(poses, 'norm' if kind == 'spread' else 'faces')


def session(n, seed=5):
    """Print the verdicts on what sessions have: drift, warming up, temperature."""
    rng = np.random.default_rng(seed)
    print(f'### What sessions have, {n} each\n\n| poses | hidden | verdicts |\n|---|---|---|')
    for kind in ('spread', 'faces x4'):
        for name in ('drift', 'warm_up', 'temperature_curve', 'temperature_scale', 'nothing'):
            count = Counter(outcome(verdict(in_a_session(rng, kind, name)), name)
                            for _ in range(n))
            print(f'| {kind} | {name} | {dict(count)} |', flush=True)
    print()


def _from_stream(rng, device, kind, spoil):
    """Return what `calibrate` makes of a stream of poses, its acceleration (n, 3) spoilt."""
    ups = (sim.tilted(sim.faces()[1], 1 * DEG, rng) if kind == 'six faces' else
           sim.spread_directions(16, rng)[rng.permutation(16)])
    t, rates, force, _ = sim.stream(device, ups, rng, hold_s=3.0)
    return tasks.calibrate_records([ImuRecord(rates, spoil(force), t, 100.0)]).calibration


def _clipped(force):
    """Return forces (n, 3) of which one axis ends a little before what it shows at rest."""
    out, axis = force.copy(), int(np.argmax(force.max(0)))
    out[:, axis] = np.minimum(out[:, axis], np.quantile(out[:, axis], 0.97) - 0.1)
    return out


def flaws(n, seed=6):
    """Print coverage with a coarse output, and whether clipping and a turned case are said."""
    rng = np.random.default_rng(seed)
    print(f'### Flaws of a stream, {n} sessions each\n\n| poses | output in steps of ten times '
          'the noise: inside | verdicts | one axis clipped | case turned by 8-20 deg |'
          '\n|---|---|---|---|---|')
    for kind in ('six faces', 'spread'):
        hits, said, clipped, turned_ = [], Counter(), Counter(), Counter()
        for _ in range(n):
            device = sim.Device.drawn(rng, noise=0.005, upper=kind == 'spread')
            c = _from_stream(rng, device, kind, lambda a: 0.05 * np.round(a / 0.05))
            hits.append(list(inside(c.fit, device).values()))
            said[verdict(c.problem).verdict] += 1
            try:
                warned = _from_stream(rng, device, kind, _clipped).warnings
                clipped['warned' if 'saturated' in ' '.join(warned) else 'not said'] += 1
            except InputError as error:
                clipped['refused' if 'saturated' in str(error) else str(error)] += 1
            angle = rng.uniform(8, 20) * DEG
            turn = Rotation.from_rotvec(angle * sim.spread_directions(1, rng)[0])
            device = sim.Device.drawn(rng, noise=0.02)
            device.scale = turn.as_matrix() @ device.scale
            try:
                c = _from_stream(rng, device, 'six faces', lambda a: a)
                turned_['said' if 'is that rotation' in ' '.join(c.warnings) else 'not said'] += 1
            except InputError as error:
                turned_[str(error)] += 1
        print(f'| {kind} | {100 * np.mean(hits):.1f} % | {dict(said)} | {dict(clipped)} | '
              f'{dict(turned_)} |', flush=True)
    print()


def with_hidden(rng, kind, name, strength):
    """
    Return a problem with an effect so many standard errors large (largest component).

    The standard error is the one in a model that holds the effect's nearest rival, too: what the
    session can tell apart.

    """
    make, sensor, noise = SESSIONS[kind]
    device = sim.Device.drawn(rng, sensor, noise)
    if name == 'tilt':
        return six_faces(rng, device, tilt=rng.uniform(3, 6), times=4, temperature=True)
    twin = [TWIN[name]] if name in TWIN else []
    trial = fitted(make(rng, device), name, *twin)
    std = np.array([e.std or np.nan for e in trial.estimates[name].values()])
    draw = rng.uniform(-1, 1, len(std))
    if name == 'g_sensitivity':             # its isotropic part is what the Earth's rate does
        draw -= np.eye(3).ravel() * draw[[0, 4, 8]].mean()
    value = strength * draw / np.nanmax(np.abs(draw / std))
    setattr(device, name, value.reshape(3, 3) if name == 'g_sensitivity' else value)
    return make(rng, device)


def outcome(found, name):
    """Return how a diagnosis bears on what is hidden."""
    ranked = [f.name for f in found.ranked if f.gain > f.penalty]
    if found.verdict == 'missing':
        return 'right' if ranked[0] == name else 'wrong'
    if found.verdict == 'undecidable':
        return 'named' if name in ranked else 'wrong'
    return found.verdict


def falls(problem, name, others):
    """Return whether the left-out error falls with it, most with it, and again with another."""
    def error(*more):
        return deviance(problem.held_out(fitted(problem, *more).model))

    base, with_it = error(), error(name)
    one_wrong = min(error(x) for x in others)
    again = min(error(name, x) for x in others)
    return base - with_it > 4, with_it < one_wrong, with_it - again > 4


def hidden(n, seed=2):
    """Print the verdicts on hidden effects, and on nothing hidden."""
    rng = np.random.default_rng(seed)
    print(f'### Hidden effects, {n} sessions each, 5 to 15 standard errors (rival in the model)\n')
    print('| session | hidden | right | named in undecidable | wrong name | unknown | complete | '
          'error of left-out poses '
          'falls | falls most of all | falls again with a wrong one '
          '|\n|---|---|---|---|---|---|---|---|---|---|')
    total, right = 0, 0
    for kind, names in HIDDEN.items():
        for name in names:
            count, ladder = Counter(), []
            for _ in range(n):
                problem = with_hidden(rng, kind, name, rng.uniform(5, 15))
                count[outcome(verdict(problem), name)] += 1
                ladder.append(falls(problem, name,
                                    [x for x in names if x != name] or ['quadratic']))
            total += n
            right += count['right']
            share = [100 * count[k] / n for k in ('right', 'named', 'wrong', 'unknown',
                                                  'complete')]
            rungs = 100 * np.mean(ladder, axis=0)
            print(f'| {kind} | {name} | ' + ' | '.join(f'{v:.0f} %' for v in [*share, *rungs])
                  + ' |', flush=True)
    print(f'\nright over all: {100 * right / total:.1f} % of {total}\n')
    print('| session, nothing hidden | complete |\n|---|---|')
    total, right = 0, 0
    for kind, (make, sensor, noise) in {**SESSIONS,
                                        'six faces': (six_faces, 'accel', 1e-3)}.items():
        good = sum(verdict(make(rng, sim.Device.drawn(rng, sensor, noise))).verdict == 'complete'
                   for _ in range(2 * n))
        total, right = total + 2 * n, right + good
        print(f'| {kind} | {100 * good / (2 * n):.1f} % |', flush=True)
    print(f'\ncomplete over all: {100 * right / total:.1f} % of {total}\n')
    print('| session that cannot tell | undecidable, both named, poses named |\n|---|---|')
    for name in ('quadratic', 'asymmetry'):
        good = 0
        for _ in range(n):
            device = sim.Device.drawn(rng)
            std = [e.std for e in fitted(six_faces(rng, device, tilt=1.0),
                                         name).estimates[name].values()]
            setattr(device, name, rng.uniform(6, 15) * np.array(std) * rng.choice([-1, 1], 3))
            found = verdict(six_faces(rng, device))
            able = {f.name for f in found.ranked if f.gain > f.penalty}
            good += (found.verdict == 'undecidable' and {'quadratic', 'asymmetry'} <= able
                     and 'edges' in found.advice)
        print(f'| six faces, {name} (against its twin) | {100 * good / n:.0f} % |', flush=True)
    print()


def record(name, rate=None):
    """Return a real record, at a rate other than its label where that is given."""
    with np.load(DATA / 'records' / f'{name}.npz') as d:
        gyro, accel = d['gyro'].astype(float), d['accel'].astype(float)
        rate = rate or float(d['rate_hz'])
        t = d['t'] - d['t'][0] if 't' in d.files else np.arange(len(accel)) / rate
    return ImuRecord(gyro, accel, t, rate, path=name)


def six(n, seed=7):
    """Print the skew of real axes, and what six poses near the faces say against all poses."""
    print(f'### Six of the poses of a real record, {n} draws each\n')
    for name, g, rate in (
            ('xsens_mti_multipos', 9.81744, None), ('mpu9150_0_multipos', 9.81, None),
            ('mpu9150_1_multipos', 9.81, None), ('imucal_ferraris', 9.81, 102.4)):
        c = tasks.calibrate_records([record(name, rate)], gravity=g,
                                    **({'seconds': 1.0} if rate else {})).calibration
        k, _ = faces.polar(c.S)
        skew = [600 * k[i, j] / np.trace(k) for i, j in ((0, 1), (0, 2), (1, 2))]
        print(f'{name}: axes off orthogonal by {np.round(skew, 2).tolist()} %')
        u = np.linalg.solve(c.S, c.poses.outputs - c.bias[:, None])
        u /= np.linalg.norm(u, axis=0)
        near = {f: np.flatnonzero(u.T @ np.array(d) > np.cos(25 * DEG))
                for f, d in DIRECTIONS.items()}
        if not all(map(len, near.values())):
            continue
        kept = faces.POOR
        for cross in (0.01, 0.03):
            faces.POOR, rng, hits = cross / np.sqrt(3), np.random.default_rng(seed), []
            for _ in range(n):
                pick = [int(rng.choice(v)) for v in near.values()]
                poses = core.Poses.of('accel', c.poses.outputs[:, pick], c.poses.std[:, pick], g,
                                      names=list(near))
                fit = core.fit(core.base_model(), poses, 'faces')
                hits.append(list(inside(fit, sim.Device(c.S, c.bias)).values()))
            h = np.array(hits)
            print(f'  intervals for {100 * cross:.0f} %: inside the 95 % interval: scale '
                  f'{np.round(100 * h[:, :3].mean(0))}, cross-axis '
                  f'{100 * h[:, 3:9].mean():.0f} %, bias '
                  f'{np.round(100 * h[:, 9:].mean(0))}, all {100 * h.mean():.0f} %')
        faces.POOR = kept
    print()


def real():
    """Print real records beside their references."""
    print('### Real records\n')
    c = tasks.calibrate_records([record('xsens_mti_multipos')], gravity=9.81744).calibration
    std_s, std_b = c.std
    print('xsens_mti_multipos, norm, in counts (scale 414.333, zero 32768):\n')
    print('| axis | scale | ± | reference | factory sheet | bias | ± | reference | factory sheet '
          '|\n|---|---|---|---|---|---|---|---|---|')
    reference = ((414.419, 412.032, 414.621), (415, 413, 415), (33123.84, 33275.16, 32364.49),
                 (33123, 33276, 32360))
    for k, axis in enumerate('xyz'):
        print(f'| {axis} | {c.S[k, k] * 414.333:.3f} | {std_s[k, k] * 414.333:.3f} | '
              f'{reference[0][k]} | {reference[1][k]} | '
              f'{c.bias[k] * 414.333 + 32768:.2f} | {std_b[k] * 414.333:.2f} | {reference[2][k]} '
              f'| {reference[3][k]} |')
    error = np.linalg.norm(c.apply(c.poses.outputs.T), axis=1) - 9.81744
    print(f'\nresidual {np.sqrt(np.mean(error ** 2)):.5f} m/s^2 rms over {c.poses.n} poses '
          f'(reference 0.0011); '
          f'verdict {verdict(c.problem).verdict}: {verdict(c.problem).ranked[0].name}\n')
    c = tasks.calibrate_records([record('xsens_mti_multipos')], gravity=9.81744,
                                method='wls').calibration
    print('six nominal faces of the same record (hand-held), warned: ' + '; '.join(c.warnings)
          + '\n')
    published = {'mpu9150_0_multipos': ((0.363, 0.315, 0.647), (0.103, 0.097, 0.344)),
                 'mpu9150_1_multipos': ((0.471, 0.482, 0.932), (0.090, 0.070, 0.338))}
    print('| record | what | ours, g 9.80665 | ours, g 9.81 | published |\n|---|---|---|---|---|')
    for name, (scale, bias) in published.items():
        both = [tasks.calibrate_records([record(name)], gravity=g).calibration for g in (9.80665,
                                                                                         9.81)]
        std_s, std_b = both[0].std
        for k, axis in enumerate('xyz'):
            print(f'| {name} | scale {axis}, % | {100 * (both[0].S[k, k] - 1):.3f} ± '
                  f'{100 * std_s[k, k]:.3f} | '
                  f'{100 * (both[1].S[k, k] - 1):.3f} | {scale[k]} |')
            print(f'| {name} | bias {axis}, m/s² | {both[0].bias[k]:.4f} ± {std_b[k]:.4f} | '
                  f'{both[1].bias[k]:.4f} | {bias[k]} |')
        print(f'| {name} | χ² (dof), verdict | {both[0].fit.details.chi2:.1f} '
              f'({both[0].fit.details.dof}), '
              f'{verdict(both[0].problem).verdict} | | |')
    print()
    print('| record | gyroscope | ours | published |\n|---|---|---|---|')
    sheets = {'mpu9150_0_multipos': (9.81, (0.041, 0.457, 0.826), (1.146, -0.401, 1.261)),
              'mpu9150_1_multipos': (9.81, (0.007, 0.260, -0.179), (-0.573, 1.089, 0.286)),
              'xsens_mti_multipos': (9.81744, tuple(100 * (v / 4767.3 - 1) for v in
                                                    (4778, 4758, 4766)), None)}
    for name, (g, scale, bias) in sheets.items():
        problem = tasks.calibrate_records([record(name)], gravity=g,
                                          sensor='gyro').calibration.problem
        for more in ((), ('g_sensitivity',)):
            fit = fitted(problem, *more)
            std = [100 * fit.estimates['scale'][f'S_{2 * a}'].std for a in 'xyz']
            ours = ', '.join(f'{100 * (fit.details.scale[k, k] - 1):.3f} ± {std[k]:.3f}'
                             for k in range(3))
            print(f'| {name} {"+".join(more)} | scale, % | {ours} | '
                  f'{", ".join(f"{v:.3f}" for v in scale)} |')
            if bias:
                print(f'| | bias, deg/s | {np.degrees(fit.details.bias).round(3).tolist()} | '
                      f'{list(bias)} |')
            left = np.degrees(problem.summary(fit)['left_out_rms'])
            print(f'| | turns left out, deg rms | {left:.3f} | |')
        print(f'| | verdict | {verdict(problem).verdict}: {verdict(problem).ranked[0].name} | |')
    print()
    for sensor, rate, more in (('accel', None, {'seconds': 1.0}),
                               ('gyro', 102.4, {'turn_deg': 360, 'seconds': 1.0})):
        c = tasks.calibrate_records([record('imucal_ferraris', rate)], **more).calibration
        print(f'imucal_ferraris {sensor}: S {c.S.round(4).tolist()}, bias '
              f'{c.bias.round(4).tolist()}, '
              f'χ² {c.fit.details.chi2:.1f} ({c.fit.details.dof}), '
              f'{verdict(c.problem).verdict}\n')


def main():
    """Run what is asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('what', nargs='*', default=['coverage', 'hidden', 'real'])
    parser.add_argument('--sessions', type=int, default=200)
    parser.add_argument('--seed', type=int, help='of what is drawn (default: each its own)')
    args = parser.parse_args()
    begin = time.process_time()
    drawn = {} if args.seed is None else {'seed': args.seed}
    for run in (coverage, tilts, few, turns, session, flaws, hidden, six):
        if run.__name__ in args.what:
            run(args.sessions, **drawn)
    if 'real' in args.what:
        real()
    print(f'({time.process_time() - begin:.0f} CPU s)')


if __name__ == '__main__':
    main()
