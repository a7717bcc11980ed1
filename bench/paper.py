# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Repeat the experiments of Qian, Xia, Que and Zhang (2010): Tables 1-6, Figures 1-5.

The filter is that of config/adis16350.yaml.

    python bench/paper.py [-o FOLDER]

The record itself is not preserved: its noise is simulated with the figures that are (standard
deviation, mean, phi, bias instability). The numbers inside the paper's tables are not preserved
either; their form and every trend stated are.

"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.signal import lfilter
import yaml

from imu_noise_tools.core.units import DEG
from imu_noise_tools.filter.design import design
from imu_noise_tools.filter.problem import FilterProblem, START
from imu_noise_tools.filter.recorded import filter_record
from imu_noise_tools.loop.effect import model_of
from imu_noise_tools.loop.study import Study
import paper_chain as ar

HERE = Path(__file__).resolve().parents[1]
SEED = ('constant_rate', 'ar_increment')


def device() -> dict:
    """Return the parameters of config/adis16350.yaml."""
    return yaml.safe_load((HERE / 'config' / 'adis16350.yaml').read_text())['/**'][
        'ros__parameters'
    ]


def static(d: dict, rate: float, seed: int, runs: int) -> np.ndarray:
    """Return records at rest, deg/s, (n, runs): AR(1) noise, a slow drift of bias, the mean."""
    n = int(d['seconds'] * rate)
    rng = np.random.default_rng(seed)
    phi, total, drift = d['phi'], d['static_std_deg_s'], d['bias_instability_deg_s']
    drive = np.sqrt((total**2 - drift**2) * (1 - phi**2)) * rng.standard_normal((n + 100, runs))
    noise = lfilter([1], [1, -phi], drive, axis=0)[100:]
    keep = np.exp(-1 / (rate * 100.0))
    wander = lfilter(
        [1], [1, -keep], drift * np.sqrt(1 - keep**2) * rng.standard_normal((n, runs)), axis=0
    )
    return noise + wander + d['static_mean_deg_s']


def seed_values(p: dict) -> dict:
    """Return the paper's filter in SI."""
    return {name: p[name] for name in ('white', 'ar_increment')}


def errors(p, z, truth, rate, motion=SEED, alpha=1.0, values=None):
    """
    Return (mean, std, mean magnitude) of the error before and after, and the filtered rates.

    All in deg/s.

    """
    chosen = design(motion, values=values or seed_values(p), alpha=alpha, axes=z.shape[1])
    t = np.arange(len(z)) / rate
    y = filter_record(t, z * DEG, chosen, rate).rate / DEG
    return _figures(z - truth), _figures(y - truth), y


def _figures(e):
    """
    Return mean, std and mean magnitude (about the mean) of errors (n, runs).

    Of each the mean over the runs.

    """
    return (float(np.mean(e.mean(axis=0))), float(np.mean(e.std(axis=0))),
            float(np.mean(np.abs(e - e.mean(axis=0)))))


def table(title, head, rows):
    """Print one table: before and after."""
    print(f'\n{title}\n  {head:>16s} {"before":>10s} {"after":>10s} {"after/before":>13s}')
    for name, before, after in rows:
        print(f'  {name:>16s} {before:10.4f} {after:10.4f} {abs(after / before):13.3f}')


def rocking(amplitude, period, rate, n):
    """Return the rate (deg/s) of rocking by an amplitude (deg) at a period (s), (n, 1)."""
    t = np.arange(n) / rate
    w = 2 * np.pi / period
    return (amplitude * w * np.cos(w * t))[:, None]


def experiments(p: dict, runs: int = 8, seed: int = 2010) -> dict:
    """
    Run all experiments.

    Returns {'static': ..., 'constant': {rate: ...}, (rate_hz, alpha): {amplitude: (before,
    after)}}.

    """
    d, paper = p['device'], p['paper']
    out: dict = {'runs': runs}
    rest = static(d, 100.0, seed, runs)
    out['rest'] = rest
    out['static'] = errors(p, rest, 0 * rest, 100.0)
    out['constant'] = {
        w: errors(p, rest + w, 0 * rest + w, 100.0) for w in paper['constant_rates_deg_s']
    }
    fast = static(d, 1000.0, seed + 1, runs)
    for rate, record, alphas in ((100.0, rest, (1.0, *paper['fading'])), (1000.0, fast, (1.0,))):
        for alpha in alphas:
            out[rate, alpha] = {}
            for a in paper['rocking_deg']:
                truth = rocking(a, paper['rocking_period_s'], rate, len(record))
                out[rate, alpha][a] = errors(
                    p, record + truth, truth + 0 * record, rate, alpha=alpha
                )
    return out


