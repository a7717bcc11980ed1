# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Choosing what a fit rests on: the bands that a model explains, quiet stretches, an open response.

Where bands of the spectrum disagree with a fit it is made again on those that a fit explains
(:mod:`~imu_noise_tools.noise.explained`); where that leaves out one end, a response as of a
filter is left open beside it (:mod:`~imu_noise_tools.noise.response`) if it explains more.

"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .explained import (
    Bands, Explained, FAR, judge, Judgement, MANY, NEARLY, supported as supported_by
)
from .kinds import Coupling, foreign, is_peak, Modulation, Response, Spectrum
from .likelihood import Likelihood
from .quiet import quiet_from
from .response import beside_a_band, DEEP, OPEN, OpenResponse, Order, Rational
from .search import Found, Search
from .starts import SHOWS, starts, with_values_of
from .uncertainty import marginal
from ..core.statistics import gamma_pull_exact
from ..loop.effect import Model

_SPANS = (0.45, 0.6, 0.75, 1.0)  # shares of the span of ln f, from the slow end, to start from
_HOLES = ((0.3, 0.6), (0.45, 0.75), (0.6, 0.9), (0.45, 0.9), (0.6, 0.95),
          (0.7, 0.95))  # or all but these
_OUT = 0.3  # of ln power by which a band stands out of those beside it
_ROUNDS = 12  # of choosing bands and fitting again
# of the response that may be left open
_ORDERS = tuple(Order(*order) for order in (
    (0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2), (2, 2, True),
    (2, 2, False, np.inf, True), (3, 0), (0, 3), (4, 0), (3, 3), (3, 3, True), (5, 0), (4, 4, 2),
    (4, 4), (4, 4, True)))
_BENT = Order(1, 0)  # of one that is too little to be seen
TERM = 4.0  # nats that a term of the response must be worth
_NEAR = 12.0  # nats behind the best, to which an order with fewer terms is fitted in full as well
_MORE = 2  # terms more than those that explain every band that are tried as well
_BAND = 12.0  # nats that a band left to levels of its own costs beside such terms
_FLAT, _FLATNESS = 0.02, 0.1  # share of Nyquist up to which ln gain^2 must stay so near to zero
_VAGUE = 2.0  # times the spread of the level beside holes: a response is no better than they are
_DRIFT = 0.1  # share of the power from which drift is told from it
_GAP = 2  # bands from one to the next over which a response reaches
_CREDIBLE = 0.3  # share of the bands that must agree for the others to be called disturbed
_LEAST = 0.05  # share of the power, somewhere, that must be left of what every sensor has


def resting_on_what_it_explains(search: Search, plain: Found, hint: Explained | None,
                                given: Model | None = None) -> Found:
    """
    Return the fit made again on the bands that a fit explains; the same where none disagrees.

    Bands are chosen and fitted in turn until they stay, beginning with those of the slow end, with
    all, and with all but some in the middle; of where that ends, what explains most bands holds.
    Where that is few of them the model is wrong, not disturbed, and every bin counts. ``given`` is
    a model that was fitted as ``hint`` says.

    """
    thorough, search = search, replace(search, cautious=False, enough=1e-3)
    bands = Bands.on(plain.likelihood.bins)
    now = _judged(bands, plain)
    if np.all(now.weight == 1) and not lacks(plain):
        return plain
    seen: list[np.ndarray] = []
    begins = _beginnings(plain, now, hint)
    ended = [e for e in (_settled(search, bands, plain, b, seen) for b in begins) if e]
    if hint is not None and given is not None and _with_filter_or_peak(plain) \
            and all(s.label in given for s in plain.likelihood.slots):
        # on all bins a filter is drawn along by a peak beside it, and is not found again
        x = with_values_of(given, plain.likelihood, plain.x)
        again = _settled(search, bands, plain, replace(hint, order=Order(), values=()), [], x)
        ended += [again] if again else []
    ended.sort(key=lambda e: -e[1])
    held = [found for found, _ in ended]
    if not held or ended[0][1] < _CREDIBLE * bands.count and not lacks(plain):
        return plain
    without, best = held[0], _score(bands, held[0])
    for basis, x in _behind_responses(bands, without, hint, given):
        more = _settled(search, bands, without, basis, [], x)
        if more is None or not (flat(more[0]) and _joined(bands, more[0])) \
                or _score(bands, more[0]) <= best + 1e-6:
            continue
        # what is added in the middle leaves the level to holes as well: they may tell it better
        vague = _VAGUE if flat(more[0], strict=True) else 1.0
        if not basis.order.tied or _spread(more[0]) < vague * _spread(
                _on_the_safe_side(thorough, bands, without)):
            held.insert(0, more[0])
            best = _score(bands, more[0])
    first = None
    for found in held:  # a fit that leaves no white noise holds only where every one does
        found = _on_the_safe_side(thorough, bands, found)
        if flat(found) and not lacks(found):
            return found
        first = first or found
    assert first is not None
    return first


