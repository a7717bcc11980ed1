# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maximum likelihood: which values of a model's effects predict a series best."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from scipy.optimize import minimize

from .chunks import Chunks
from .predict import finite, predict
from .statespace import FilterEffect, jumps, Look, Motion, oscillates, state_space, white_of
from ..core.statistics import CHI2_90, CHI2_95, interval, ONE_SIDED
from ..core.units import si
from ..loop.effect import Effect, Estimate, Model

NULL = CHI2_95 / 2      # nats: an amplitude that loses less by going to zero is not observable
LIMIT = CHI2_90 / 2     # nats, for a one-sided 95 % limit
PARTS_SHARE = 0.25      # of the series, where a climb is far from the top
STENCIL = 0.3           # of the first move of a parameter: how far apart a curvature is read
WIDER = 2.0             # times that, at first
REACH = 3.0             # first moves that a step of a climb goes at most
PLAIN = 1.0             # nats: where parts hope for less, the whole is climbed
FURTHER = 1.0           # nats: a climb that gained more knows better where chunks begin
ENOUGH = 0.05           # nats: a climb that hopes for less is at the top
DOUBT = 10.0            # nats that a climb may gain beside three times what its steps promise


class Likelihood:
    """
    The log-likelihoods of models of one structure on one series z (n,) at dt (s).

    Of samples that are missing z is NaN: then no model has a steady state.

    """

    def __init__(self, z: np.ndarray, dt: float, alpha: float, chunks: Chunks | None = None,
                 share: float = 1.0):
        self.z, self.dt, self.alpha, self.share = z, dt, alpha, share
        self.chunks = chunks or Chunks(z, dt, alpha)
        self.samples, self.span = int(np.sum(np.isfinite(z))), len(z) * dt
        self._known: dict[Model, float] = {}

    def __call__(self, models: Iterable[Model]) -> np.ndarray:
        """Return the log-likelihood of each."""
        models = list(models)
        new = [m for m in dict.fromkeys(models) if m not in self._known]
        if new and self.recurs(new[0]):
            self.each(new)
        else:
            self._known.update(
                (m, predict(m, self.z, self.dt, self.alpha).log_likelihood) for m in new)
        return np.array([self._known[m] for m in models])

    def recurs(self, model: Model) -> bool:
        """Tell whether a model runs over this series as a bank, by chunks."""
        return jumps(model) or self.chunks.gaps

    def each(self, models: list[Model]) -> np.ndarray:
        """Return the log-likelihood sample by sample, (k, samples), of models by chunks."""
        found = self.chunks.densities(models, share=self.share)[0]
        self._known.update(zip(models, (finite(v) / self.share for v in found.sum(1))))
        return found

    def parts(self) -> Likelihood:
        """Return what models by chunks are likely to have, from parts of the series."""
        return Likelihood(self.z, self.dt, self.alpha, self.chunks, PARTS_SHARE)

    def exactly(self, models: list[Model]) -> list[float]:
        """Return the log-likelihood of each of models by chunks, begun each with its own."""
        found = [finite(x) for x in self.chunks.passed(models)]
        self._known = dict(zip(models, found))
        return found

    def about(self, model: Model, last: bool = False) -> float:
        """
        Return the log-likelihood of a model; from now on it is right of those near it.

        ``last``: also of one that keeps a phase for long, which is then learnt anew.

        """
        if self.recurs(model):
            self.chunks.begin(model, anew=last and oscillates(model))
            self._known.clear()
        return float(self([model])[0])