def cure(p: dict, rest: np.ndarray) -> dict:
    """
    Run the loop on rocking; return what it said and the error at every rung, by amplitude.

    The model is the paper's, as stated; the loop sees one record and never the truth. ``std`` is
    against the truth, deg/s, ``lost`` what the loop sees of it, nats a sample, ``said`` (verdict,
    first names) of the diagnosis of that rung.

    """
    paper = p['paper']
    rungs = ((), ('angular_acceleration',), ('angular_acceleration', 'harmonic'), ('harmonic',))
    out: dict = {rung: {'std': [], 'lost': [], 'said': []} for rung in rungs}
    out['beside'] = {'no filter': [], 'alpha 0.7': [], 'default (auto)': []}
    for a in paper['rocking_deg']:
        truth = rocking(a, paper['rocking_period_s'], 100.0, len(rest))
        z, truth = rest + truth, truth + 0 * rest
        (_, before, _), (_, faded, _), _ = errors(p, z, truth, 100.0, alpha=0.7)
        out['beside']['no filter'].append(before)
        out['beside']['alpha 0.7'].append(faded)
        out['beside']['default (auto)'].append(errors(p, z, truth, 100.0, motion='auto')[1][1])
        problem = FilterProblem((z[:, 0] - rest.mean()) * DEG, 0.01, stated=seed_values(p))
        for rung in rungs:
            study = Study.begin({'gyro_x': problem}, model_of('filter', START))
            for name in rung:
                study.add([name])
            state, found = study.states['gyro_x'], study.diagnose()['gyro_x']
            values = {**seed_values(p), **{k: dict(state.model[k].values) for k in rung}}
            row = out[rung]
            row['std'].append(errors(p, z, truth, 100.0, (*SEED, *rung), values=values)[1][1])
            row['lost'].append(state.summary['nats_per_sample'])
            row['said'].append((found.verdict, [f.name for f in found.ranked[:2]]))
    return out


def report(p: dict, r: dict) -> None:
    """Print chain, tables and what differs."""
    d, paper = p['device'], p['paper']
    print(
        f'{d["name"]}: {d["seconds"]:.0f} s at rest, {d["rate_hz"]:.0f} Hz, simulated; means of'
        f' {r["runs"]} records, deg/s'
    )
    chain = ar.chain(r['rest'][:, 0])
    print('\nPreprocessing (one record)')
    for line in chain.lines():
        print('  ' + line)
    print(
        f'  paper: u = {paper["u"]}, AR(1), phi = {d["phi"]}, residual'
        f' {paper["residual_autocorrelation"]}, with the series'
        f' {paper["residual_cross_correlation"]}'
    )
    (m0, s0, _), (m1, s1, _), _ = r['static']
    print(
        f'\nStatic: std {s0:.4f} -> {s1:.4f} (paper {paper["static_std_deg_s"][0]} ->'
        f' {paper["static_std_deg_s"][1]}), mean {m0:+.4f} -> {m1:+.4f} (paper'
        f' {paper["static_mean_deg_s"][0]} -> {paper["static_mean_deg_s"][1]})'
    )
    print(
        '  The mean stays: the filter has gain one at zero frequency, and a bias cannot be told'
        ' from rotation by a'
    )
    print(
        '  gyroscope alone. The paper\'s smaller mean can come from the start of its filter, not'
        ' from its steady state.'
    )
    print(
        '  Simulated noise is AR(1) with the paper\'s phi, which has 1.24 times the power of white'
        ' noise at low frequency:'
    )
    print('  hence 0.098; white noise of the same std gives 0.086.')
    print(
        'Constant rate: std after '
        + ', '.join(f'{w:g}: {e[1][1]:.4f}' for w, e in r['constant'].items())
        + '  (paper: same as static)'
    )
    for number, key, what in (
        (1, 100.0, 'mean'),
        (2, 100.0, 'std'),
        (3, 1000.0, 'mean'),
        (4, 1000.0, 'std'),
    ):
        where = f'in rocking, period {paper["rocking_period_s"]:g} s, {key:g} Hz, deg/s'
        for k, name in ((0, 'mean'), (2, 'mean magnitude')) if what == 'mean' else ((1, 'std'),):
            table(f'Table {number}: {name} of the error {where}', 'amplitude, deg',
                  [(f'{a:g}', e[0][k], e[1][k]) for a, e in r[key, 1.0].items()])
    for number, what in ((5, 'mean'), (6, 'std')):
        for k, name in ((0, 'mean'), (2, 'mean magnitude')) if what == 'mean' else ((1, 'std'),):
            print(
                f'\nTable {number}: {name} of the error in rocking with fading memory, 100 Hz,'
                ' deg/s'
            )
            print(f'  {"amplitude, deg":>16s} {"before":>10s}'
                  + ''.join(f'{"alpha " + str(a):>11s}' for a in (1.0, *paper['fading'])))
            for a in paper['rocking_deg']:
                print(f'  {a:16g} {r[100.0, 1.0][a][0][k]:10.4f}'
                      + ''.join(f'{r[100.0, f][a][1][k]:11.4f}' for f in (1.0, *paper['fading'])))
    print(
        '\nThe mean is that of the error about the record\'s own mean, signed and in magnitude:'
        ' the signed mean of rocking is'
    )
    print(
        'zero but for its start, so what the paper says of "the mean" is compared with the'
        ' magnitude.'
    )
    print('\nTrends that the paper states')
    for good, said, measured in trends(r, paper):
        print(f'  {"as stated" if good else "DIFFERS  "}  {said}: {measured}')


