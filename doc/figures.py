# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The plots of the theory, drawn with the code that they are about.

generate.py draws them at each build; ``python doc/figures.py`` does so alone. Each function below
draws the figure of its name.

"""

from __future__ import annotations

from pathlib import Path
import sys

import numpy as np

from imu_noise_tools.calibration.solve import ols
from imu_noise_tools.core import spectrum
from imu_noise_tools.core.allan import cluster_sizes, curve
from imu_noise_tools.core.units import DEG, G0
from imu_noise_tools.loop import verdict
from imu_noise_tools.loop.effect import find_effect, Model
from imu_noise_tools.noise.behind import model_avar, model_psd
from imu_noise_tools.noise.ends import without_ends
from imu_noise_tools.plots.style import (
    AXES, CHANCE, dress, EFFECTS, FAIL, GOOD, label_lines, log_scale, MEASURED, MODEL, new_figure,
    SMALL)
from imu_noise_tools.simulate import simulate

OUT = Path(__file__).resolve().parent / 'generated'
HOUR = DEG / 3600
SENSOR = {'white': {'N': 8.7e-5}, 'flicker': {'B': 2.4e-5}, 'random_walk': {'K': 4e-6}}


def model_of(**values) -> Model:
    """Return a model of noise effects with values."""
    return Model(find_effect('noise', name)(own) for name, own in values.items())


def record(seed: int = 4, rate: float = 10.0, duration: float = 7200.0, **more) -> np.ndarray:
    """Return one simulated gyroscope axis, rad/s."""
    spec = {'rate_hz': rate, 'duration_s': duration, 'seed': seed,
            'targets': {'gyro_x': {**SENSOR, **more}}}
    return simulate(spec)[0].gyro[:, 0]


def reading_a_curve():
    """Draw an Allan deviation, its three lines and the points where they are read."""
    c, model = curve(record(), 0.1), model_of(**SENSOR)
    figure = new_figure(7, 4.4)
    ax = dress(figure.add_subplot(), 'Allan deviation of a simulated gyroscope, 2 h',
               'averaging time τ, s', 'Allan deviation, °/h')
    ax.fill_between(c.tau, c.lo / HOUR, c.hi / HOUR, color=MEASURED, alpha=0.15, linewidth=0)
    ax.plot(c.tau, c.dev / HOUR, color=MEASURED, linewidth=1.6, label='measured, 95 % band')
    ax.plot(c.tau, np.sqrt(model_avar(model, c.m, 0.1)) / HOUR, color=MODEL, linewidth=1.4,
            label='sum of the three')
    lines = []
    for effect, colour in zip(model, EFFECTS):
        own = np.sqrt(effect.avar(c.m, 0.1)) / HOUR
        ax.plot(c.tau, own, '--', color=colour, linewidth=1.2)
        lines.append((c.tau, own, effect.name, colour))
    reads = (('N at 1 s', 1.0, SENSOR['white']['N'], 0),
             ('0.664 B', 200.0, SENSOR['flicker']['B'] * np.sqrt(2 * np.log(2) / np.pi), 1),
             ('K at 3 s', 3.0, SENSOR['random_walk']['K'], 2))
    log_scale(ax.xaxis, 0.1, 3000)
    log_scale(ax.yaxis, 0.3, 100)
    for name, tau, value, k in reads:
        ax.plot([tau], [value / HOUR], 'o', markerfacecolor='white', color=EFFECTS[k])
        ax.annotate(name, (tau, value / HOUR), xytext=(9, -4 if k == 2 else 7),
                    textcoords='offset points',
                    fontsize=SMALL, fontweight='bold', color=EFFECTS[k])
    label_lines(ax, lines, avoid=[(c.tau, c.dev / HOUR)])
    ax.legend(fontsize=SMALL, frameon=False)
    return figure


def shapes():
    """Draw what each of some effects does to curve and spectrum beside white noise."""
    some = {
        'quantization': {'Q': 1.2e-5}, 'random_walk': {'K': 3e-6},
        'gauss_markov': {'sigma': 8e-5, 'tc': 10.0},
        'sinusoid': {'amplitude': 3e-4, 'frequency': 0.2}}
    dt, n = 0.01, 720_000
    m = cluster_sizes(n, 160)
    f = np.geomspace(1 / (n * dt), 0.5 / dt, 1500)
    white = model_of(white={'N': 8.7e-5})
    figure = new_figure(10, 5.2)
    for k, (name, values) in enumerate(some.items()):
        effect = find_effect('noise', name)(values)
        both = Model([*white, effect])
        y = 'Allan deviation, °/h' if k == 0 else ''
        top = dress(figure.add_subplot(2, 4, k + 1), name, 'τ, s', y)
        top.plot(m * dt, np.sqrt(model_avar(white, m, dt)) / HOUR, '--', color=EFFECTS[0])
        top.plot(m * dt, np.sqrt(model_avar(both, m, dt)) / HOUR, color=MODEL)
        log_scale(top.xaxis, dt, 3000, most=3)
        log_scale(top.yaxis, 0.2, 500)
        low = dress(figure.add_subplot(2, 4, k + 5), '', 'f, Hz', 'density, °/√h' * (not k))
        unit = DEG / 60
        low.plot(f, np.sqrt(model_psd(white, f, dt) / 2) / unit, '--', color=EFFECTS[0])
        if hasattr(effect, 'lines'):
            low.axvline(values['frequency'], color=MODEL)
        else:
            low.plot(f, np.sqrt(model_psd(both, f, dt) / 2) / unit, color=MODEL)
        log_scale(low.xaxis, f[0], f[-1], most=3)
        log_scale(low.yaxis, 0.1, 30)
    figure.subplots_adjust(left=0.07, right=0.99, top=0.93, bottom=0.1, hspace=0.5, wspace=0.3)
    return figure


def cosines_do_not_leak():
    """Draw periodogram and cosine power of one strong random walk beside its spectrum."""
    n, dt = 4096, 0.1
    walk = {'random_walk': {'K': 1e-3}, 'white': {'N': 1e-5}}
    bins = spectrum.bins_of(n, dt)
    fourier, cosine = np.zeros(n // 2), np.zeros(len(bins.first))
    for seed in range(20):
        y = simulate({'rate_hz': 1 / dt, 'duration_s': n * dt, 'seed': seed,
                      'targets': {'gyro_x': walk}})[0].gyro[:, 0]
        fourier += 2 * dt / n * np.abs(np.fft.rfft(y - y.mean())[1:]) ** 2 / 20
        cosine += spectrum.power(spectrum.cosine_transform(y), dt, bins) / 20
    f = np.fft.rfftfreq(n, dt)[1:]
    figure = new_figure(7, 4)
    ax = dress(figure.add_subplot(), 'A random walk of 410 s: mean of 20 records', 'frequency, Hz',
               'PSD, (rad/s)²/Hz')
    ax.plot(f, fourier, color=AXES['y'], linewidth=1, label='Fourier periodogram: leaks')
    ax.plot(bins.f, cosine, color=AXES['x'], linewidth=1, label='cosine transform')
    ax.plot(f, model_psd(model_of(**walk), f, dt), '--', color=MEASURED, linewidth=1.2,
            label='the spectrum of the model')
    log_scale(ax.xaxis, f[0], f[-1])
    log_scale(ax.yaxis, 1e-10, 1e-1)
    ax.legend(fontsize=SMALL, frameon=False)
    return figure


def what_the_ends_leak():
    """Draw the cosine power of counts of an angle, as it is and without what its ends leak."""
    n, dt = 60_000, 0.02
    noise = {'quantization': {'Q': 2e-4}, 'white': {'N': 3e-6}}
    bins = spectrum.bins_of(n, dt)
    seen, left = np.zeros((2, len(bins.first)))
    for seed in range(40):
        y = simulate({'rate_hz': 1 / dt, 'duration_s': n * dt, 'seed': seed,
                      'targets': {'gyro_x': noise}})[0].gyro[:, 0]
        c = spectrum.cosine_transform(y - y.mean())
        seen += spectrum.power(c, dt, bins) / 40
        left += spectrum.power(without_ends(c, bins), dt, bins) / 40
    figure = new_figure(7, 4)
    ax = dress(figure.add_subplot(), 'Counts of an angle, 20 min at 50 Hz: mean of 40 records',
               'frequency, Hz', 'PSD, (rad/s)²/Hz')
    ax.plot(bins.f, seen, color=AXES['y'], linewidth=1, label='cosine transform')
    ax.plot(bins.f, left, color=AXES['x'], linewidth=1, label='without what the ends leak')
    ax.plot(bins.f, model_psd(model_of(**noise), bins.f, dt), '--', color=MEASURED,
            linewidth=1.2, label='the spectrum of the model')
    log_scale(ax.xaxis, bins.f[0], bins.f[-1])
    log_scale(ax.yaxis, 1e-12, 1e-4)
    ax.legend(fontsize=SMALL, frameon=False)
    return figure


def chance():
    """Draw how an error on data not fitted scatters under a true model, with the thresholds."""
    std = 0.055
    x = np.linspace(-3, 6, 400) * std
    p = np.array([verdict.tail(v, std) for v in x])
    figure = new_figure(7, 3.4)
    ax = dress(figure.add_subplot(), '', 'error on data not fitted (held-out deviance)',
               'chance of a larger one')
    ax.axvspan(x[0], verdict.CHANCE * std, color=CHANCE)
    ax.plot(x, p, color=MEASURED)
    ax.axhline(verdict.HELD_OUT_LEVEL, color=FAIL, linestyle='--', linewidth=1)
    fails = x[np.argmax(p < verdict.HELD_OUT_LEVEL)]
    ax.axvline(fails, color=FAIL, linestyle='--', linewidth=1)
    ax.text(fails + 0.04 * std, 0.2, 'fails', color=FAIL, fontsize=SMALL)
    ax.text(-1.2 * std, 4e-4, 'within chance', color=GOOD, fontsize=SMALL)
    log_scale(ax.yaxis, 1e-4, 1.0)
    ax.set_xlim(x[0], x[-1])
    return figure


def tilted_faces():
    """Draw what a tilt of the faces does to plain least squares: bias and scale, rms."""
    rng = np.random.default_rng(1)
    faces = np.vstack([np.eye(3), -np.eye(3)])
    tilts = np.array([0.1, 0.2, 0.5, 1, 2, 5])
    errors = []
    for tilt in np.radians(tilts):
        own = []
        for _ in range(300):
            ups = faces + tilt * rng.normal(size=faces.shape) * (faces == 0)
            ups /= np.linalg.norm(ups, axis=1)[:, None]
            # the true sensor is perfect, and is told that every face was level
            found = ols(G0 * ups.T, np.vstack([G0 * faces.T, np.ones(6)]))
            own.append([np.mean(found[:, 3] ** 2),
                        np.mean((np.diag(found[:, :3]) - 1) ** 2)])
        errors.append(np.sqrt(np.mean(own, axis=0)))
    bias, scale = np.array(errors).T
    figure = new_figure(7, 3.4)
    for k, (values, name) in enumerate(((bias, 'bias error, m/s²'), (1e6 * scale, 'scale error, '
                                                                     'ppm'))):
        ax = dress(figure.add_subplot(1, 2, k + 1), '', 'tilt of each face, degrees rms', name)
        ax.plot(tilts, values, 'o-', color=AXES['x'])
        log_scale(ax.xaxis, 0.08, 6)
        log_scale(ax.yaxis, values.min() / 2, values.max() * 2)
    figure.subplots_adjust(left=0.1, right=0.98, bottom=0.14, wspace=0.3)
    return figure


FIGURES = (reading_a_curve, shapes, cosines_do_not_leak, what_the_ends_leak, chance, tilted_faces)


def main() -> int:
    """Draw all of them, each where what it is drawn with has changed."""
    import matplotlib
    matplotlib.rcParams['svg.hashsalt'] = 'the same bytes for the same figure'
    OUT.mkdir(exist_ok=True)
    newest = max(Path(m.__file__).stat().st_mtime for name, m in list(sys.modules.items())
                 if name.startswith('imu_noise_tools') and getattr(m, '__file__', None))
    newest = max(newest, Path(__file__).stat().st_mtime)
    for draw in FIGURES:
        path = OUT / f'{draw.__name__}.svg'
        if not path.exists() or path.stat().st_mtime < newest:
            draw().savefig(path, metadata={'Date': None}, bbox_inches='tight')
    return 0


if __name__ == '__main__':
    sys.exit(main())
