"""Pictures of one noise model beside the measurement: Allan deviation, spectrum, course in time, distribution."""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from .. import units
from ..allan import interval
from ..noise import views
from ..noise.kinds import Inputs, Line, Mean
from ..study import Diagnosis, State
from .curves import Curves, curves, line_envelope, NOTABLE, readings, runs
from .style import (AXES, dress, EFFECTS, FAIL, FAINT, label_lines, log_scale, MEASURED, MODEL, readable, SMALL)

_SHOWN = {'gyro': (units.DEG, 'deg/s'), 'accel': (1.0, 'm/s^2')}          # time series
_DENSITY = {'gyro': (units.DEG, 'deg/s/sqrt(Hz)'), 'accel': (1e-6 * units.G0, 'ug/sqrt(Hz)')}

RARE = 3.29           # standard errors that one point of a thousand exceeds by chance


def suspected(diagnosis: Diagnosis | None) -> str:
    """Return what a diagnosis suspects, in a few words for a picture; empty where it suspects nothing."""
    if diagnosis is None or diagnosis.verdict == 'complete':
        return ''
    if diagnosis.verdict == 'unknown' or not diagnosis.ranked:
        return 'something unknown'
    if diagnosis.verdict == 'missing':
        return diagnosis.ranked[0].name
    rivals = [f.name for f in diagnosis.ranked if f.gain > f.penalty][:2]
    return ' or '.join(rivals) + '?' if rivals else ''


def allan(ax, state: State, found: Curves | None = None, title: str | None = None):
    """
    Draw the measured Allan deviation with its 95 % band, the model, each effect's own line and where it is read.

    Parameters
    ----------
    ax : Axes
    state : State
        Of a noise study.
    found : Curves or None
        What :func:`curves` gave, where it is at hand.

    """
    e, c = state.problem.evidence, state.problem.evidence.curve
    factor, unit = units.field('{rate}', e.sensor)
    found = found or curves(state)
    dress(ax, e.axis if title is None else title, y=f'Allan deviation, {readable(unit)}')
    low, high = c.dev.min() / factor, c.hi.max() / factor
    marks = readings(state, found) if found else []
    low = min([low / 2.5, *(0.6 * r.sigma / factor for r in marks if r.sigma / factor > low / 15)])
    log_scale(ax.xaxis, c.tau[0], c.tau[-1] * 1.05)
    log_scale(ax.yaxis, low, high * 1.6)
    ax.fill_between(c.tau, c.lo / factor, c.hi / factor, color=MEASURED, alpha=0.16, linewidth=0)
    ax.plot(c.tau, c.dev / factor, color=MEASURED, linewidth=1.6)
    if found:
        lines = _effect_lines(ax, state, found, factor)
        ax.plot(c.tau, np.sqrt(found.model) / factor, color=MODEL, linewidth=1.5)
        _reading_marks(ax, state, marks, factor, low)
        label_lines(ax, lines, [(c.tau, c.dev / factor), *(([r.tau], [r.sigma / factor]) for r in marks)])
    return ax


def _colour(state, label):
    return EFFECTS[state.model.labels.index(label) % len(EFFECTS)]


def _effect_lines(ax, state, found, factor):
    c = state.problem.evidence.curve
    lines = []
    for label, v in found.each.items():
        effect = state.model[label]
        if isinstance(effect, Line):
            v = line_envelope(effect, c.m, c.dt)
        y = np.sqrt(np.maximum(v, 1e-300)) / factor
        seen = _observable(state, label)
        ax.plot(c.tau, y, '--', color=_colour(state, label), linewidth=1.1, alpha=1 if seen else 0.45)
        lines.append((c.tau, y, label if seen else f'{label}: not observable', _colour(state, label)))
    return lines


def _observable(state, label):
    effect, estimates = state.model[label], state.fit.estimates.get(label, {})
    return all(estimates[p.name].value is not None for p in effect.parameters if p.amplitude and p.name in estimates)


def _reading_marks(ax, state, marks, factor, low):
    for r in marks:
        y = r.sigma / factor
        if not r.observable or y < low or not ax.get_xlim()[0] <= r.tau <= ax.get_xlim()[1]:
            continue
        colour = _colour(state, r.label)
        ax.plot([r.tau], [y], 'o', markersize=6, markerfacecolor='white', markeredgecolor=colour, markeredgewidth=1.6, zorder=7)
        ax.annotate(r.symbol, (r.tau, y), xytext=(6, 5), textcoords='offset points', fontsize=SMALL,
                    fontweight='bold', color=colour, zorder=7)