def more_explained(found: Found, plain: Found) -> Found:
    """
    Return the plain fit of a filter or a peak where that explains far more, if only in part.

    What rests on the bands beside a filter or a peak may have it anywhere, as it may have what
    other axes hear of one, and of other noise it may have nothing that is most of a band that it
    sets aside.

    """
    if found is plain or not (_with_filter_or_peak(plain) or plain.likelihood.model.of(Coupling)
                              or _most_of(plain) - _seen_in(found)):
        return found
    return plain if _in_part(plain) > _in_part(found) + _BAND else found


def _most_of(found: Found) -> set[str]:
    """Return which noise, other than what every sensor has, is most of the power somewhere."""
    return {k for k, share in _shares(found).items() if np.any(share > 0.5)}


def _seen_in(found: Found) -> set[str]:
    """Return which of it shows in the bins that a fit rests on."""
    basis = found.likelihood.explained
    some = np.ones(len(found.likelihood.power), bool) if basis is None else basis.weight > 0
    return {k for k, share in _shares(found).items() if np.any(share[some] > SHOWS)}


def _shares(found: Found) -> dict[str, np.ndarray]:
    """Return the share of the power (b,) of all noise that not every sensor has, by its label."""
    model = found.likelihood.with_search(found.x)
    total, each = found.likelihood.spectra(model)
    return {e.label: each[e.label] / np.maximum(total, 1e-300) for e in foreign(model)}


def _with_filter_or_peak(found: Found) -> bool:
    """Tell whether a model has a filter, or a peak; what a fit leaves open is neither."""
    return any(isinstance(e, Response) and not isinstance(e, OpenResponse) or is_peak(e)
               for e in found.likelihood.model)


def _in_part(found: Found) -> float:
    """Return ln L of a fit where each band may be explained in part."""
    likelihood = found.likelihood
    _, linear, v, _ = likelihood.value(found.x)
    ratio, weight = ratio_of(found)
    power = ratio * v
    model = likelihood.with_linear(likelihood.with_search(found.x), linear.beta)
    if OPEN in model:   # what couplings miss of their sources goes with their gains
        v, _ = likelihood.spectra(model.minus(OPEN))
    return supported_by(Bands.on(likelihood.bins), power, weight, v, _BAND, partly=True)


def _on_the_whole(found: Found) -> Found:
    """Return a fit beside the whole record, loud or not, and no longer how deep it is there."""
    likelihood, basis = found.likelihood, found.likelihood.explained
    f, terms = likelihood.bins.f, basis.order.terms if basis else 0
    whole = with_basis(likelihood, Explained(f, np.ones(len(f))))
    return replace(found, likelihood=whole, x=found.x[:len(found.x) - terms])