class Free:
    """The free parameters of a model as a vector, in logarithms where they are searched for so."""

    def __init__(self, model: Model, fixed: Any, evaluate: Likelihood):
        self.model = model
        self.lines = {(e.label, e.line) for e in model.of(FilterEffect)}
        self.parts = [
            (e.label, p)
            for e in model.of(FilterEffect)
            if e.label not in fixed
            for p in e.parameters
            if p.name not in e.measured and not _tried(model, e, p, evaluate)
        ]
        effects = {e.label: e for e in model.of(FilterEffect)}
        self.within = [effects[label].within(p, evaluate.dt) for label, p in self.parts]

    def vector(self) -> np.ndarray:
        """Return the model's own values, (parameters,), as they are searched for."""
        return np.array([self._to(p, self.model[label][p.name]) for label, p in self.parts])

    def scale(self, span: float) -> np.ndarray:
        """
        Return how far each parameter may move at first, (parameters,).

        A frequency no further than its line is wide in ``span`` s.

        """
        return np.array(
            [
                (
                    0.2 / (span * self.model[label][p.name])
                    if (label, p.name) in self.lines
                    else 0.5 if p.log else 0.1
                )
                for label, p in self.parts
            ]
        )

    def at(self, x: np.ndarray) -> Model:
        """Return the model at x (parameters,), held within bounds."""
        model = self.model
        for (label, p), within, v in zip(self.parts, self.within, x):
            value = float(np.clip(np.exp(np.clip(v, -200, 200)) if p.log else v, *within))
            model = model.with_effect(model[label].with_values(**{p.name: value}))
        return model

    @staticmethod
    def _to(p, value):
        return np.log(max(value, 1e-300)) if p.log else value


def _tried(model, effect, parameter, evaluate) -> bool:
    """
    Tell whether a parameter is not climbed, but the best of some values.

    So is for how long a phase is kept, of a model by chunks: they that begin with what another
    value knew there speak for that one's wide guess of the phase and a longer memory after it.

    """
    return parameter.discrete or (parameter.name == effect.keeps and evaluate.recurs(model))


def kept(model: Model, fixed: Any, evaluate: Likelihood) -> Model:
    """Return a model by chunks with the best time its lines keep their phase, by half decades."""
    for effect in model.of(FilterEffect):
        if not effect.keeps or effect.label in fixed:
            continue
        p, first = effect.parameter(effect.keeps), model[effect.label]
        times = {k: first[p.name] * 10 ** (0.5 * k) for k in range(-12, 13)}
        able = [k for k, v in times.items() if p.lower <= v <= p.upper]
        value: dict[int, float] = {}
        wanted = [k for k in able if -1 <= k <= 2]
        while wanted:
            last = wanted
            value.update(zip(wanted, evaluate.exactly([
                model.with_effect(first.with_values(**{p.name: times[k]})) for k in wanted])))
            best = max(value, key=lambda k: value[k])
            new = [k for k in able if k not in value and abs(k - best) <= 2]
            wanted = new if any(abs(k - best) == 1 for k in new) else []
        model = model.with_effect(first.with_values(**{p.name: times[best]}))
        if best not in last:        # chunks begin with what the best of the last knows
            evaluate.about(model, last=True)
    return model


def start(
    model: Model, fixed: Any, look: Look, evaluate: Likelihood, known: Model | None = None
) -> Model | None:
    """
    Return the model with starting values.

    Effect after effect, the best guess of each with the others held; or, for what jumps (its climb
    costs most), with the values of those ``known`` from a smaller model, where that is better.

    None where an effect does not apply to these data.

    """
    order = sorted(
        model.of(FilterEffect),
        key=lambda e: (
            e.jumps and bool(e.parameters),
            e.label not in fixed,
            bool(e.parameters) and not e.variance,
        ),
    )
    held: list[Effect] = []
    for effect in order:
        if effect.label in fixed:
            held.append(type(effect)(dict(fixed[effect.label]), effect.label))
        elif not effect.parameters:
            held.append(effect)
        else:
            guesses = [
                type(effect)(dict(g.values), effect.label) for g in type(effect).guesses(look)
            ]
            if not guesses:
                return None
            tried = [Model([*held, g]) for g in guesses]
            if not _complete(tried[0]):
                tried = tried[:1]
            rough = evaluate if oscillates(tried[0]) else evaluate.parts()
            best = int(np.argmax(rough(tried))) if len(tried) > 1 else 0
            held.append(guesses[best])
    by_label = {e.label: e for e in held}
    begin = Model(by_label[e.label] for e in model)
    if known is None or not evaluate.recurs(model):
        return begin
    both = [begin, begin.with_values({e.label: e.values for e in known})]
    return both[int(np.argmax(evaluate(both)))]