def pulls(ax, x, pull, label: str = '', xlabel: str = 'averaging time τ, s'):
    """Draw pulls (standard errors) against x (log), those beyond 2 filled, runs of them shaded and the worst labelled."""
    x, pull = np.asarray(x), np.asarray(pull)
    dress(ax, x=xlabel, y='pull')
    top = float(np.clip(1.15 * np.max(np.abs(pull), initial=0.0), 4, 12))
    shown = np.clip(pull, -top, top)
    log_scale(ax.xaxis, x[0], x[-1] * 1.05)
    ax.set_ylim(-top, top)
    tick = 2 if top < 5 else 4 if top < 9 else 10
    ax.set_yticks([-tick, 0, tick])
    ax.axhspan(-NOTABLE, NOTABLE, color='#eef1f3', linewidth=0)
    for sign in (1, -1):
        ax.fill_between(x, sign * NOTABLE, shown, where=sign * shown > NOTABLE, interpolate=True, color=FAIL, alpha=0.55, linewidth=0)
    ax.plot(x, shown, color=MEASURED, linewidth=1.0)
    marked = runs(pull)
    shade(ax, x, marked)
    if marked and label:
        a, b = max(marked, key=lambda r: float(np.sum(pull[r[0]:r[1]] ** 2)))
        middle = float(np.sqrt(x[a] * x[b - 1]))
        where = np.log(middle / x[0]) / np.log(x[-1] / x[0])
        side = 'left' if where < 0.25 else 'right' if where > 0.75 else 'center'
        at = {'left': x[a], 'right': x[b - 1], 'center': middle}[side]
        ax.text(at, 0.06 if np.mean(pull[a:b]) > 0 else 0.94, label, transform=ax.get_xaxis_transform(), fontsize=SMALL,
                fontweight='bold', color=FAIL, ha=side, va='bottom' if np.mean(pull[a:b]) > 0 else 'top')
    return ax


def shade(ax, x, marked):
    """Shade stretches of x, given as [begin, end) indices."""
    edges = np.sqrt(x[1:] * x[:-1])                       # half-way to the neighbours
    edges = np.concatenate([x[:1], edges, x[-1:]])
    for a, b in marked:
        ax.axvspan(edges[a], edges[b], color=FAIL, alpha=0.10, linewidth=0)
    return ax


def psd(ax, state: State):
    """Draw the measured noise density in bins with its 95 % band, the model, each effect's line, and the lines found."""
    e = state.problem.evidence
    factor, unit = _DENSITY[e.sensor]
    bins, f = e.whole.bins, e.whole.bins.f
    detail = state.fit.details
    left = [i for i in views.lines_left(e, state.model)]
    power = e.whole.power + (e.whole.lines[left].sum(axis=0) if left else 0)

    def density(s):
        return np.sqrt(np.maximum(s, 1e-300) / 2) / factor

    mid, level, weight = _rebinned(f, e.whole.power, bins.count)
    lo, hi = interval(density(level), weight)
    dress(ax, f'{e.axis}: spectrum', 'frequency, Hz', f'noise density (two-sided), {readable(unit)}')
    every = [density(level), density(detail['v'])]
    log_scale(ax.xaxis, f[0], f[-1] * 1.05)
    log_scale(ax.yaxis, min(v.min() for v in every) / 3, max(max(v.max() for v in every), density(power).max()) * 2)
    ax.plot(f, density(power), '.', color=FAINT, markersize=2.0, alpha=0.5, rasterized=True)
    ax.fill_between(mid, lo, hi, color=MEASURED, alpha=0.16, linewidth=0)
    ax.plot(mid, density(level), color=MEASURED, linewidth=1.5)
    lines = []
    for label, v in detail['each'].items():
        ax.plot(f, density(v), '--', color=_colour(state, label), linewidth=1.1, alpha=1 if _observable(state, label) else 0.45)
        lines.append((f, density(v), label, _colour(state, label)))
    ax.plot(f, density(detail['v']), color=MODEL, linewidth=1.5)
    label_lines(ax, lines, [(mid, density(level))])
    _name_lines(ax, e, left, density(power))
    return ax


def _name_lines(ax, e, left, density):
    for i in left[:3]:
        at = e.line_table[i, 0]
        top = density[e.whole.bins.index(max(1, int(round(2 * e.duration * at))))]
        ax.plot([at, at], [ax.get_ylim()[0], top], color=FAIL, linewidth=1.0)
        ax.annotate(f'{at:.4g} Hz', (at, top), xytext=(0, 6), textcoords='offset points', ha='center', fontsize=SMALL, color=FAIL,
                    fontweight='bold')


