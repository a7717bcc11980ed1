# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What is missing from a model, and what then still fails.

Several effects may be missing at once, and what explains a part is worth finding though the rest
goes on failing. The search goes forward: the most probable candidate into the model, refitted, and
on from there until nothing is gained beyond chance; where a rival is explained away by what was
chosen, a chain that begins with the rival is followed as well. Then backward: each member must
lower the held-out deviance beside all the others, heal what it claims to heal, be as
good as a flexible form in its place, and not stand in the shadow of what nothing explains.

"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, count, islice
from typing import Any

import numpy as np

from . import verdict as rules
from .effect import Effect, Finding, Fit, Model, Score, unfitted
from .prediction import fall_of, State
from ..core.errors import FitError

CHAINS = 2  # chains that are followed, rivals' included
NEAR = 0.1  # share of the surplus of what was chosen from which a rival is followed
LONGEST = 12  # members of a chain
PLACES = 6  # places at which candidates are fitted; from then on none is begun
HINT = 0.5  # share of what chance reaches, from which one of two is looked at with the other
SETS = 12  # of what stood out that are tried in a chain's place
ROUNDS = 4  # times the search begins anew without what was refuted, unless something came back
FAR = 10.0  # times as long, or as high, from which it is another one
LISTED = 8  # candidates that are listed


@dataclass(frozen=True)
class Remaining:
    """
    What still fails with all that is found in the model.

    Attributes
    ----------
    failed : tuple of Finding
        The tests, each with where it fails.
    share : float or None
        Of the record's power that the model does not account for.
    largest_ratio : float or None
        Of measured to model Allan deviation, beyond what chance allows.
    sufficient : bool or None
        Whether it does not matter all the same.
    nearest : Finding or None
        The candidate that comes nearest; its ``against`` says what speaks against it.

    """

    failed: tuple[Finding, ...]
    share: float | None = None
    largest_ratio: float | None = None
    sufficient: bool | None = None
    nearest: Finding | None = None


@dataclass(frozen=True)
class Diagnosis:
    """
    What is missing from one target's model.

    Attributes
    ----------
    verdict : str
        ``missing``, ``complete``, ``unknown`` or ``undecidable``.
    ranked : tuple of Finding
        Candidates, those found first; what speaks against one is in its ``against``.
    failed : tuple of Finding
        The tests that fail with the model as it is.
    advice : str
        What to do next.
    found : tuple of Finding
        What is missing, in the order to add it.
    remaining : Remaining or None
        What then still fails; None where nothing does.
    sufficient : bool or None
        Whether what remains does not matter; None where that is not known.

    """

    verdict: str
    ranked: tuple[Finding, ...] = ()
    failed: tuple[Finding, ...] = ()
    advice: str = ''
    found: tuple[Finding, ...] = ()
    remaining: Remaining | None = None
    sufficient: bool | None = None


def diagnose(state: State) -> Diagnosis:
    """
    Return the verdict on one target.

    *missing*: something is found; *complete*: nothing fails and no candidate stands out;
    *unknown*: something fails and no candidate explains it; *undecidable*: otherwise.

    """
    search = _Search(state)
    chain = search.settled()
    found = [f for f in chain if not f.against]
    failed = failures(search.tests(state.model)) or beyond_chance(state.error)
    # what was confirmed but shares its probability is in the model when the rest is judged
    left = search.remaining(search.model_of(chain))
    rivals = [f for f in chain if f.against]
    if not rivals and not failed and left is None:
        rivals = [f for f in search.refuted.values() if f.against.startswith(_DOUBT)]
    said = rules.word(len(found), len(rivals), len(failed) + (left is not None))
    ranked = search.ranking(chain)
    telling = left.failed if left and not found else failed
    advice = state.problem.advice(said, ranked, list(telling))
    enough = True if left is None else left.sufficient
    return Diagnosis(said, tuple(ranked), tuple(failed), advice, tuple(found), left, enough)


_DOUBT = 'data not fitted do not confirm it'


@dataclass(frozen=True)
class _Place:
    """A model on the way, its candidates best first, and the surplus (nats) gained so far."""

    model: Model
    fit: Fit[Any]
    candidates: tuple[Finding, ...]