def trends(r: dict, paper: dict) -> list[tuple[bool, str, str]]:
    """Return (whether it holds, what is stated, what was measured)."""
    def std(key):
        return np.array([e[1][1] for e in r[key].values()])

    def size(key):
        return np.array([e[1][2] for e in r[key].values()])

    slow, fast = std((100.0, 1.0)), std((1000.0, 1.0))
    before, s1 = r['static'][0][1], r['static'][1][1]
    constant = np.array([e[1][1] for e in r['constant'].values()])
    fading = np.array([std((100.0, a)) for a in paper['fading']])
    means = np.array([size((100.0, a)) for a in paper['fading']])
    spread = fading.max(axis=1) / fading.min(axis=1)

    def shown(values, digits=3):
        return ' '.join(f'{v:.{digits}f}' for v in values)

    return [
        (
            bool(0.8 < s1 / paper['static_std_deg_s'][1] < 1.25),
            'static std falls from 0.635 to 0.087',
            f'{before:.3f} to {s1:.3f}',
        ),
        (
            bool(np.all(np.abs(constant / s1 - 1) < 0.01)),
            'a constant rate changes nothing',
            shown(constant, 4),
        ),
        (bool(np.all(np.diff(slow) > 0)), 'std grows with the amplitude at 100 Hz', shown(slow)),
        (
            bool(np.all(np.diff(size((100.0, 1.0))) > 0)),
            'so does the mean',
            shown(size((100.0, 1.0))),
        ),
        (
            bool(slow[-1] > before),
            'and the filter no longer serves',
            f'{slow[-1]:.2f} after, {before:.3f} before',
        ),
        (bool(np.all(fast < 0.5 * slow)), 'at 1000 Hz the std falls clearly', shown(fast)),
        (
            bool(np.all(size((1000.0, 1.0)) < 0.5 * size((100.0, 1.0)))),
            'and so does the mean',
            shown(size((1000.0, 1.0))),
        ),
        (
            bool(fast.max() / fast.min() < 1.5),
            'to a steady low level',
            (
                f'largest/smallest {fast.max() / fast.min():.1f}, 100 Hz'
                f' {slow.max() / slow.min():.0f} (q per step kept: still a lag)'
            ),
        ),
        (
            bool(np.all(np.diff(spread) < 0)),
            'with smaller alpha the std steadies over the amplitudes',
            'largest/smallest ' + shown(spread, 2),
        ),
        (
            bool(np.all(np.diff(fading[:, 0]) > 0)),
            'while its value rises (smallest amplitude)',
            shown(fading[:, 0]),
        ),
        (
            bool(np.all(np.diff(means[:, -1]) < 0)),
            'the mean falls with alpha for large amplitudes',
            shown(means[:, -1]),
        ),
        (
            bool(0 < np.argmin(means[:, 1]) < 3),
            (
                'the mean is least at an alpha between for small ones (paper 0.7; here, at 15'
                f' deg, {paper["fading"][int(np.argmin(means[:, 1]))]})'
            ),
            shown(means[:, 1]),
        ),
    ]


