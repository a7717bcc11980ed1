# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A chain of candidates: the most probable into the model, refitted, and on from there.

What stands out behind the members that are there is asked anew at each place; what does not heal
what it claims, or does not lower the error, is passed over there, and may be asked again behind
another chain.

"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from . import verdict as rules
from .against import Against
from .effect import Finding, Model
from .findings import (
    bends, elsewhere, failures, fitted, fresh, gained, label, may_pair, nameless, pairs, price,
    surplus, together, yields
)
from .places import Place, Places
from .prediction import State

LONGEST = 12  # members of a chain
HINT = 0.5  # share of what chance reaches, from which one of two is looked at with the other
FAINT = 2  # that say nothing alone are looked at with another, where nothing stands out


class Chains:
    """
    Chains of candidates of one target, and what is known of those that were met on the way.

    Attributes
    ----------
    places : Places
        What stands out behind which members.
    against : Against
        What speaks against one.
    refuted : dict of str to Finding
        By label, with what speaks against each.
    scores : dict of frozenset of str to float
        The surplus of each set of labels that was met, nats.

    """

    def __init__(self, state: State, tried: Iterable[Finding] = ()):
        self.places = Places(state)
        self.against = Against(self.places)
        self.refuted: dict[str, Finding] = {
            label(self.places.base, f): f for f in tried if f.effect is not None}
        self.scores: dict[frozenset[str], float] = {}
        #: all that was refuted of a label
        self._disproved: dict[str, list[Finding]] = {k: [f] for k, f in self.refuted.items()}
        self._aside: dict[str, Finding] = {}    # what does not heal behind a chain, but may alone
        self._yielded: list[Finding] = []       # what gave way to another on the last chain

    def able(self, place: Place) -> list[Finding]:
        """Return what stands out at a place, best first."""
        return [f for f in self.open_at(place) if f.gain > f.penalty]

    def open_at(self, place: Place) -> list[Finding]:
        """Return the candidates at a place, best first, against which nothing speaks yet."""
        some = [f for f in place.candidates
                if not f.against and not self._fallen(place, f)]
        return sorted(some, key=nameless)

    def _fallen(self, place: Place, finding: Finding) -> bool:
        """
        Tell whether a candidate was refuted.

        What was one of its name may have been what a filter does, and beside the filter another
        one stands out, far away from there.

        """
        name = label(place.model, finding)
        disproved = self._disproved.get(name, [])
        return name in self.refuted and not (
            disproved and all(elsewhere(finding, f) for f in disproved))

    def chain(self, begin: Iterable[Finding] = ()) -> list[Finding]:
        """Return the chain that follows the most probable candidate from a beginning on."""
        members = list(begin)
        self._yielded = []
        while len(members) < LONGEST:
            place = self.places.at(self.places.model_of(members))
            if place is None:
                return members[:-1]
            # at once, or what follows is looked for beside something that is not there
            best: list[Finding] = []
            failed: set[str] = set()
            able = self.able(place)
            pair = cache(partial(self._pair, members, place))
            for f in able:
                first = [g for g in able if yields(f, g)]
                best = self._first(members, first, failed) or first and pair()
                self._yielded += [f] if best else []
                # what stands out most may need another one beside it; less would take its place
                best = best or self._first(members, [f], failed) or pair()
                if best:
                    # nor is what would have given way a rival of that
                    self._yielded += [g for g in able if g is not f and yields(g, best[0])]
                    break
            self._note(members, place, failed)
            best = best or pair()
            if not best:
                break
            members += best
        return members

    def _first(self, members: list[Finding], some: Iterable[Finding],
               failed: set[str]) -> list[Finding]:
        """Return the first of some that heals and lowers the error behind a chain, if any."""
        before = self.places.model_of(members)
        for f in some:
            if label(before, f) in failed:
                continue
            if self._heals(members, f) and self._lowers(members, f):
                return [f]
            failed.add(label(before, f))
        return []

    def _pair(self, members: list[Finding], place: Place) -> list[Finding]:
        """
        Return two that heal together, behind a chain, what one of them does not.

        Noise is stretched over both, and what one of them leaves stands out the more: of two
        steps, up and down again, or of a step beside a swing. The first of two of a kind may gain
        little by itself; then the second must gain what it lacks, and both pay once for being
        believed. Of others only the best of each sort is tried first. A spectrum with one of two
        has a lower floor, above which the other stands out the more; so has its slow end, above
        which a mean does. Two that bend it to and fro may gain nothing each: where nothing stands
        out they are tried all the same. There a candidate at its bound is tried too, as the first
        of two: the lack of the second may be what pushes it there.

        """
        before, asked = self.places.model_of(members), set[bool]()
        failing = {t.view for t in failures(self.places.tests(before))}
        faint = self._faint(members, place, failing)
        held = [] if self.able(place) else [
            f for f in place.candidates if f.bounded and not self._fallen(place, f)]
        for f in [*faint, *(f for f in self.open_at(place) if f not in faint), *held]:
            if f.effect is None or not (f.effect.paired or f.effect.uncovers):
                continue
            paired, hidden = f.effect.paired, f in faint
            clear = surplus(f) > 0 and f.view in failing and paired not in asked
            if not clear and not hidden and not (
                    paired and f.effect.several and f.gain >= HINT * f.penalty):
                continue
            if clear:
                asked.add(paired)
            others = clear or hidden
            between = self.places.offering(before.plus(fresh(f)), partial(
                may_pair, f.effect, others))
            if between is None:
                continue
            g = next((g for g in self.able(between)
                      if g.name == f.name or others and pairs(f, g)), None)
            if g is None:
                continue
            if g.name == f.name and not others:
                g = replace(g, penalty=g.penalty - rules.ONCE)  # it is seen with the first alone
            if surplus(f) + surplus(g) <= 0:
                continue
            after = between.model.plus(fresh(g))
            both = together(f, g)
            if hidden and self.against.unlowered(before.plus(fresh(g)), after, f)[1]:
                continue    # the other one needs it not
            if not self.against.unhealed(before, after, both) and not self.against.unlowered(
                    before, after, both)[1]:
                return [self.places.beside_others(f, label(before, f), after), g]
        return []

    def _faint(self, members: list[Finding], place: Place,
               failing: Collection[str]) -> list[Finding]:
        """
        Return a few that bend a failing view, where nothing stands out: what leaves least first.

        A gain counts no band for more than a little: what is wrong in all of them gains nothing,
        though it be much nearer.

        """
        if self.able(place) or any(bends(f) for f in members):
            return []
        some = [f for f in self.open_at(place) if bends(f) and f.view in failing]
        left = [sum(t.gain for t in self.places.tests(place.model.plus(fresh(f)))
                    if t.view == f.view) for f in some]
        return [some[i] for i in np.argsort(left, kind='stable')[:FAINT]]

    def _heals(self, members: list[Finding], finding: Finding) -> bool:
        """Tell whether a candidate heals what it claims behind a chain; what not is kept aside."""
        before = self.places.model_of(members)
        return self._stands(before, finding, self.against.unhealed(
            before, before.plus(fresh(finding)), finding))

    def _lowers(self, members: list[Finding], finding: Finding) -> bool:
        """Tell whether it lowers the error behind a chain; what does not may do so later."""
        before = self.places.model_of(members)
        after = before.plus(fresh(finding))
        return self._stands(before, finding, self.against.unconfirmed(
            after, label(before, finding), finding)[1])

    def _stands(self, before: Model, finding: Finding, against: str) -> bool:
        if against:
            self._aside[label(before, finding)] = replace(finding, against=against)
        return not against

    def _note(self, members: list[Finding], place: Place, failed: Collection[str]) -> None:
        """
        Keep the surplus of the set reached, and of each set one candidate further on.

        But for those that do not heal what they claim there, or do not lower the error: what
        predicts no better is no rival. Nor is what has no name of what has one.

        """
        total = gained(members)
        here = frozenset(place.model.labels)
        self.scores[here] = max(total, self.scores.get(here, -np.inf))
        for f in place.candidates:
            if f.against or label(place.model, f) in failed or self._fallen(place, f) \
                    or nameless(f):
                continue
            more = here | {label(place.model, f)}
            self.scores[more] = max(total + surplus(f), self.scores.get(more, -np.inf))

    def _along(self, names: Iterable[str]) -> list[Finding]:
        """Return the chain of some names, each as it stands out behind the last; or nothing."""
        members: list[Finding] = []
        for name in names:
            place = self.places.at(self.places.model_of(members))
            f = None if place is None else next(
                (f for f in self.open_at(place) if f.name == name), None)
            if place is None or f is None:
                return []
            self._note(members, place, ())
            members.append(f)
        self.scores.setdefault(self.places.set_of(members), gained(members))
        return members

    def _rivals(self, chain: list[Finding], i: int) -> list[Finding]:
        """Return what stood out at a place of a chain and is explained away by what was chosen."""
        place, after = (self.places.at(self.places.model_of(chain[:k])) for k in (i, i + 1))
        if place is None or after is None or not after.candidates:
            return []
        still = {f.name for f in self.able(after)} | {f.name for f in chain[i:]}
        return [f for f in self.able(place) if f.name not in still and not nameless(f)]

    def _worth(self, chain: Sequence[Finding]) -> float:
        """
        Return what a chain explains all together, nats, less its cost; -inf: not known.

        What is fitted gains it there; all else is read from the samples beside any fit.

        """
        supported = self.places.supported(self.places.model_of(chain))
        if supported is None:
            return -np.inf
        return supported + sum(
            (f.samples if fitted(f) else f.gain) - price(f) for f in chain)