def _complete(model: Model) -> bool:
    """Tell whether a partial model can be evaluated: it has motion and white noise."""
    return (any(e.every or not e.jumps for e in model.of(Motion))
            and white_of(model) is not None)


def maximise(
    model: Model, fixed: Any, evaluate: Likelihood, hope: float = -np.inf, enough: float = ENOUGH
) -> tuple[Model, float]:
    """
    Return the model at its largest likelihood, from its own values, and that log-likelihood.

    A climb ends early where it does not see itself come to ``hope``; one that hopes for no more
    than ``enough`` is at the top.

    """
    free = Free(model, fixed, evaluate)
    x = free.vector()
    if not len(x):
        return model, float(evaluate([model])[0])
    if evaluate.recurs(model):
        x, best = _climb(free, x, evaluate, hope, enough)
        return free.at(x), best
    simplex = np.vstack([x, x + np.diag(free.scale(evaluate.span))])
    found = minimize(
        lambda v: -_finite(evaluate([free.at(v)])[0]),
        x,
        method='Nelder-Mead',
        options={'initial_simplex': simplex, 'xatol': 0.1, 'fatol': 0.01, 'maxfev': 80 * len(x)},
    )
    return free.at(found.x), -float(found.fun)


def _finite(value):
    return float(value) if np.isfinite(value) else -1e300


def _climb(free: Free, x, evaluate, hope: float, enough: float):
    """
    Climb by Newton's steps, from the likelihood a little to either side along every coordinate.

    That gives slope and curvature; how coordinates go together is what the slopes have in common
    sample by sample (Berndt, Hall, Hall, Hausman 1974). Every step is tried at half its length
    and beside the best of the points around. Parts of the series show the way as far as they can.

    """
    best = evaluate.about(free.at(x))
    wider = WIDER
    if not oscillates(free.model):      # a phase is not learnt from parts
        parts = evaluate.parts()
        way, _, able = _rounds(free, x, float(parts([free.at(x)])[0]), parts, hope - best, PLAIN)
        gained = float(evaluate([free.at(way)])[0]) - best
        if gained > 0:
            x, best, wider = way, evaluate.about(free.at(way)), 1.0
        if not able and best + 3 * max(gained, 0.0) + DOUBT < hope:
            return x, best
    return _rounds(free, x, best, evaluate, hope - best, enough, wider)[:2]


def _rounds(free, x, best, evaluate, wanted, enough, wider=WIDER, most=9):
    """
    Return where rounds of a climb come to, how high that is, and if ``wanted`` may be gained.

    What parts of a series promise is doubted the more the less they are.

    """
    share = evaluate.share
    hope = best + wanted
    scale = free.scale(evaluate.span)
    least = STENCIL * scale
    step = wider * least
    for done in range(most):
        around = np.concatenate([x + np.diag(step), x - np.diag(step)])
        models = [free.at(v) for v in around]
        each = evaluate.each(models) * share ** -0.5
        value = evaluate(models)
        newton, gain = _newton(each, value, best, REACH * scale / step)
        if best + (gain if share == 1 and done > 1 else 3 * gain + DOUBT / share) < hope:
            return x, best, False
        tried = [*around, x + newton * step, x + 0.5 * newton * step]
        if gain > enough:
            value = np.append(value, evaluate([free.at(v) for v in tried[-2:]]))
        top = int(np.argmax(value))
        gained = value[top] - best
        if gained > 0:
            x = tried[top]
            best = (evaluate.about(free.at(x)) if share == 1 and gained > FURTHER
                    else float(value[top]))
        small = np.all(step < 1.01 * least)
        if small and gained <= enough:
            break
        step = least if gained <= 20 * enough or share < 1 else step
    return x, best, True