def _rebinned(f, power, count, per_decade=10):
    group = np.floor(np.log10(f / f[0]) * per_decade).astype(int)
    starts = np.flatnonzero(np.diff(np.concatenate([[-1], group])))
    w = np.add.reduceat(count.astype(float), starts)
    return (np.exp(np.add.reduceat(np.log(f) * count, starts) / w), np.add.reduceat(power * count, starts) / w, w)


def series(ax, state: State, left_out=(), colour: str | None = None, xlabel: bool = True):
    """Draw the time series: smallest to largest sample of each column, block means, what the model says of the mean."""
    e = state.problem.evidence
    factor, unit = _SHOWN[e.sensor]
    t, lo, hi = e.envelope.T
    mean = float(np.mean(e.slow_y))
    scale, word = (3600.0, 'h') if e.duration > 2 * 3600 else (60.0, 'min') if e.duration > 300 else (1.0, 's')
    dress(ax, f'{e.axis}, less its mean {mean / factor:.5g} {readable(unit)}', f'time, {word}' if xlabel else '', readable(unit))
    ax.fill_between(t / scale, (lo - mean) / factor, (hi - mean) / factor, color=colour or AXES[e.axis[-1]], alpha=0.45, linewidth=0)
    blocks = min(256, len(e.slow_y))
    per = len(e.slow_y) // blocks
    slow = e.slow_y[:blocks * per].reshape(blocks, per).mean(axis=1)
    slow_t = e.slow_t[:blocks * per].reshape(blocks, per).mean(axis=1)
    ax.plot(slow_t / scale, (slow - mean) / factor, color=MEASURED, linewidth=1.0)
    means = state.model.of(Mean)
    if means:
        inputs = Inputs(e.slow_t, e.dt, e.slow_others)
        known = sum(m.mean(inputs) for m in means)
        ax.plot(e.slow_t / scale, (known - np.mean(known)) / factor, color=MODEL, linewidth=1.2)
    for begin, end, *_ in left_out:
        ax.axvspan(begin / scale, end / scale, color=FAINT, alpha=0.3, linewidth=0)
    ax.set_xlim(0, e.duration / scale)
    return ax


def in_time(ax, state: State):
    """Draw the power of the noise in time beside its mean over the record, with what chance allows."""
    e = state.problem.evidence
    t, x, w = views.power_in_time(e, state.model, groups=1)
    lo, hi = (np.sqrt(norm_power) for norm_power in _chance_of_power(w[0]))
    scale, word = (3600.0, 'h') if e.duration > 2 * 3600 else (60.0, 'min') if e.duration > 300 else (1.0, 's')
    dress(ax, f'{e.axis}: loudness in time', f'time, {word}', 'rms / mean rms')
    level = np.sqrt(x[:, 0])
    ax.axhspan(lo, hi, color='#dfe5e9', linewidth=0)
    ax.plot(t / scale, level, color=MEASURED, linewidth=1.0)
    out = (level < lo) | (level > hi)
    ax.plot(t[out] / scale, level[out], '.', color=FAIL, markersize=4)
    ax.set_xlim(0, e.duration / scale)
    reach = 1.3 * max(np.max(np.abs(level - 1)), hi - 1)
    ax.set_ylim(max(0, 1 - reach), 1 + reach)
    return ax


def _chance_of_power(w):
    spread = 2 / (9 * w)
    return tuple((1 - spread + z * np.sqrt(spread)) ** 3 for z in (-RARE, RARE))


def distribution(ax, state: State):
    """Draw how many samples fall where a normal distribution puts equally many, with what chance allows."""
    e = state.problem.evidence
    cells = e.cells_of(state.model).astype(float)
    k, total = len(cells), cells.sum()
    ratio = cells / (total / k)
    chance = RARE * np.sqrt((1 - 1 / k) / (total / k))
    at = norm.ppf((np.arange(k) + 0.5) / k)
    dress(ax, f'{e.axis}: distribution of the samples', 'standard deviations from the mean', 'samples / normal')
    ax.axhspan(1 - chance, 1 + chance, color='#dfe5e9', linewidth=0)
    ax.step(at, ratio, where='mid', color=MEASURED, linewidth=1.0)
    out = np.abs(ratio - 1) > chance
    ax.plot(at[out], ratio[out], '.', color=FAIL, markersize=4)
    reach = 1.3 * max(np.max(np.abs(ratio - 1)), 1.5 * chance)
    ax.set_ylim(max(0, 1 - reach), 1 + reach)
    return ax
