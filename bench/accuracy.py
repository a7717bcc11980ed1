# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How good are the estimates: error over the Cramer-Rao bound, coverage of intervals and limits.

    python bench/accuracy.py [--records 334] [--hours 1] [--rate 25] [--data ../shared/data]

Records come from test/hidden.py (recursions in time, no formula of the package); their three axes
are independent draws. The bound is the Fisher information of the cosine coefficients, each with
the expectation that the process gives it in a finite record: computed here, not by the package.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys
import time

import numpy as np

TOP = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(TOP), str(TOP / 'test')]

import hidden  # noqa: E402

from imu_noise_tools.core import units  # noqa: E402
from imu_noise_tools.core.record import ImuRecord  # noqa: E402
from imu_noise_tools.loop.effect import model_of  # noqa: E402
from imu_noise_tools.loop.study import assess  # noqa: E402
from imu_noise_tools.noise.gather import gather  # noqa: E402
from imu_noise_tools.noise.problem import NoiseProblem  # noqa: E402

AXES = ('gyro_x', 'gyro_y', 'gyro_z')
DEG = np.pi / 180
N, B = 0.005 * DEG, 5 * DEG / 3600
LABEL = {'N': 'white', 'B': 'flicker', 'K': 'random_walk', 'sigma': 'gauss_markov',
         'tc': 'gauss_markov'}
METHODS = ('likelihood', 'avar', 'slopes')
CASES = {
    'N, B, K': {'N': N, 'B': B, 'K': 2.5e-4 * DEG},
    'N, B, K below what the record shows': {'N': N, 'B': B, 'K': 1e-5 * DEG},
    'N, Gauss-Markov': {'N': N, 'sigma': 4e-5, 'tc': 15.0},
}


# --- the bound -----------------------------------------------------------------------------------

def flicker_share(n: int, k: np.ndarray) -> np.ndarray:
    """Return E[I_k]/S(f_k) of flicker noise in a finite record, from its structure function."""
    size = 1024                                         # scale-free: the same for every length
    angle = np.pi * np.outer(np.arange(1, 41), np.arange(size) + 0.5) / size
    phi = np.sqrt(2 / size) * np.cos(angle)
    d = -2 / np.pi * np.concatenate([[0], np.cumsum(1 / (2 * np.arange(1, size) - 1))])
    lag = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    exact = 2 * np.einsum('ki,ij,kj->k', phi, d[lag], phi, optimize=True)
    share = exact * np.sin(np.pi * np.arange(1, 41) / (2 * size))
    out = np.ones(len(k))
    out[:40] = share[:len(out)]
    return out


def densities(truth, n, dt):
    """Return {parameter: d S/d ln parameter} and S at every cosine coefficient."""
    k = np.arange(1, n)
    s = 2 * np.sin(np.pi * k / (2 * n))
    parts, slopes = {}, {}
    parts['N'] = np.full(n - 1, 2 * truth['N'] ** 2)
    if 'B' in truth:
        parts['B'] = 2 * truth['B'] ** 2 * dt / s * flicker_share(n, k)
    if 'K' in truth:
        parts['K'] = 2 * truth['K'] ** 2 * dt ** 2 / s ** 2
    if 'tc' in truth:
        def sampled(tc):
            p = np.exp(-dt / tc)
            return 2 * dt * truth['sigma'] ** 2 * (1 - p * p) / ((1 - p) ** 2 + p * s ** 2)
        parts['sigma'] = sampled(truth['tc'])
        h = 1e-4
        up, down = (sampled(truth['tc'] * np.exp(x)) for x in (h, -h))
        slopes['tc'] = (up - down) / (2 * h)
    slopes.update({name: 2 * part for name, part in parts.items()})
    return slopes, sum(parts.values())


def bound(truth, n, dt) -> dict[str, float]:
    """Return the Cramer-Rao bound of each parameter, relative to its value."""
    slopes, total = densities(truth, n, dt)
    jac = np.array([slopes[name] / total for name in truth])
    return dict(zip(truth, np.sqrt(np.diag(np.linalg.inv(0.5 * jac @ jac.T)))))


# --- draws ---------------------------------------------------------------------------------------

def draw(truth, n, dt, rng):
    """Return samples of one axis."""
    if 'tc' in truth:
        bump = hidden.decay(n, dt, truth['sigma'], truth['tc'], rng)
        return hidden.white(n, dt, truth['N'], rng) + bump
    return hidden.base_noise(n, dt, truth, rng)


def run_case(truth, records, n, dt, seed):
    """Return estimates of each parameter, the same by other methods, and the scores of views."""
    model = model_of('noise', dict.fromkeys(LABEL[k] for k in truth))
    found = {k: [] for k in truth}
    other = {m: {k: [] for k in truth} for m in METHODS[1:]}
    views = {}
    for i in range(records):
        rng = np.random.default_rng([seed, i])
        y = np.column_stack([draw(truth, n, dt, rng) for _ in AXES])
        for e in gather(ImuRecord(y, None, np.arange(n) * dt, 1 / dt), AXES).values():
            problem = NoiseProblem(e)
            fit = problem.fit(model)
            for k in truth:
                found[k].append(fit.estimates[LABEL[k]][k])
            if i < records // 4:
                for method, some in other.items():
                    if method == 'slopes' and 'tc' in truth:
                        continue
                    read = NoiseProblem(e, method=method).fit(model)
                    for k in truth:
                        some[k].append(read.estimates[LABEL[k]][k])
                error = assess(problem, model).error
                views.setdefault('held_out', []).append((error.excess, error.std))
                for name, v in error.views.items():
                    views.setdefault(name, []).append((v.excess, v.std))
    return found, other, views