def in_quiet(search: Search, found: Found, hint: Explained | None) -> Found:
    """
    Return the fit made again on what is quiet where something is switched on now and then.

    The same where nothing is, or where the model explains what is: its own effects, sources that
    are shared, or a variance that changes, hold it then.

    """
    likelihood = found.likelihood
    part, bands = likelihood.part, Bands.on(likelihood.bins)
    told = quiet_from(likelihood.bins, bands, part.power, part.quiet)
    if told is None or any((likelihood.model.of(Coupling), likelihood.model.of(Modulation))):
        return found
    low, louder = told
    basis = likelihood.explained
    explains = np.all(_judged(bands, found).weight[louder[bands.of]] > 0)
    if explains and (basis is None or not basis.order.terms):
        return found
    every = Explained(likelihood.bins.f, np.ones(len(likelihood.bins.f)), quiet=low)
    calm = with_basis(likelihood, every)
    here = likelihood.with_search(found.x)
    again = search.from_starts(calm, [*starts(calm, None), *starts(calm, here)])
    if again is None:
        return found
    again = more_explained(resting_on_what_it_explains(search, again, hint), again)
    # what is switched on may be the peak that the model has, and in quiet there is none
    tells = _with_filter_or_peak(found) and \
        _in_part(_on_the_whole(found)) > _in_part(_on_the_whole(again)) + _BAND
    return found if tells else again


def _beginnings(plain: Found, now: Judgement, hint: Explained | None):
    """Return what to begin with."""
    f, quiet = plain.likelihood.bins.f, _quiet(plain)
    if hint is not None:
        return [Explained(f, some, quiet=quiet) for some in (now.weight, hint.weight)]
    span = np.log(f / f[0]) / np.log(f[-1] / f[0])
    near = np.abs(gamma_pull_exact(*ratio_of(plain))) < FAR
    parts = [span <= share for share in _SPANS[:-1]] + [near]
    parts += [_calm(plain) & (span <= share) for share in _SPANS[-2:]]
    parts += [(span < low) | (span > high) for low, high in _HOLES]
    return [Explained(f, part.astype(float), quiet=quiet) for part in parts]


def _calm(found: Found) -> np.ndarray:
    """Return which bins (b,) are in bands that do not stand out of the four beside them."""
    bands, (x, w) = Bands.on(found.likelihood.bins), ratio_of(found)
    level = np.log(np.maximum(bands.sum(w * x) / np.maximum(bands.sum(w), 1e-9), 1e-300))
    beside = np.lib.stride_tricks.sliding_window_view(np.pad(level, 2, 'edge'), 5)
    return (np.abs(level - np.median(beside, axis=1)) < _OUT)[bands.of]


def _settled(search: Search, bands: Bands, near: Found, basis: Explained, seen: list, x=None):
    """
    Return (fit, bands that it explains) of choosing bands and fitting in turn.

    Begins with a basis, and at a point where there is one; ends where the choice was ``seen``,
    which it adds to. None where no fit is finite.

    """
    weight, best = basis.weight, None
    found = None
    for _ in range(_ROUNDS):
        if np.sum(weight > 0) < 8 or any(np.array_equal(weight, w) for w in seen):
            break
        seen.append(weight)
        likelihood = with_basis(near.likelihood, replace(basis, weight=weight))
        if found is None and x is None:
            begin = [*starts(likelihood, near.likelihood.with_search(near.x))]
            found = search.from_starts(likelihood, begin, 2)
        else:
            found = search.from_point(likelihood, x if found is None else found.x)
        if found is None or not np.isfinite(found.nll):
            break
        now = _judged(bands, found)
        used = bands.sum(weight) > 0  # what agrees and was not fitted is not yet explained
        worth = float(now.worth @ used) - 4 * lacks(found)
        if best is None or worth > best[1]:
            best = found, worth
        weight = now.weight
    return best


def _judged(bands: Bands, found: Found) -> Judgement:
    """Return which bands a fit explains."""
    likelihood = found.likelihood
    basis = likelihood.explained
    if basis is None or not basis.order.terms:
        return judge(bands, *ratio_of(found))
    open_one = likelihood.with_search(found.x).of(OpenResponse)[0]
    gain2 = open_one.gain2(likelihood.bins.f, likelihood.dt)
    now = judge(bands, *ratio_of(found), 0.0)
    return replace(now, weight=now.weight * (gain2 > DEEP))


