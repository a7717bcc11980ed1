# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a fit starts from: the shapes that effects propose, with amplitudes by least squares."""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast, TypeAlias

import numpy as np

from .behind import model_gain2
from .kinds import (
    Coupling, Defect, FILTERS, foreign, is_peak, Mean, MEASURED, NoiseEffect, Parameter, Response,
    Spectrum
)
from .likelihood import Likelihood
from ..core.errors import FitError
from ..core.linear import nonnegative
from ..core.spectrum import Bins, smooth
from ..loop.effect import Fit, Model
from ..loop.verdict import PRICE

#: a model with the shapes of its effects, and where its searched parameters start
Start: TypeAlias = tuple[Model, np.ndarray]

COLUMNS = 2  # of a mean of one form that a fit starts from
ROUNDS = 3  # of weighing a spectrum by what was fitted to it
LEAST = 1e-6  # of its median, that a level is anywhere
BESIDE = 6  # of the starts of a filter beside noise of a smaller model
MOST = 0.9, 0.99  # of the level that what lies behind a filter may have
LOWEST = 1e-3  # of what is seen behind held samples, that a filter before them is taken to leave
AT_ONCE = 64  # effects whose columns are judged together: of some MB
NO_RANK = 1e-12  # of a Gram matrix of columns of length 1: what others say of one all but this
SHOWS = 0.03  # share of the power that noise which passes a filter must be somewhere


def starts(likelihood: Likelihood, given: Model | None, anew: bool = False) -> list[Start]:
    """
    Return search vectors: every combination of shapes the effects propose.

    Amplitudes are set by non-negative least squares; where a smaller model is given, once more
    with the values of that: with an effect more no fit is worse. Whether a peak has the form that
    it has there is asked ``anew``: beside what was missing from it another one was like it.
    Raise FitError for filters alone, with no noise to filter.

    """
    model = likelihood.model
    filters = model.of(Response)
    if filters and not model.of(Spectrum):
        raise FitError(f'{likelihood.evidence.axis}: the model holds no noise that '
                       f'{filters[0].name} could filter', 'add white')
    shaped = [(e, *_shapes_of(e, given)) for e in model.of(NoiseEffect)
              if not isinstance(e, MEASURED)]
    known = {e.label: e.with_values(**shapes) for e, shapes, begun in shaped if begun}
    grid = [Model(known.get(e.label, e) for e in model)]
    # what has shapes is asked for them again beside what had none yet, and not before
    for e, shapes, begun in sorted(shaped, key=lambda z: z[2]):
        if begun and isinstance(e, Mean) and e.anew and not e.fitted:
            options = likelihood.evidence.starts(e.with_values(
                **{s: v for s, v in shapes.items() if s not in e.anew}))
        elif begun:
            options = [known[e.label]]
            options += [options[0].with_values(**{p.name: k})
                        for p in e.parameters if _asked_again(e, p, model, given, anew)
                        for k in (options[0].others(p, likelihood.evidence) if p.choices else ())]
            if isinstance(e, Mean) and all(p.discrete for p in e.parameters if p.name in shapes):
                # nothing else moves it to where it is seen once more is in the model
                near = e.with_values(**options[0].values).finer(likelihood.evidence)
                options += cast('list[Mean]', near)
        else:
            options = [*_of_what_passes(likelihood, given, e), *_beneath(likelihood, given, e),
                       *likelihood.evidence.starts(e)]
            if not options:
                raise FitError(
                    f'{likelihood.evidence.axis}: {e.name} does not apply to this record', e.needs
                )
        if isinstance(e, Mean) and len(options) > 2:
            first, moved = options[0], begun and not e.anew
            options = _best_columns(likelihood, grid[0], e, options, not begun)
            if moved and first not in options:
                options.append(first)   # what is likely beside a rough spectrum may be less so
        grid = [g.with_effect(o) for g in grid for o in options]
    out = []
    for candidate in grid[:64]:
        found = _with_amplitudes(likelihood, candidate, (0.02, 0.3))
        if given is not None:
            found.append(with_values_of(given, likelihood, found[0]))
        out += [(candidate, x0) for x0 in found]
    return out