class _Search:
    """The chains of candidates of one target, and what was refuted on the way."""

    def __init__(self, state: State):
        self.state, self.problem = state, state.problem
        self.base = unfitted(state.model)
        self.refuted: dict[str, Finding] = {}
        self._disproved: dict[str, list[Finding]] = {}  # all that was refuted of a label
        self._nameless: dict[str, Finding] = {}     # is there, but in no form that is known
        self._aside: dict[str, Finding] = {}    # what does not heal behind a chain, but may alone
        self._beside: dict[str, frozenset[str]] = {}  # what is doubted, beside what
        self._places: dict[frozenset[str], _Place | None] = {}
        self._tested: dict[frozenset[str], list[Finding]] = {}
        self._scored: dict[frozenset[str], Score | None] = {}
        self.scores: dict[frozenset[str], float] = {}
        self._looked = 0
        self._yielded: list[Finding] = []       # what gave way to another on the last chain

    # --- models -----------------------------------------------------------------------------

    def place(self, model: Model) -> _Place | None:
        """Return a model fitted, with its candidates; None where the record cannot hold it."""
        key = frozenset(model.labels)
        if key not in self._places:
            try:
                here = self.state.fit if model == self.base else self.problem.point(model)
                # the effort is bounded: where everything fails, each place takes seconds
                looks = model == self.base or (
                    self.problem.looks_again and self._looked < PLACES)
                self._looked += looks and not self.problem.knows_candidates(here)
                found = self.problem.candidates(here) if looks else []
                self._places[key] = _Place(model, here, tuple(
                    sorted((f for f in found if f.effect is not None), key=lambda f: -surplus(f))))
            except FitError:
                self._places[key] = None
        return self._places[key]

    def tests(self, model: Model) -> list[Finding]:
        """Return the tests of a model; none where the record cannot hold it."""
        model = unfitted(model)
        key = frozenset(model.labels)
        if key not in self._tested:
            try:
                here = self.state.fit if model == self.base else self.problem.point(model)
                self._tested[key] = self.problem.omnibus(here)
            except FitError:
                self._tested[key] = []
        return self._tested[key]

    def error(self, model: Model) -> Score | None:
        """Return the held-out deviance of a model, None where none is had."""
        key = frozenset(model.labels)
        if key not in self._scored:
            try:
                self._scored[key] = (self.state.error if model == self.base
                                     else self.problem.held_out(model))
            except FitError:
                self._scored[key] = None
        return self._scored[key]

    def model_of(self, chain: Iterable[Finding]) -> Model:
        """Return the base model with a chain's members added, not fitted."""
        model = self.base
        for f in chain:
            model = model.plus(_new(f))
        return model

    def _set_of(self, chain: Iterable[Finding]) -> frozenset[str]:
        """Return what a model with a chain's members holds, in whichever order they came."""
        return frozenset(self.model_of(chain).labels)

    def able(self, place: _Place) -> list[Finding]:
        """Return what stands out at a place, best first."""
        return [f for f in self.open_at(place) if f.gain > f.penalty]

    def open_at(self, place: _Place) -> list[Finding]:
        """Return the candidates at a place, best first, against which nothing speaks yet."""
        return [f for f in place.candidates
                if not f.against and not self._fallen(place, f)]

    def _fallen(self, place: _Place, finding: Finding) -> bool:
        """
        Tell whether a candidate was refuted.

        What was one of its name may have been what a filter does, and beside the filter another
        one stands out, far away from there.

        """
        name = label(place.model, finding)
        disproved = self._disproved.get(name, [])
        return name in self.refuted and not (
            disproved and all(_elsewhere(finding, f) for f in disproved))

    # --- forward ----------------------------------------------------------------------------

    def chain(self, begin: Iterable[Finding] = ()) -> list[Finding]:
        """Return the chain that follows the most probable candidate from a beginning on."""
        members = list(begin)
        self._yielded = []
        while len(members) < LONGEST:
            place = self.place(self.model_of(members))
            if place is None:
                return members[:-1]
            # at once, or what follows is looked for beside something that is not there
            best: list[Finding] = []
            failed: set[str] = set()
            able = self.able(place)
            for f in able:
                first = [g for g in able if _yields(f, g)]
                best = self._first(members, first, failed) or first and self._pair(members, place)
                self._yielded += [f] if best else []
                best = best or self._first(members, [f], failed)
                if best:
                    break
            self._note(members, place, failed)
            best = best or self._pair(members, place)
            if not best:
                break
            members += best
        return members

    def _first(self, members: list[Finding], some: Iterable[Finding],
               failed: set[str]) -> list[Finding]:
        """Return the first of some that heals and lowers the error behind a chain, if any."""
        before = self.model_of(members)
        for f in some:
            if label(before, f) in failed:
                continue
            if self._heals(members, f) and self._lowers(members, f):
                return [f]
            failed.add(label(before, f))
        return []

    def _explained_away(self, members: list[Finding], some: Iterable[Finding]) -> None:
        """
        Refute what yielded to members of a chain and does not stand out beside them.

        Or, where no more candidates are begun, is not needed there.

        """
        here = self.model_of(members)
        place = self.place(here)
        for f in (f for f in some if f.name not in here):
            more = here.plus(_new(f))
            name = more.labels[-1]
            there = place is not None and (f.name in {g.name for g in self.able(place)}
                                           if place.candidates else
                                           not self._unlowered(here, more, f)[1])
            if not there:
                self.refuted[name] = replace(f, against='beside what several axes have in the '
                                             'mean it explains nothing')
                self.scores = {k: v for k, v in self.scores.items() if name not in k}
                self._beside.setdefault(name, frozenset(self.labels_of(members)))

    def _pair(self, members: list[Finding], place: _Place) -> list[Finding]:
        """
        Return two that heal together, behind a chain, what one of them does not.

        Noise is stretched over both, and what one of them leaves stands out the more: of two
        steps, up and down again, or of a step beside a swing. The first of two of a kind may gain
        little by itself; then the second must gain what it lacks. Of others only the best of each
        sort is tried first. A spectrum with one of two has a lower floor, above which the other
        stands out the more; so has its slow end, above which a mean does.

        """
        before, asked = self.model_of(members), set[bool]()
        failing = {t.view for t in failures(self.tests(before))}
        for f in self.open_at(place):
            if f.effect is None or not (f.effect.paired or f.effect.uncovers):
                continue
            paired = f.effect.paired
            clear = surplus(f) > 0 and f.view in failing and paired not in asked
            if not clear and not (paired and f.effect.several and f.gain >= HINT * f.penalty):
                continue
            if clear:
                asked.add(paired)
            between = self.place(before.plus(_new(f)))
            if between is None:
                continue
            g = next((g for g in self.able(between)
                      if g.name == f.name or clear and _pairs(f, g)), None)
            if g is None or surplus(f) + surplus(g) <= 0:
                continue
            after = between.model.plus(_new(g))
            both = _both(f, g)
            if not self._unhealed(before, after, both) and not self._unlowered(
                    before, after, both)[1]:
                return [f, g]
        return []

    def _heals(self, members: list[Finding], finding: Finding) -> bool:
        """Tell whether a candidate heals what it claims behind a chain; what not is kept aside."""
        before = self.model_of(members)
        return self._stands(before, finding, self._unhealed(
            before, before.plus(_new(finding)), finding))

    def _lowers(self, members: list[Finding], finding: Finding) -> bool:
        """Tell whether it lowers the error behind a chain; what does not may do so later."""
        before = self.model_of(members)
        after = before.plus(_new(finding))
        return self._stands(before, finding, self._unconfirmed(
            after, label(before, finding), finding)[1])

    def _stands(self, before: Model, finding: Finding, against: str) -> bool:
        if against:
            self._aside[label(before, finding)] = replace(finding, against=against)
        return not against

    def _note(self, members: list[Finding], place: _Place, failed: Collection[str]) -> None:
        """
        Keep the surplus of the set reached, and of each set one candidate further on.

        But for those that do not heal what they claim there, or do not lower the error: what
        predicts no better is no rival.

        """
        total = _gained(members)
        here = frozenset(place.model.labels)
        self.scores[here] = max(total, self.scores.get(here, -np.inf))
        for f in place.candidates:
            if f.against or label(place.model, f) in failed or self._fallen(place, f):
                continue
            more = here | {label(place.model, f)}
            self.scores[more] = max(total + surplus(f), self.scores.get(more, -np.inf))

    def forward(self, held: Sequence[Finding] = ()) -> list[Finding]:
        """
        Return the best of the chains: the main one, those that begin with a rival, and ``held``.

        One after which nothing fails goes before one that leaves something, whatever they gain.
        What an earlier chain held may not be reached without what was refuted in it.

        """
        self.scores = {}
        main = self.chain()
        self._explained_away(main, self._yielded)
        chains = [main]
        # the first of two that say little alone has a surplus below zero
        begun = [(surplus(rival) - max(surplus(main[i]), 0.0), [*main[:i], rival])
                 for i in range(len(main)) for rival in self._rivals(main, i)[:2]
                 if surplus(rival) > NEAR * max(surplus(main[i]), 0.0)]
        begun.sort(key=lambda z: -z[0])
        whole = self._set_of(main)
        able = (b for b in (self._begun(b, main) for _, b in begun) if b)
        for begin in islice(able, CHAINS - 1):
            known = dict(self.scores)
            other = self.chain(begin)
            # a rival with all of the main chain beside it: from there it was seen to gain nothing
            if whole < self._set_of(other):
                self.scores = known     # nor is what the chain lacked on its way there a rival
            else:
                chains.append(other)
        self.scores = {k: v for k, v in self.scores.items() if k == whole or not whole < k
                       or len(k) == len(whole) + 1}
        held = [f for f in held if f.effect is not None
                and (f.effect.several or f.name not in self.refuted)]
        again = self.model_of(held)
        if len(held) > 1 and not whole.issuperset(again.labels) and self.place(again) is not None:
            chains.append(self.chain(held))
        best = max(chains, key=_gained)
        left = {self._set_of(c): self._left(c) for c in chains}
        whole_ones = [c for c in chains if not left[self._set_of(c)]]
        if whole_ones and left[self._set_of(best)]:
            best = max(whole_ones, key=_gained)
            self._follow(best, left)
        self.scores.setdefault(self._set_of(best), _gained(best))
        return self._as_few(best, chains)

    def _as_few(self, best: list[Finding], chains: Sequence[list[Finding]]) -> list[Finding]:
        """
        Return the best set of what stood out that leaves nothing, as a chain does, and no larger.

        Of two that bend a view to and fro each alone gains little, and less than a third that does
        some of both: what then is added to that may be three for two. Where it is two it may be
        another two, so that the last of them seems to be either. What members gain, each at its
        place, is more than they do together: it is by that that sets are compared.

        """
        tell, known = [f for f in best if _bends(f)], self._set_of(best)
        sure = self.scores[known] - float(np.log(rules.SURE / (1 - rules.SURE)))
        doubted = any(v > sure and k != known for k, v in self.scores.items())
        if len(tell) < 2 or len(tell) < 3 and not doubted or self._left(best):
            return best
        other = [f for f in best if not _bends(f)]
        worth: dict[frozenset[str], float] = {}
        found, least = best, len(best)
        for chain in [*([*other, *some] for some in islice(self._sets(tell, chains), SETS)), best]:
            if len(chain) > least and chain is not best:
                continue    # what fewer explain needs no more
            here = self.place(self.model_of(chain))
            if here is None or here.fit.supported is None or self._left(chain):
                continue
            least, whole = min(least, len(chain)), self._set_of(chain)
            worth[whole] = here.fit.supported - sum(
                f.penalty + rules.PRICE * f.shapes for f in chain)
            if worth[whole] >= max(worth.values()):
                found = chain
        if not worth:
            return best
        whole, most = self._set_of(found), max(self.scores.values())
        if found is not best:
            self.scores = {k: v for k, v in self.scores.items() if not k > whole}
        self.scores.update({k: most + v - worth[whole] for k, v in worth.items()})
        return found

    def _sets(self, members: list[Finding], chains: Iterable[list[Finding]],
              ) -> Iterator[tuple[Finding, ...]]:
        """Yield sets of two and more of what bent the spectrum on the way, as many at most."""
        stood = [f for c in chains for i in range(len(c)) for f in (c[i], *self._rivals(c, i))]
        named = {f.name: f for f in reversed([*members, *(f for f in stood if _bends(f))])}
        for size in range(2, len(members) + 1):
            yield from combinations(reversed(named.values()), size)

    def _begun(self, begin: list[Finding], main: Sequence[Finding]) -> list[Finding]:
        """
        Return what a chain may begin with, nothing where its last does not heal what it claims.

        By itself, or with that of those behind it in the main chain which lowers the error most.

        """
        members, last = begin[:-1], begin[-1]
        if self._heals(members, last) and self._lowers(members, last):
            return begin
        before = self.model_of(members)
        said = [(g, *self._unlowered(before, self.model_of([*begin, g]), _both(last, g)))
                for g in main[len(begin):] if _pairs(last, g)]
        g, _, against = max(said, key=lambda z: z[1], default=(last, 0.0, _DOUBT))
        against = against or self._unhealed(before, self.model_of([*begin, g]), _both(last, g))
        return [] if against else [*begin, g]

    def _left(self, chain: Iterable[Finding]) -> float:
        """Return what fails after a chain, nats."""
        return float(sum(f.gain for f in failures(self.tests(self.model_of(chain)))))

    def _follow(self, best: Sequence[Finding], left: Mapping[frozenset[str], float]) -> None:
        """
        Give what leaves something the less surplus for it than a chain that leaves nothing.

        What members gain, each at its place, is more than they do together where noise stretches
        over what they leave. What differs from the best in its last member was not tried.

        """
        whole, others = self._set_of(best), self._set_of(best[:-1])
        most = _gained(best) - min(v for v in left.values() if v > 0)
        for k in self.scores:
            if left.get(k, not others < k or len(k) > len(whole)):
                self.scores[k] = min(self.scores[k], most)
        self.scores[whole] = _gained(best)

    def _rivals(self, chain: list[Finding], i: int) -> list[Finding]:
        """Return what stood out at a place of a chain and is explained away by what was chosen."""
        place, after = (self.place(self.model_of(chain[:k])) for k in (i, i + 1))
        if place is None or after is None or not after.candidates:
            return []
        still = {f.name for f in self.able(after)} | {f.name for f in chain[i:]}
        return [f for f in self.able(place) if f.name not in still]

    # --- backward ---------------------------------------------------------------------------

    def settled(self) -> list[Finding]:
        """
        Return the chain that holds, each member with its probability at its place.

        A member that shares its probability with rivals stays, with what speaks against it.

        """
        chain: list[Finding] = []
        more = True
        for turn in count(1):
            self._aside = {}
            # in the end nothing is added, and what was left must hold without what fell
            chain = self.with_odds(self.forward(chain) if more else chain)
            refuted = self.backward(chain, last=turn >= ROUNDS)
            if not refuted:
                break
            chain = [f for k, f in zip(self.labels_of(chain), chain) if k not in refuted]
            self.refuted.update(refuted)
            for k, f in refuted.items():
                self._disproved.setdefault(k, []).append(f)
            more = self._acquitted(self.model_of(chain), refuted) or turn < ROUNDS
        # each held beside the others when it was last looked at
        self.refuted = {**{k: f for k, f in self._aside.items() if k not in self.labels_of(chain)},
                        **self.refuted}
        return chain

    def _acquitted(self, model: Model, refuted: Collection[str]) -> bool:
        """
        Take back what was doubted beside what is refuted now.

        Of two that do the same the one that was kept has fallen, for another reason. Each is taken
        back once.

        """
        back = []
        for k, others in self._beside.items():
            if k in self.refuted and not others.isdisjoint(refuted):
                f = self.refuted[k]
                more = model.plus(_new(f))
                if not self._unconfirmed(more, more.labels[-1], f)[1]:
                    del self.refuted[k]
                    back.append(k)
        self._beside.update((k, frozenset()) for k in back)
        return bool(back)

    def backward(self, chain: list[Finding], last: bool = True) -> dict[str, Finding]:
        """
        Return the members by label, with what speaks against each, that do not hold.

        Unless it is the last look, none is refuted for what another one left when it was refuted
        itself: a candidate that was not tried yet may explain that.

        """
        labels, model = self.labels_of(chain), self.model_of(chain)
        members = dict(zip(labels, chain))
        out: dict[str, Finding] = {}
        doubted = list(members)     # what holds beside more holds beside less
        while doubted:
            said = {k: self._unconfirmed(model, k, members[k]) for k in doubted}
            doubted = [k for k in doubted if said[k][1]]
            if doubted:
                # of two that do the same, the one that something else could imitate
                worst = min(doubted, key=lambda k: (said[k][0], _certain(members[k])))
                doubted.remove(worst)
                out[worst] = replace(members.pop(worst), against=said[worst][1])
                self._beside.setdefault(worst, frozenset(members))
                model = model.minus(worst)
        place, later = self.base, list(members.values())
        bent: dict[str, str] = {}   # the last one with another shape, of each that they share
        for k, f in members.items():
            before, place, later = place, place.plus(_new(f)), later[1:]
            against = self._unhealed_with(before, place, f, later)
            if not against and (against := self._shaped(model, k, f)):
                # what they leave together is held against each: the last one is asked first
                assert f.effect is not None
                shared = f.view if f.effect.paired else f.name
                if not last:
                    out.pop(bent.get(shared, ''), None)
                bent[shared] = k
                if f.effect.stays:
                    self._nameless[k] = f
            against = against or self._stands_in([g for j, g in members.items() if j not in out],
                                                 model, k, f)
            if against:
                out[k] = replace(f, against=against)
        for k, f in members.items() if last or not out else ():
            against = self._shadowed(model, f)
            if against:
                out.setdefault(k, replace(f, against=against))
        return out

    def labels_of(self, chain: Iterable[Finding]) -> list[str]:
        """Return the labels of a chain's members."""
        return self.model_of(chain).labels[len(self.base):]

    def _unconfirmed(self, model: Model, name: str, finding: Finding) -> tuple[float, str]:
        """Return by how much a member lowers the error beside the others, and what if not."""
        return self._unlowered(model.minus(name), model, finding)

    def _unlowered(self, without: Model, model: Model, finding: Finding) -> tuple[float, str]:
        """Return by how much a finding lowers the error from one model to another; what if not."""
        after, before = self.error(model), self.error(without)
        if after is None or before is None or finding.effect is None:
            return -np.inf, 'a part of the record cannot hold it'
        fall = fall_of(before, after, [finding.effect])
        if fall > rules.FALL:
            return fall, ''
        if fall >= 0:
            return fall, (f'{_DOUBT}: their deviance falls by {fall:.1f}, chance reaches '
                          f'{rules.FALL:.0f}')
        return fall, f'it raises the held-out deviance by {-fall:.1f}'

    def _unhealed(self, before_it: Model, after_it: Model, finding: Finding) -> str:
        """
        Say that the view a member claims to heal does not gain at its place what it claims.

        Nor do all views together in which it is judged: what one of them shows of a member may be
        little beside what something else leaves there. Nor do the data become likelier by it:
        where noise was taken for what several effects do, with one of them there is less of it,
        and beside less noise the others stand out as much as both did.

        """
        assert finding.effect is not None
        without = self.tests(before_it)
        if not finding.effect.counted or finding.view not in {f.view for f in failures(without)}:
            return ''
        with_it = self.tests(after_it)
        shown, said = {f.view for f in with_it}, ''
        if finding.view not in shown:
            return f'it hides the view {finding.view} and does not heal it'
        for views in ({finding.view}, {finding.view, *finding.effect.views} & shown):
            before, after = (sum(max(f.gain, 0.0) for f in tests if f.view in views)
                             for tests in (without, with_it))
            claim = min(finding.gain - finding.elsewhere, before)
            if before - after >= rules.HEALED * claim:
                return ''
            said = said or (f'it claims {claim:.0f} nats of what fails in {finding.view} and '
                            f'heals {max(before - after, 0):.0f}')
        likelier = _likelier(without, with_it, finding.view)
        return '' if likelier > 0 and likelier >= rules.HEALED * finding.gain else said

    def _unhealed_with(self, before: Model, after: Model, finding: Finding,
                       later: Iterable[Finding]) -> str:
        """
        Say :meth:`_unhealed`, unless it heals what it claims beside another.

        Where noise is stretched over a mean and over what adds noise, neither shows what it does
        until the other is there: the view must fail beside the other one too. Of two means either
        may do what the other claims, so that together they must heal what both claim.

        """
        against = self._unhealed(before, after, finding)
        if not against or finding.effect is None or not (
                finding.effect.paired or finding.effect.uncovers):
            return against
        for g in later:
            other, both = before.plus(_new(g)), after.plus(_new(g))
            if finding.view in {f.view for f in failures(self.tests(other))} \
                    and not self._unhealed(other, both, finding) \
                    and not (_pairs(finding, g)
                             and self._unhealed(before, both, _both(finding, g))):
                return ''
        return against

    def _shaped(self, model: Model, name: str, finding: Finding) -> str:
        """Say that a flexible form does better in a member's place."""
        return self.problem.shape(self.problem.point(model), name, finding.gain)

    def _stands_in(self, members: list[Finding], model: Model, name: str,
                   finding: Finding) -> str:
        """
        Say that a member only stands for what is there, though by no name that is known.

        Beside that and the members before it, it does not stand out; where no candidates are begun
        it is not needed. What nothing could imitate, or others yield to, stands for itself.

        """
        assert finding.effect is not None
        if finding.effect.certain or finding.effect.paired:
            return ''
        before = members[:members.index(finding)]
        for other in (f for k, f in self._nameless.items() if k not in model):
            place = self.place(self.model_of([other, *before]))
            if place is not None and place.candidates:
                # its label may be that of one of its name that was refuted
                there = any(f.name == finding.name and not f.against and f.gain > f.penalty
                            for f in place.candidates)
            else:
                more = model.plus(_new(other))
                there = not self._unlowered(more.minus(name), more, finding)[1]
            if not there:
                return f'beside what {other.name} tells, though it is none, it explains nothing'
        return ''

    def _shadowed(self, model: Model, finding: Finding) -> str:
        """Say that far more fails elsewhere than a finding explains, and nothing explains that."""
        assert finding.effect is not None
        left = sum(f.gain for f in failures(self.tests(model)) if f.view != finding.view)
        if finding.effect.certain or left <= rules.SHADOW * finding.gain:
            return ''
        return (f'it explains {finding.gain:.0f} nats, and {left:.0f} that fail elsewhere nothing '
                'does')

    # --- what is said -----------------------------------------------------------------------

    def with_odds(self, chain: list[Finding]) -> list[Finding]:
        """Return a chain with probabilities, shares explained, and rivals where they matter."""
        out, model = [], self.base
        whole, members = self._failing(self.base, self.base), self.labels_of(chain)
        for f, name in zip(chain, members):
            before, model = model, model.plus(_new(f))
            sure, rivals = self._odds(before, name)
            explains = None
            if whole > 0:
                fall = self._failing(before, self.base) - self._failing(model, self.base)
                explains = float(np.clip(fall / whole, 0, 1))
            rivals = [x for x in rivals if x not in members]
            against = '' if sure >= rules.SURE else \
                f'{rules.CANNOT_TELL} {" or ".join(rivals) or "nothing"}'
            out.append(replace(f, probability=sure, explains=explains, against=against))
        return out

    def _failing(self, model: Model, base: Model) -> float:
        """Return what fails in the views that fail under the base model, nats."""
        views = {f.view for f in failures(self.tests(base))}
        return float(sum(max(f.gain, 0.0) for f in self.tests(model) if f.view in views))

    def _odds(self, before: Model, name: str) -> tuple[float, list[str]]:
        """Return a member's probability at its place, and the rivals that take the rest."""
        here = frozenset(before.labels)
        some = {k - here: v for k, v in self.scores.items() if k >= here}
        top = max(some.values())
        weight = {k: float(np.exp(max(v - top, -700.0))) for k, v in some.items()}
        total = sum(weight.values())
        with_it = sum(v for k, v in weight.items() if name in k)
        others: dict[str, float] = {}
        for k, v in weight.items():
            if name not in k:
                for x in k:
                    others[x] = others.get(x, 0.0) + v
        # those that come together have the same: a set's own order differs from run to run
        rivals = [x for x in sorted(others, key=lambda x: (-others[x], x))
                  if others[x] > 0.02 * total]
        return with_it / total, rivals[:3]

    def remaining(self, model: Model) -> Remaining | None:
        """Return what fails with a model; None where nothing does."""
        failed = failures(self.tests(model))
        error = None if failed else self.error(model)
        failed = failed or (beyond_chance(error) if error is not None else [])
        if not failed:
            return None
        place = self.place(model)
        weighed = (None, None, None) if place is None else self.problem.materiality(place.fit)
        near = [*self.refuted.values(), *(place.candidates if place else ())]
        near = [f for f in near if f.gain > f.penalty]
        nearest = max(near, key=surplus, default=None)
        return Remaining(tuple(failed), *weighed, nearest)

    def ranking(self, chain: list[Finding]) -> list[Finding]:
        """
        Return the candidates: what was found, and the rest by probability.

        What was refuted stands before what gains no more than chance. Each name is listed once,
        but for what was found more than once.

        """
        found = [f for f in chain if not f.against]
        refuted = [f if f.against.startswith(_DOUBT) else replace(f, probability=0.0)
                   for f in sorted(self.refuted.values(), key=lambda f: -surplus(f))]
        first = self.place(self.base)
        other = [replace(f, probability=self._odds(self.base, label(self.base, f))[0])
                 for f in (first.candidates if first is not None else ())
                 if label(self.base, f) not in self.refuted]
        rest = sorted([*(f for f in chain if f.against), *refuted, *other],
                      key=lambda f: (f.gain <= f.penalty, -(f.probability or 0.0)))
        out, seen = found, {f.name for f in found}
        for f in rest:
            if f.name not in seen:
                out.append(f)
                seen.add(f.name)
        return out[:LISTED]