def _score(bands: Bands, found: Found) -> float:
    """Return ln L where each band may have a level of its own, less what the response costs."""
    v, basis = found.likelihood.value(found.x)[2], found.likelihood.explained
    ratio, weight = ratio_of(found)
    assert basis is not None
    return supported_by(bands, ratio * v, weight, v, _BAND) - TERM * basis.order.terms \
        - 4 * _BAND * lacks(found)


def _on_the_safe_side(search: Search, bands: Bands, found: Found) -> Found:
    """
    Return the fit made again with a margin for what was too little to be seen.

    What is set aside does not end where a band still agrees: its neighbours are left out too, or,
    where it reaches to the fast end, one term of a response is left open.

    """
    basis = found.likelihood.explained
    assert basis is not None
    if not basis.order.terms and bands.sum(basis.weight)[-1] == 0:
        begun = replace(basis, order=_BENT, values=(0.0,) * _BENT.terms)
        more = search.from_point(
            with_basis(found.likelihood, begun), np.append(found.x, begun.values))
        if np.isfinite(more.nll) and flat(more) and not lacks(more):
            return more
    margin = basis.weight * ~bands.beside(basis.weight)[bands.of]
    likelihood = with_basis(found.likelihood, replace(basis, weight=margin))
    return _finite(search.from_point(likelihood, found.x), search, found)


def _finite(found: Found, search: Search, otherwise: Found) -> Found:
    """Return a minimum, or another one where it is none."""
    if np.isfinite(found.nll):
        return found
    return search.from_point(otherwise.likelihood, otherwise.x)


def lacks(found: Found) -> bool:
    """Tell whether a fit leaves next to nothing of what every sensor has."""
    likelihood = found.likelihood
    model = likelihood.with_search(found.x)
    v, each = likelihood.spectra(model)
    return any(e.never_absent and np.max(each[e.label] / v) < _LEAST for e in model.of(Spectrum))


def _behind_responses(bands: Bands, found: Found, hint: Explained | None, given: Model | None):
    """
    Yield (basis, start) with a response left open that does more than the model alone.

    First what does most, then what does nearly as much with fewer terms: they are found beside
    the drift as it was fitted without them, and what that misses by looks like one term more.

    """
    if hint is not None:
        if hint.order.terms:
            hint = replace(hint, quiet=_quiet(found))
            yield hint, np.append(found.x, hint.values)
            if given is not None:   # without the response its noise may have been lost
                x = with_values_of(given, found.likelihood, found.x)
                yield hint, np.append(x, hint.values)
        return
    bins = found.likelihood.bins
    x, w = ratio_of(found)
    best = bare = supported_by(bands, x, w, np.ones(len(x)), _BAND)
    chosen: list[tuple[float, Order, np.ndarray, np.ndarray]] = []
    begun = _band(bands, x, w, bins.dt)
    known: dict[Order, np.ndarray] = {}
    enough = np.inf
    for order in (o.about(begun[0][0].middle) if begun else o for o in _ORDERS):
        if order.terms > enough:
            continue
        near = [(o, a) for o, a in known.items() if order.twice and o.within(order)]
        near += [(o, a) for o, a in begun if o[:2] == order[:2]]
        weight = np.ones(len(x))
        for _ in range(3):
            tried = Rational(x, w * weight, bins, order).fit(near)
            if tried is None:
                break
            values, level, v = tried
            if not _still(found, order, v / level, _FLATNESS, False):
                break
            known[order] = values
            score = supported_by(bands, x, w, v, _BAND) - TERM * order.terms
            if score > bare:
                chosen.append((score, order, weight, values))
            if score > best:
                best = score
                if np.all(judge(bands, x / v, w, 0.0).kept):
                    enough = order.terms + _MORE
            now = judge(bands, x / v, w, 0.0).weight * (v > DEEP * level)
            if np.array_equal(now, weight) or np.sum(now > 0) < 8:
                break
            weight = now
    fewer = np.inf
    for score, order, weight, values in sorted(chosen, key=lambda c: -c[0]):
        if score > best - _NEAR and order.terms < fewer:
            fewer = order.terms
            basis = Explained(bins.f, weight, order, tuple(values), _quiet(found))
            yield basis, np.append(found.x, values)