def figures(p: dict, r: dict, found: dict, folder: Path) -> list[Path]:
    """Draw Figures 1-5 and the cure; return the files."""
    from imu_noise_tools.plots import filter as plots
    from imu_noise_tools.plots.style import new_figure, png
    import paper_pictures as pictures
    paper, rest = p['paper'], r['rest']
    t = np.arange(len(rest)) / 100.0
    folder.mkdir(parents=True, exist_ok=True)
    out = []

    def save(name, figure):
        path = folder / f'{name}.png'
        path.write_bytes(png(figure))
        out.append(path)

    def axes(width=8.0, height=3.2, bottom=0.15):
        figure = new_figure(width, height)
        return figure, figure.add_axes((0.09, bottom, 0.89, 0.92 - bottom))

    figure = new_figure(8.0, 5.6)
    grid = figure.add_gridspec(2, 1, left=0.09, right=0.98, top=0.94, bottom=0.09, hspace=0.45)
    ax = plots.dress(
        figure.add_subplot(grid[0]), 'Figure 1: output at rest', 'time, s', 'rate, °/s'
    )
    ax.plot(t, rest[:, 0], color=plots.MEASURED, linewidth=0.4)
    plots.correlation(
        figure.add_subplot(grid[1]),
        ar.residual(rest[:, 0], ar.yule_walker(rest[:, 0], 1)[0]),
        title='residual of AR(1): autocorrelation',
    )
    save('figure_1', figure)

    def errors_figure(name, title, truth, result, alpha=1.0):
        figure, ax = axes()
        pictures.error_before_after(
            ax, t, (rest + truth - truth)[:, 0] * DEG, (result[2] - truth)[:, 0] * DEG, title
        )
        save(name, figure)

    errors_figure('figure_2', 'Figure 2: at rest', 0 * rest, r['static'])
    errors_figure('figure_3', 'Figure 3: at 10 °/s', 0 * rest + 10, r['constant'][10.0])
    truth = rocking(50.0, paper['rocking_period_s'], 100.0, len(rest)) + 0 * rest
    errors_figure(
        'figure_4', 'Figure 4: rocking by 50° at 10 s, 100 Hz', truth, r[100.0, 1.0][50.0]
    )
    errors_figure(
        'figure_5', 'Figure 5: rocking by 50° at 10 s, 100 Hz, α = 0.7', truth, r[100.0, 0.7][50.0]
    )
    figure = new_figure(9.0, 3.9)
    pictures.ladder_by_amplitude(figure, paper['rocking_deg'], {
        'constant_rate + ar_increment, the paper\'s': found[()],
        '+ angular_acceleration': found['angular_acceleration',],
        '+ harmonic': found['angular_acceleration', 'harmonic']}, found['beside']['no filter'][0])
    save('rocking', figure)
    return out


def main() -> int:
    """Run all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('-o', '--output', type=Path, help='draw the figures into this folder')
    args = parser.parse_args()
    p = device()
    r = experiments(p)
    report(p, r)
    found = cure(p, r['rest'])
    amplitudes = p['paper']['rocking_deg']
    print('\nThe missing effect: what the innovations say, 100 Hz, rung by rung')
    for rung, row in found.items():
        if rung == 'beside':
            continue
        print('  ' + ' + '.join(('the paper\'s model', *rung)))
        for a, (verdict, names), lost in zip(amplitudes, row['said'], row['lost']):
            print(f'    {a:6g} deg: lost {lost:9.4f} nats a sample; {verdict} {", ".join(names)}')
    print('and what adding does: std of the error, deg/s')
    print(f'  {"amplitude, deg":>42s}' + ''.join(f'{a:10g}' for a in amplitudes))
    rows = {**found['beside'], **{' + '.join(('paper\'s', *k)): v['std']
                                  for k, v in found.items() if k != 'beside'}}
    for name, row in rows.items():
        print(f'  {name:>42s}' + ''.join(f'{v:10.4f}' for v in row))
    if args.output:
        for path in figures(p, r, found, args.output):
            print(path)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