def label(model: Model, finding: Finding) -> str:
    """Return the label that a finding would have in a model."""
    return model.plus(_new(finding)).labels[-1]


def _elsewhere(one: Finding, other: Finding) -> bool:
    """Tell whether two findings of a name differ by more than FAR times in what they look for."""
    assert one.effect is not None and other.effect is not None
    scales = [p.name for p in one.effect.parameters if p.log and not (
        p.amplitude or p.linear or p.discrete or p.choices)]
    pairs = [(one.effect.values.get(k, 0.0), other.effect.values.get(k, 0.0)) for k in scales]
    return any(min(pair) > 0 and max(pair) > FAR * min(pair) for pair in pairs)


def _certain(finding: Finding) -> bool:
    """Tell whether nothing else could imitate what shows a finding."""
    return finding.effect is not None and finding.effect.certain


def _bends(finding: Finding) -> bool:
    """Tell whether a finding bends a view that others of its kind bend as well."""
    return finding.effect is not None and finding.effect.uncovers and not finding.effect.certain


def _new(finding: Finding) -> Effect:
    """Return the effect of a finding, not fitted."""
    assert finding.effect is not None
    return type(finding.effect)()


def _likelier(without: Iterable[Finding], with_it: Iterable[Finding], view: str) -> float:
    """Return by how much likelier a view's data are by some tests than by others, nats."""
    before, after = ([f.log_score for f in tests if f.view == view]
                     for tests in (without, with_it))
    if len(before) != len(after):
        return 0.0
    return sum(0.5 * (b - a) for b, a in zip(before, after) if b is not None and a is not None)