def _band(bands: Bands, x: np.ndarray, w: np.ndarray, dt: float):
    """Return the (order, values) of the response beside the band that stands out most, if any."""
    mean = bands.sum(w * x) / np.maximum(bands.sum(w), 1e-9)
    mean = np.where(bands.size >= MANY, mean, 0.0)
    top = int(np.argmax(mean))
    if mean[top] <= 1 + NEARLY:
        return []
    below = np.append(True, mean <= 1 + 0.5 * (mean[top] - 1))
    begin = int(np.flatnonzero(below[:top + 1])[-1])
    ends = np.flatnonzero(np.append(below[1:], True)[top:])
    low, high = 2 * dt * bands.low[begin], 2 * dt * bands.high[top + int(ends[0]) - 1]
    return [beside_a_band(float(low), min(float(high), 0.95), float(mean[top] - 1))]


def flat(found: Found, strict: bool = False) -> bool:
    """Tell whether the response that a fit leaves open, if any, does nothing at the slow end."""
    f, dt = found.likelihood.bins.f, found.likelihood.dt
    return all(
        _still(found, r.order, r.gain2(f, dt), 2 * _FLATNESS, strict)
        for r in found.likelihood.with_search(found.x).of(OpenResponse)
    )


def _still(found: Found, order: Order, gain2: np.ndarray, by: float, strict: bool) -> bool:
    """
    Tell whether ln gain^2 (b,) stays so near to zero at the slow end.

    That is a share of Nyquist. What is added in the middle, and nowhere takes away, has its level
    from both ends: if not ``strict``, it may reach down to where drift shows.

    """
    likelihood = found.likelihood
    slow = likelihood.bins.f < _FLAT * 0.5 / likelihood.dt
    away = np.log(np.maximum(gain2, 1e-300))
    if order.tied and not strict and np.min(away) > -by:
        model = likelihood.with_search(found.x)
        v, each = likelihood.spectra(model.minus(OPEN) if OPEN in model else model)
        drift = v - sum(each[e.label] for e in model.of(Spectrum) if e.never_absent)
        slow &= np.cumsum((drift > _DRIFT * v)[::-1])[::-1] > 0
    return bool(np.max(np.abs(away[slow]), initial=0.0) <= by)


def _joined(bands: Bands, found: Found) -> bool:
    """
    Tell whether what a fit rests on behind a response is one stretch of the spectrum, or tied.

    Beyond a hole any response brings the level there down to any level at the slow end: what it
    says of that is its form, not the record.

    """
    basis = found.likelihood.explained
    assert basis is not None
    kept = np.flatnonzero(bands.sum(basis.weight) > 0)
    order = basis.order
    return not order.terms or order.tied > 0 or bool(np.max(np.diff(kept)) <= _GAP)


def _spread(found: Found) -> float:
    """Return the largest standard deviation of ln of what every sensor has."""
    there = {e.label for e in found.likelihood.model.of(Spectrum) if e.never_absent}
    some = [j for j, s in enumerate(found.likelihood.slots) if s.label in there]
    variance = np.diag(np.linalg.pinv(marginal(found.information, some)))
    variance = np.where(variance < 0, np.inf, variance)     # of nearly none of it anything is told
    return float(np.sqrt(np.max(variance, initial=0.0)))


def with_basis(likelihood: Likelihood, basis: Explained) -> Likelihood:
    """Return the same likelihood on another basis."""
    model = likelihood.model
    return Likelihood(
        likelihood.evidence, likelihood.part_name,
        model.minus(OPEN) if OPEN in model else model, likelihood.mean, basis,
    )


def _quiet(found: Found) -> float:
    """Return the Hz from which a fit rests on quiet stretches alone."""
    basis = found.likelihood.explained
    return np.inf if basis is None else basis.quiet


def ratio_of(found: Found) -> tuple[np.ndarray, np.ndarray]:
    """Return (measured over model, degrees of freedom) of all bins, (b,)."""
    likelihood = found.likelihood
    _, linear, v, _ = likelihood.value(found.x)
    power = linear.power if likelihood.linear_slots else likelihood.power
    return power / v, likelihood.full_weight