def _shapes_of(effect: NoiseEffect, given: Model | None) -> tuple[dict[str, float], bool]:
    """Return the shapes that an effect has, or has in a smaller model, and if that is all."""
    shapes = [p.name for p in effect.parameters if not p.amplitude and not p.linear]
    known = given[effect.label] if given is not None and effect.label in given.labels else effect
    return ({s: known[s] for s in shapes if s in known.values},
            bool(shapes) and all(s in known.values for s in shapes))


def _filtered(model: Model) -> tuple[float, ...]:
    """Return what each response of a model filters, by its number."""
    return tuple(r.values.get(FILTERS.name, 0.0) for r in model.of(Response))


def _asked_again(effect: NoiseEffect, parameter: Parameter, model: Model, given: Model | None,
                 anew: bool) -> bool:
    """
    Tell whether a form that a smaller model has is asked beside what was missing there.

    Of a peak where it is wanted; of a response what it filters, where noise begins that may pass
    it or not, or a mean that such noise was stretched over.

    """
    if given is None:
        return False
    return anew and isinstance(effect, Spectrum) or parameter is FILTERS and any(
        e.label not in given.labels for e in (*model.of(Spectrum), *model.of(Mean)))


def _of_what_passes(likelihood, given, effect):
    """
    Return the starts of a filter by what a smaller model leaves of the noise that passes it.

    Of the measured spectrum its own shape is the less the more other noise there is.

    """
    if given is None or not isinstance(effect, Response) or not given.of(Spectrum) \
            or likelihood.part_name != 'whole' or not (
                foreign(given) or given.of(Coupling)
                or any(r.scatters for r in given.of(Response))):
        return []
    before, more = Likelihood(likelihood.evidence, 'whole', given), given.plus(effect)
    out = _gain_alone(before, more, effect).starts(effect)[:BESIDE]
    if all(effect.acts_on(e) for e in given.of(Spectrum)):
        return out
    # without the filter white noise takes for its own what lies behind it
    return out + [o for most in MOST
                  for o in _gain_alone(before, more, effect, most).starts(effect)[:BESIDE // 2]]


def _beneath(likelihood, given, effect):
    """
    Return the starts of noise or a filter by what the sources leave that a model is coupled to.

    Noise of that model, a smaller one, may have bent to what a filter leaves.

    """
    if given is None or not given.of(Coupling) or not isinstance(effect, (Spectrum, Response)) \
            or likelihood.part_name != 'whole':
        return []
    evidence = likelihood.evidence
    before = Likelihood(evidence, 'whole', given)
    left = before.solve_linear(given, before.spectra(given)[0]).power
    known = evidence.starts(effect)
    return [o for o in evidence.with_power(left).starts(effect) if o not in known]


def with_values_of(given: Model, likelihood: Likelihood, x0: np.ndarray) -> np.ndarray:
    """Return a search vector (p,) with the values of another model in it."""
    out = x0.copy()
    for j, slot in enumerate(likelihood.slots):
        if slot.label in given.labels and slot.parameter.name in given[slot.label].values:
            value = given[slot.label][slot.parameter.name]
            if value > 0 or not slot.parameter.log:
                out[j] = slot.to_search(value)
    return out


def _best_columns(likelihood, model, effect, options, finer):
    """
    Return the options whose columns explain most of the slow part.

    They are judged against the smoothed measured spectrum, beside what else acts on the mean: a
    second step must not land on the first. A form of more columns must be that much better. Where
    there are several forms it is the best of each: one with harmonics bends to a sine whose period
    lies between two that are tried. Of one form it is the best by either spectrum: a strong one
    hides in the first, and the second takes for noise what is missing still.

    """
    power = smooth(likelihood.power)
    slow = likelihood.slow_rest(model, power)
    known = [
        likelihood.slow.columns(m) for m in model.of(Mean)
        if m.label != effect.label and m.placed
    ]
    proposed = [likelihood.slow.columns(o) for o in options]
    for again in range(2):
        root = np.sqrt(2 * likelihood.dt / likelihood.slow.fine(power))[:, None]
        y, before = slow * root[:, 0], np.zeros((len(slow), 0))
        if known:
            before = _basis(np.concatenate(known, axis=1) * root)
            y = y - before @ (before.T @ y)
        gains = _gains([x * root for x in proposed], before, y)
        if again:
            break
        # a strong one is in that spectrum itself: what the best leaves tells them apart
        best = _best_of_forms(options, gains, effect.anew)
        more = [o for i in best for o in options[i].finer(likelihood.evidence)
                if finer and o not in options]
        x = np.column_stack([*known, proposed[best[0]]]) * root
        basis = _basis(x)
        rest = (slow * root[:, 0] - basis @ (basis.T @ (slow * root[:, 0]))) / root[:, 0]
        power = _background(likelihood.bins, np.maximum(
            likelihood.slow.replaced(likelihood.power, likelihood.slow.measured, rest), 1e-300))
        options = [*options, *more]
        proposed += [likelihood.slow.columns(o) for o in more]
    chosen = _best_of_forms(options, gains, effect.anew)
    if not effect.anew and best[0] not in chosen:
        chosen = [*chosen[:COLUMNS - 1], best[0]]
    return [options[i] for i in chosen]


def _gains(proposed: list[np.ndarray], before: np.ndarray, y: np.ndarray) -> np.ndarray:
    """
    Return what columns explain of y (q,), less what they cost, of each of some (q, p).

    Beside an orthonormal basis (q, r) of others, which y is less of already. By their Gram
    matrices, those of as many columns at once.

    """
    out = np.empty(len(proposed))
    widths = np.array([x.shape[1] for x in proposed])
    for p in set(widths):
        alike = np.flatnonzero(widths == p)
        for some in np.array_split(alike, len(alike) // AT_ONCE + 1):
            x = np.stack([proposed[i] for i in some])
            scale = np.sqrt(np.einsum('kqp,kqp->kp', x, x))
            x = (x - before @ (before.T @ x)) / np.where(scale > 0, scale, 1.0)[:, None]
            values, axes = np.linalg.eigh(x.transpose(0, 2, 1) @ x)
            told = np.einsum('kpr,kp->kr', axes, y @ x)
            own = values > NO_RANK
            out[some] = np.sum(told**2 / np.where(own, values, 1.0), axis=1, where=own) \
                - 2 * PRICE * np.sum(own, axis=1)
    return out


def _best_of_forms(options, gains, choices) -> list[int]:
    """Return which options are best, best first: one of each form, of one form some."""
    order = [int(i) for i in np.argsort(gains)[::-1]]
    first = {tuple(options[i][c] for c in choices): i for i in reversed(order)}
    return order[:COLUMNS] if len(first) == 1 else [i for i in order if i in first.values()]


def _background(bins: Bins, power: np.ndarray) -> np.ndarray:
    """
    Return the power (b,) as that of white noise, flicker and a random walk.

    At the slow end fitted columns leave next to nothing by their own doing: no level of noise is
    told by a few bins there.

    """
    shape = np.stack([np.ones(len(bins.f)), 1 / bins.f, 1 / bins.f**2], axis=1)
    level, least = smooth(power), max(LEAST * float(np.median(power)), 1e-100)
    for _ in range(ROUNDS):
        w = np.sqrt(bins.count) / np.maximum(level, least)
        level = shape @ nonnegative(shape * w[:, None], power * w)
    return np.maximum(level, least)


def _basis(x: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the columns x (q, p)."""
    scale = np.sqrt(np.sum(x**2, axis=0))
    q, r = np.linalg.qr(x / np.where(scale > 0, scale, 1.0))
    return q[:, np.abs(np.diag(r)) > 1e-6]


def most_promising(plain: Likelihood, starts: list[Start], mean: Fit | None,
                   most: int) -> list[tuple[Likelihood, np.ndarray]]:
    """
    Return (likelihood, start) of the starts whose likelihood is best where they stand.

    Other shapes come before other amplitudes of one shape, which mostly end where that ends; and
    before both what responses filter, for what was found with one of that goes on with it.

    """
    found: dict[Model, list] = {}
    known = {plain.model: plain}
    for candidate, x0 in starts:
        if candidate not in known:
            known[candidate] = Likelihood(
                plain.evidence, plain.part_name, candidate, mean, plain.explained)
        likelihood = known[candidate]
        x0 = _carried(plain, x0, likelihood)
        value, linear = likelihood.value(x0)[:2]
        value += linear.form
        found.setdefault(candidate, []).append(
            (value if np.isfinite(value) else np.inf, likelihood, x0))
    ranked = []
    for some in found.values():
        some.sort(key=lambda z: z[0])
        ranked += [(place, *z) for place, z in enumerate(some)]
    ranked.sort(key=lambda z: z[:2])
    first = {_filtered(z[2].model): z for z in reversed(ranked)}
    ranked = sorted(ranked, key=lambda z: first[_filtered(z[2].model)] is not z)
    return [(likelihood, x0) for _, _, likelihood, x0 in ranked[:most]]


def begun_anew(found: Likelihood, x: np.ndarray, most: int) -> list[tuple[Likelihood, np.ndarray]]:
    """
    Return (likelihood, start) of responses begun anew, all else as it was found at x (p,).

    A form is chosen where all begin, and noise that is not the sensor's own decides there: a
    narrow peak that no start meets, or a knee whose fall hides the filter's; or what other
    channels tell, or the sensor's own that was missing there. Beside such it is asked again where
    that has been met, the same form too, for it may have ended at the bound of what is optional.
    Of each form the best start, of these the best ``most``, and the form that it has where that is
    as good as they; none where the model has no such noise, or neither of them is new in it.

    """
    here, out = found.with_search(x), []
    # what every sensor has is there when forms are chosen, unless it was missing
    last = here.effects[-1]
    coloured = [*foreign(here), *here.of(Coupling)]
    if isinstance(last, Spectrum) and not isinstance(last, MEASURED):
        coloured.append(last)
    if not coloured or last not in [*coloured, *here.of(Response)]:
        return []
    searched = {s.label for s in found.slots}   # of others the samples say which form they have
    for e in here.of(Response):
        if e.label in searched:
            best = _of_each_form(found, x, here, e)
            form = tuple(e[p.name] for p in e.parameters if p.choices)
            ranked = sorted(best, key=lambda z: best[z][0])
            # what begins in the form that is there mostly ends there: it takes no other's place
            some = {*ranked[:most], *[z for z in ranked if z != form][:most]}
            out += [best[z] for z in ranked if z in some]
    return [(other, x0) for _, other, x0 in out]


def _of_each_form(found: Likelihood, x: np.ndarray, here: Model, response: Response) -> dict[
        tuple, tuple[float, Likelihood, np.ndarray]]:
    """Return (value, likelihood, start) of a response begun anew, the best of each form."""
    known = {(s.label, s.parameter.name): v for s, v in zip(found.slots, x)}
    choices = [p.name for p in response.parameters if p.choices]
    best: dict[tuple, tuple] = {}
    begun = type(response)({}, response.label)
    for o in _gain_alone(found, here, response).starts(begun) if choices else ():
        if FILTERS.name in choices:
            o = o.with_values(filters=response[FILTERS.name])
        form = tuple(o[c] for c in choices)
        other = found.beside(found.model.with_effect(o))
        as_found = np.array([
            known[s.label, s.parameter.name] if s.label != response.label
            else s.to_search(o[s.parameter.name]) for s in other.slots])
        # noise that was fitted beside a wrong form has a wrong level
        for x0 in (as_found, *_with_amplitudes(other, here.with_effect(o), (0.02,))):
            value = other.value(x0)[0]
            if value < best.get(form, (np.inf,))[0]:
                best[form] = value, other, x0
    return best


def _gain_alone(found, here, response, most=0.0):
    """
    Return the evidence with what a response leaves of white noise as its power.

    Less what lies behind it: as found, or as a share of the most there may be in the spectrum.
    What other channels tell is none of what it filters.

    """
    if found.part_name != 'whole':
        return found.evidence
    rest = here.minus(response.label)
    v, each = found.spectra(rest)
    power = found.solve_linear(rest, v).power if found.couplings else found.evidence.whole.power
    beside = sum(each[e.label] for e in here.of(Spectrum) if not response.acts_on(e))
    before = sum(each[e.label] for e in here.of(Spectrum) if response.acts_on(e))
    if most and np.any(beside > 0):
        some = beside > 0
        beside = beside * (most * np.min(smooth(power)[some] / beside[some]))
    gain2 = np.maximum(power - beside, 1e-3 * power) / before
    for r in here.of(Response):
        gain2 = np.maximum(r.unscattered(gain2, found.bins), LOWEST * gain2)
    return found.evidence.with_power(gain2)


def entered_behind(found: Likelihood, x: np.ndarray) -> list[tuple[Likelihood, np.ndarray]]:
    """
    Return (likelihood, start) of responses that some noise passes that would show.

    In the form that they have, or begun anew: what was fitted to all noise had another one.

    """
    here, out = found.with_search(x), []
    searched = {s.label for s in found.slots}
    for e in here.of(Response):
        if e.values.get(FILTERS.name) != 0 or e.label not in searched:
            continue
        for k in range(1, len(FILTERS.choices)):
            passes = cast(Response, e.with_values(**{FILTERS.name: float(k)}))
            model = here.with_effect(passes)
            acts = {s.label for s in here.of(Spectrum) if passes.acts_on(s)}
            passing = {s.label for s in here.of(Spectrum) if e.acts_on(s)} - acts
            if acts and _shows(found, here, model, passing):
                other = found.beside(found.model.with_effect(model[e.label]))
                begun = [(other.value(x0)[0], other, x0)
                         for x0 in _with_amplitudes(other, model, (0.02,))]
                begun += _of_each_form(found, x, model, passes).values()
                out.append(min(begun, key=lambda z: z[0])[1:])
    return out


def peaks_anew(found: Likelihood, x: np.ndarray) -> list[tuple[Likelihood, np.ndarray]]:
    """
    Return (likelihood, start) of each peak in the forms that it has not, all else as it is at x.

    A form that was chosen behind a response of another form made up for what that did to it.

    """
    searched, out = {s.label for s in found.slots}, []
    for peak in filter(is_peak, found.with_search(x)):
        for p in peak.parameters if peak.label in searched else ():
            for k in peak.others(p, found.evidence):
                other = found.beside(found.model.with_effect(peak.with_values(**{p.name: k})))
                out.append((other, _carried(found, x, other)))
    return out


def _shows(found: Likelihood, before: Model, after: Model, labels: Iterable[str]) -> bool:
    """Tell whether some noise has a clear share of the power more in one model than in another."""
    each = [found.spectra(model)[1] for model in (before, after)]
    more = sum((each[1][k] - each[0][k] for k in labels), np.zeros(len(found.power)))
    return bool(np.any(more > SHOWS * found.power))


def _carried(plain: Likelihood, x0: np.ndarray, likelihood: Likelihood) -> np.ndarray:
    """Return a search vector as that of a likelihood whose forms may have less that is free."""
    if likelihood is plain:
        return x0
    known = {(s.label, s.parameter.name): x for s, x in zip(plain.slots, x0)}
    return np.array([
        known[key] if key in known else s.to_search(likelihood.model[s.label][s.parameter.name])
        for s in likelihood.slots for key in [(s.label, s.parameter.name)]])


def _with_amplitudes(likelihood, model, shares):
    """
    Return search vectors with amplitudes from the measured power.

    None below a share, one for each, of where it matters most.

    """
    spectra = [e for e in model.of(Spectrum) if not isinstance(e, Defect) and e.amplitudes]
    for e in spectra:
        rest = {p.name: float(np.sqrt(p.lower * p.upper)) for p in e.parameters
                if p.name not in e.values and not p.amplitude}
        model = model.with_effect(e.with_values(**rest, **dict.fromkeys(e.amplitudes, 1.0)))
    for e in model.effects:
        rest = {p.name: float(np.sqrt(p.lower * p.upper)) if p.log else 0.0
                for p in e.parameters if p.name not in e.values}
        model = model.with_effect(model[e.label].with_values(**rest))
    names, out = [e.label for e in spectra], []
    squares, matters = _squares(likelihood, model, names)
    for share in shares:
        for name, value in zip(names, np.maximum(squares, share / matters)):
            e = model[name]
            model = model.with_effect(e.with_values(**{e.amplitudes[0]: float(np.sqrt(value))}))
        out.append(np.array(
            [slot.to_search(model[slot.label][slot.parameter.name]) for slot in likelihood.slots]))
    return out


def _squares(likelihood, model, names):
    """
    Return the squares of amplitudes (p,) of effects, by non-negative least squares.

    And what an amplitude of 1 is where it matters most, as a share of the power there.

    """
    if not names:
        return np.zeros(0), np.ones(0)
    _, each = likelihood.spectra(model)
    fixed = sum((v for k, v in each.items() if k not in names), np.zeros(len(likelihood.power)))
    shape = np.array([each[k] for k in names]).T
    power = likelihood.power
    if likelihood.couplings:  # what another channel puts there is not the noise's
        power = likelihood.solve_linear(model, smooth(power)).power
    target = np.maximum(power - fixed, 0)
    floor = np.maximum(smooth(power), 1e-300)
    level = floor
    # behind a filter only the band that passes says something of the amplitudes; a peak there has
    # feet alone, and its own band does
    gain = model_gain2(model, likelihood.bins.f, likelihood.dt)
    tells = gain > 0.2 * min(gain.max(), 1.0)
    within = tells.copy()
    for peak, name in zip(shape.T, names):
        above = peak > 0.5 * peak.max()
        if model[name].centre is not None and not np.any(within & above):
            peak[~above] = 0.0
            tells |= above
    passes = np.sqrt(likelihood.weight) * tells
    for _ in range(3):
        w = passes / level
        a2 = nonnegative(shape * w[:, None], target * w)
        level = np.maximum(shape @ a2 + fixed, 1e-3 * floor)
    return a2, np.max(shape / level[:, None], axis=0)


def reddest(likelihood: Likelihood, x: np.ndarray) -> int | None:
    """
    Return the slot of the amplitude whose spectrum rises most towards low frequencies.

    None for a single spectrum.

    """
    spectra = [e for e in likelihood.model.of(Spectrum) if not isinstance(e, Defect)]
    if len(spectra) < 2:
        return None
    f = likelihood.bins.f
    pair = np.array([f[0], f[len(f) // 2]])
    model = likelihood.with_search(x)
    rise = {}
    for e in spectra:
        at = model[e.label]
        assert isinstance(at, Spectrum)
        s = at.psd(pair, likelihood.dt)
        if np.all(s > 0):       # a bell is zero far from its centre
            rise[e.label] = np.log(s[0]) - np.log(s[1])
    if not rise:
        return None
    label = max(rise, key=lambda label: rise[label])
    for j, slot in enumerate(likelihood.slots):
        if slot.label == label and slot.parameter.amplitude:
            return j
    return None