def _yields(one: Finding, other: Finding) -> bool:
    """Tell whether one of two findings explains whatever the other one does in several axes."""
    return one.effect is not None and other.effect is not None \
        and one.effect.yields and other.effect.paired


def _pairs(one: Finding, other: Finding) -> bool:
    """
    Tell whether one of two findings may hide the other one in the view of both.

    Or whether beside the first there is less noise, under which a mean is hidden.

    """
    if one.effect is None or other.effect is None:
        return False
    if one.effect.uncovers and other.effect.paired:
        return True
    return one.view == other.view and (one.effect.paired and other.effect.paired
                                       or one.effect.uncovers and other.effect.uncovers)


def _both(one: Finding, other: Finding) -> Finding:
    """Return what two findings claim together."""
    return replace(one, gain=one.gain + other.gain, elsewhere=one.elsewhere + other.elsewhere)


def _gained(chain: Iterable[Finding]) -> float:
    """Return the surplus of a chain's members together."""
    return float(sum(surplus(f) for f in chain))


def surplus(finding: Finding) -> float:
    """
    Return what a finding gains beyond chance, nats.

    A form with more to choose must be that much better: of nested names with equal gain the
    simpler one holds.

    """
    return finding.gain - finding.penalty - rules.PRICE * finding.shapes


def beyond_chance(error: Score) -> list[Finding]:
    """Return what of a held-out deviance chance does not explain, as tests that fail."""
    return [Finding(k, 0.5 * max(v.over, 0.0) * len(v.pull), view=k,
                    p_value=rules.tail(v.over, v.std), evidence='on data not fitted')
            for k, v in ((k, error.views[k]) for k in error.failing)]


def failures(findings: Iterable[Finding], level: float = rules.LEVEL) -> list[Finding]:
    """Return the tests that fail at a family-wise level (Holm 1979)."""
    tests = list(findings)
    values = [1.0 if f.p_value is None else f.p_value for f in tests]
    return [tests[i] for i in rules.failing(values, level)]