def _newton(
    each: np.ndarray, value: np.ndarray, best: float, reach: np.ndarray
) -> tuple[np.ndarray, float]:
    """
    Return a step, (k,) in lengths to either side, and the gain to be hoped from it.

    ``each`` (2 k, n) and ``value`` (2 k,) are at either side, ``best`` between; no step goes
    beyond ``reach`` (k,).

    """
    k = len(value) // 2
    up, down = value[:k], value[k:]
    if not np.isfinite(value).all():
        return np.clip(np.nan_to_num(up - down, posinf=2.0, neginf=-2.0), -reach, reach), np.inf
    slope = 0.5 * (up - down)
    common = 0.5 * (each[:k] - each[k:])
    common = common @ common.T
    bend = np.maximum(2 * best - up - down, np.maximum(0.1 * np.diag(common), 1e-9))
    root = np.sqrt(bend / np.maximum(np.diag(common), 1e-300))
    both = 0.98 * common * np.outer(root, root)
    np.fill_diagonal(both, bend)
    step = np.linalg.solve(both, slope)
    return np.clip(step, -reach, reach), 0.5 * float(slope @ step)


def estimates(
    model: Model, fixed: Any, log_likelihood: float, evaluate: Likelihood, sensor: str = 'gyro'
) -> Any:
    """
    Return the estimate of each parameter, and flags.

    Standard deviations from the curvature of the likelihood, intervals symmetric in its scale; an
    amplitude that can be zero is None, with its upper limit. What was stated is marked as fixed.

    """
    free = Free(model, fixed, evaluate)
    out = {
        e.label: {
            p.name: Estimate(
                e[p.name], None, None, si(p.unit, sensor), point=e[p.name], fixed=True
            )
            for p in e.parameters
        }
        for e in model
        if e.label in fixed
    }
    x = free.vector()
    whites = {e.label for e in model.of(FilterEffect) if e.variance}
    flags = []
    able = len(x) and np.isfinite(log_likelihood)
    sd = (
        np.sqrt(np.maximum(np.diag(_covariance(free, x, log_likelihood, evaluate)), 0))
        if able
        else np.full(len(x), np.inf)
    )
    for i, (label, p) in enumerate(free.parts):
        value = model[label][p.name]
        unit = si(p.unit, sensor)
        entry, flag = _climbed(value, float(sd[i]), p, free.within[i], unit)
        able = p.amplitude and label not in whites     # without R there is no filter
        if able and _vanishes(free, x, i, log_likelihood, evaluate):
            upper = _upper(free, x, i, log_likelihood, evaluate)
            entry = Estimate(
                None, None, (0.0, upper), unit, upper95=upper, note='not observable', point=value
            )
            flags.append(f'{label}: {p.name} is not observable in this record')
        elif flag:
            flags.append(f'{label}: {p.name} is {flag}')
        out.setdefault(label, {})[p.name] = entry
    for e in model.of(FilterEffect):
        for p in e.parameters:
            if e.label not in fixed and _tried(model, e, p, evaluate):
                out.setdefault(e.label, {})[p.name] = Estimate(
                    e[p.name], None, None, si(p.unit, sensor), point=e[p.name],
                    note='the best of the values tried')
            elif e.label not in fixed and p.name in e.measured:
                out.setdefault(e.label, {})[p.name], flag = _measured(
                    model, e, p, log_likelihood, evaluate, sensor
                )
                flags += flag
    return {e.label: {p.name: out[e.label][p.name] for p in e.parameters} for e in model}, tuple(
        flags
    )