# --- tables --------------------------------------------------------------------------------------

def spread(some, truth) -> float:
    """Return the relative rms error of the most likely values."""
    points = np.array([e.point for e in some if e.point is not None])
    return float(np.sqrt(np.mean((points / truth - 1) ** 2)))


def share(hits) -> str:
    """Return a share in percent with its standard error."""
    hits = np.asarray(list(hits), float)
    if not len(hits):
        return '-'
    p = hits.mean()
    return f'{100 * p:.1f} +- {100 * np.sqrt(max(p * (1 - p), 1 / len(hits)) / len(hits)):.1f}'


def table_row(name, truth, some, other, limit) -> str:
    """Return one row: bound, error over bound, coverage of intervals and limits, others."""
    rmse = spread(some, truth)
    null = [e for e in some if e.value is None]
    rest = [f'{100 * spread(m[name], truth):.3g}' if m[name] else '-' for m in other.values()]
    covers = share(e.ci95[0] <= truth <= e.ci95[1] for e in some if e.ci95)
    above = share(e.value is None and truth > e.upper95 for e in some)
    # the bound is one of ln x: where the error is large it is this that it bounds
    logs = [np.log(e.point / truth) for e in some if e.value is not None and e.point > 0]
    ln = np.sqrt(np.mean(np.square(logs))) if len(null) < len(some) / 10 else np.nan
    return ' | '.join([f'| {name}', f'{truth:.3g}', f'{100 * limit:.3g}', f'{100 * rmse:.3g}',
                       f'{rmse / limit:.2f}', f'{ln / limit:.2f}', covers,
                       f'{100 * len(null) / len(some):.1f}', above, *rest]) + ' |'


def value_of(estimate, unit, sensor) -> str:
    """Return a value as the field writes it, or its limit."""
    if estimate.value is not None:
        return units.shown(estimate.value, unit, sensor)
    return f'< {units.shown(estimate.upper95, unit, sensor)}' if estimate.upper95 else 'none'


def recording(path: Path):
    """Print the coefficients of one static recording by three methods."""
    with np.load(path) as data:
        gyro, accel = data['gyro'].astype(float), data['accel'].astype(float)
        rate = float(data['rate_hz'])
    record = ImuRecord(gyro, accel, np.arange(len(gyro)) / rate, rate)
    model = model_of('noise', ('white', 'flicker', 'random_walk'))
    print(f'\n{path.stem}: {len(gyro)} samples at {rate:g} Hz\n')
    print('| axis | | likelihood | 95 % interval | avar | slopes |\n|---|---|---|---|---|---|')
    for axis, evidence in gather(record, record.axes).items():
        sensor = axis.partition('_')[0]
        fits = [NoiseProblem(evidence, method=m).fit(model) for m in METHODS]
        for effect in model:
            p = effect.parameters[0]
            found = [f.estimates[effect.label][p.name] for f in fits]
            ends = ' to '.join(units.shown(x, p.unit, sensor) for x in found[0].ci95)
            like, *rest = (value_of(e, p.unit, sensor) for e in found)
            print(' | '.join([f'| {axis}', p.name, like, ends, *rest]) + ' |')


def report_case(name, truth, records, n, dt, seed):
    """Run one case and print its tables."""
    begin = time.process_time()
    limits = bound(truth, n, dt)
    found, other, views = run_case(truth, records, n, dt, seed)
    print(f'\n{name} ({time.process_time() - begin:.0f} CPU s)\n')
    print('| | truth | bound | rmse | rmse/bound | of ln x | ci95 covers | null | above upper95 '
          '| avar rmse | slopes rmse |')
    print('|---|---|---|---|---|---|---|---|---|---|---|')
    for k, value in truth.items():
        print(table_row(k, value, found[k], other, limits[k]))
    print('\nviews under the true model: mean excess in its std, scatter, share within 2 std')
    for view, some in views.items():
        pull = np.array([x / s for x, s in some if s > 0])
        if len(pull):
            print(f'  {view:13s} {pull.mean():+.2f}  {pull.std():.2f}  {share(pull <= 2)} %')
    sys.stdout.flush()


def main():
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--records', type=int, default=334, help='of three axes, for each case')
    parser.add_argument('--hours', type=float, default=1.0)
    parser.add_argument('--rate', type=float, default=25.0)
    parser.add_argument('--data', type=Path, default=TOP.parent / 'shared' / 'data',
                        help='folder of static recordings')
    args = parser.parse_args()
    n, dt = int(args.hours * 3600 * args.rate), 1 / args.rate
    print(f'{3 * args.records} draws a case, {args.hours:g} h at {args.rate:g} Hz; errors in %')
    for seed, (name, truth) in enumerate(CASES.items()):
        report_case(name, truth, args.records, n, dt, seed)
    for name in ('mpu6050_static_449s', 'adis16405_run2', 'adis16405_run6'):
        path = args.data / 'records' / f'{name}.npz'
        if path.is_file():
            recording(path)
        else:
            print(f'\n{path}: not there')


if __name__ == '__main__':
    main()