def _climbed(value, sd, p, within, unit) -> tuple[Estimate, str]:
    """
    Return the estimate of a value that has a deviation in p's scale, and what is to be said.

    At a limit the likelihood has a slope and no curvature, and one that is as good anywhere in the
    range (``within``) has nothing to be told: neither has an interval.

    """
    lower, upper = within
    if p.log:
        spread = min(sd, 50.0)
        low, high = value * np.exp(interval(0.0, spread))
        sd = value * min(spread, 1e3)
    else:
        low, high = interval(value, sd)
    if value <= lower + 0.001 * abs(lower) or value >= upper - 0.001 * abs(upper):
        said = 'at the limit of its range'
        return Estimate(value, None, None, unit, note=said, point=value), said
    if low <= lower and high >= upper:
        said = 'not observable'
        return Estimate(None, None, None, unit, note=said, point=value), f'{said} in this record'
    inside = float(max(low, lower)), float(min(high, upper))
    return Estimate(value, float(sd), inside, unit, point=value), ''


def _measured(model, effect, p, best, evaluate, sensor):
    """
    Return the estimate of an amplitude read from the samples.

    Null where the likelihood does without the effect: of an amplitude near zero, too, an
    oscillation whose phase is not known at first may have any size (and then keeps it).

    """
    value, unit = effect[p.name], si(p.unit, sensor)
    # least squares of a line in white noise
    std = float(np.sqrt(2 * state_space(model, evaluate.dt).r / evaluate.samples))
    rest = Model(e for e in model if e.label != effect.label)
    without = predict(rest, evaluate.z, evaluate.dt, evaluate.alpha).log_likelihood
    if best - without < NULL:
        upper = value + ONE_SIDED * std
        return Estimate(
            None, None, (0.0, upper), unit, upper95=upper, note='not observable', point=value
        ), [f'{effect.label}: {p.name} is not observable in this record']
    return Estimate(value, std, interval(value, std), unit, point=value), []


def _covariance(free, x, best, evaluate):
    """
    Return the inverse of the likelihood's negative curvature by central differences.

    Of pairs too: where two go together, one that is taken to one side alone makes the deviations
    half of what they are. Diagonal where it is flat.

    """
    k = len(x)
    h = STENCIL * free.scale(evaluate.span)
    eye = np.diag(h)
    pairs = [(i, j) for i in range(k) for j in range(i + 1, k)]
    corners = [eye[i] + eye[j] for i, j in pairs]
    points = [x + sign * e for e in (*eye, *corners) for sign in (1, -1)]
    value = np.maximum(evaluate([free.at(v) for v in points]), max(best, -1e300) - 1e6)
    bend = 2 * best - value[::2] - value[1::2]
    curve = np.diag(np.maximum(bend[:k], 1e-6))
    for (i, j), both in zip(pairs, bend[k:]):
        curve[i, j] = curve[j, i] = 0.5 * (both - bend[i] - bend[j])
    covariance = np.linalg.pinv(curve / np.outer(h, h), hermitian=True)
    if np.any(np.diag(covariance) <= 0):
        covariance = np.diag(h ** 2 / np.diag(curve))
    return covariance


def _moved(x, i, by):
    return np.concatenate([x[:i], [x[i] + by], x[i + 1:]])


def _vanishes(free, x, i, best, evaluate) -> bool:
    return best - float(evaluate([free.at(_moved(x, i, -14.0))])[0]) < NULL


def _upper(free, x, i, best, evaluate) -> float:
    """
    Return the one-sided 95 % limit of a log parameter.

    Where the likelihood has fallen by 1.35 nats, others held.

    """
    at = 0.0
    for width in (2.0, 0.5):        # how many steps of two it takes, then of a half
        steps = at + width * np.arange(1, 8 if width == 2.0 else 4)
        fallen = best - evaluate([free.at(_moved(x, i, v)) for v in steps]) > LIMIT
        at += width * (int(np.argmax(fallen)) if fallen.any() else len(steps))
    label, p = free.parts[i]
    return float(free.at(_moved(x, i, min(at + 0.5, 14.0)))[label][p.name])
