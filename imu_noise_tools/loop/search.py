# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The search for what is missing from a model: forward along chains of candidates, then backward.

Several effects may be missing at once, and what explains a part is worth finding though the rest
goes on failing. The search goes forward: the most probable candidate into the model, refitted, and
on from there until nothing is gained beyond chance; where a rival is explained away by what was
chosen, a chain that begins with the rival is followed as well. Then backward: each member must
lower the held-out deviance beside all the others, heal what it claims to heal, be as
good as a flexible form in its place, and not stand in the shadow of what nothing explains.

"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, count, islice

import numpy as np

from . import verdict as rules
from .against import DOUBT
from .chains import Chains
from .effect import Finding, Model
from .findings import (
    bends, certain, fresh, gained, is_line, label, nameless, outweighs, pairs, surplus, together
)
from .prediction import State

FROM_NOTHING = f'{rules.CANNOT_TELL} nothing'
CHAINS = 2  # chains that are followed, rivals' included
FOLLOWED = 3  # members from which one is not followed on, if its end was not looked at
NEAR = 0.1  # share of the surplus of what was chosen from which a rival is followed
SETS = 12  # of what stood out that are tried in a chain's place
ALIKE = 1.001  # ratio of two probabilities that are the same but for rounding
ROUNDS = 4  # times the search begins anew without what was refuted, unless something came back


class Search(Chains):
    """Which chain holds, and what was refuted on the way."""

    def __init__(self, state: State, tried: Iterable[Finding] = ()):
        super().__init__(state, tried)
        self._nameless: dict[str, Finding] = {}     # is there, but in no form that is known
        self._beside: dict[str, frozenset[str]] = {}  # what is doubted, beside what
        self._fell: dict[str, dict[str, Finding]] = {}  # what has another shape, beside what

    # --- forward ----------------------------------------------------------------------------

    def _explained_away(self, members: list[Finding], some: Iterable[Finding]) -> None:
        """
        Refute what yielded to members of a chain and does not stand out beside them.

        Or, where no more candidates are begun, is not needed there.

        """
        here = self.places.model_of(members)
        place = self.places.at(here)
        for f in (f for f in some if f.name not in here):
            more = here.plus(fresh(f))
            name = more.labels[-1]
            there = place is not None and (f.name in {g.name for g in self.able(place)}
                                           if place.candidates else
                                           not self.against.unlowered(here, more, f)[1])
            if not there:
                assert f.effect is not None
                self.refuted[name] = replace(
                    f, against=f'beside {f.effect.yields} it explains nothing')
                self.scores = {k: v for k, v in self.scores.items() if name not in k}
                self._beside.setdefault(name, frozenset(self.places.labels_of(members)))

    def forward(self, held: Sequence[Finding] = ()) -> list[Finding]:
        """
        Return the best of the chains: the main one, those that begin with a rival, and ``held``.

        One that leaves only views that the other one leaves as well, and fewer, goes before it,
        whatever they gain. What an earlier chain held may not be reached without what was refuted
        in it.

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
        whole = self.places.set_of(main)
        able = (b for b in (self._begun(b, main) for _, b in begun) if b)
        for begin in islice(able, CHAINS - 1):
            known = dict(self.scores)
            other = self.chain(begin)
            # a rival with all of the main chain beside it: from there it was seen to gain nothing
            if whole < self.places.set_of(other):
                self.scores = known     # nor is what the chain lacked on its way there a rival
            else:
                chains.append(other)
        self.scores = {k: v for k, v in self.scores.items() if k == whole or not whole < k
                       or len(k) == len(whole) + 1}
        held = [f for f in held if f.effect is not None
                and (f.effect.several or f.name not in self.refuted)]
        again = self.places.model_of(held)
        new = len(held) > 1 and not whole.issuperset(again.labels)
        total = {self.places.set_of(c): gained(c) for c in chains}
        if new and self.places.at(again) is not None:
            chains.append(self.chain(held))
            here = self.places.set_of(chains[-1])
            total.setdefault(here, self._gained_anew(chains[-1], main))
            self.scores[here] = max(total[here], self.scores.get(here, -np.inf))
        for chain in self._without_a_name(chains):
            chains.append(chain)
            total.setdefault(self.places.set_of(chain), gained(chain))
        best = max(chains, key=lambda c: total[self.places.set_of(c)])
        left = {self.places.set_of(c): self.places.left(c) for c in chains}
        fewer = [c for c in chains if left[self.places.set_of(c)] < left[self.places.set_of(best)]
                 and self.places.views_left(c) < self.places.views_left(best)]
        if fewer:
            best = max(fewer, key=gained)
            self._follow(best, left)
        best = self._continued(best)
        self.scores.setdefault(self.places.set_of(best), gained(best))
        self._less_by_what_is_left(best, chains)
        return self._as_few(best, chains)

    def _less_by_what_is_left(self, best: Sequence[Finding],
                              chains: Iterable[list[Finding]]) -> None:
        """
        Let a chain that leaves something count, beside one that leaves nothing, by its fit.

        What its members gain, each at its place, says nothing of what they leave together.

        """
        if self.places.left(best):
            return
        whole = self.places.set_of(best)
        for chain in chains:
            here = self.places.set_of(chain)
            if here == whole or not self.places.left(chain):
                continue
            less = self._worth(chain) - self._worth(best)
            fall = self.scores.get(here, -np.inf) - self.scores[whole] - less
            if np.isfinite(fall) and fall > 0:
                self.scores = {k: v - fall if here <= k and not whole <= k else v
                               for k, v in self.scores.items()}

    def _continued(self, chain: list[Finding]) -> list[Finding]:
        """
        Return a chain that leaves something with what the effort did not reach behind it.

        Of few members: then it went into what came to nothing. Of many it is spent.

        """
        if len(chain) >= FOLLOWED or not self.places.overlooked(chain) \
                or not self.places.left(chain):
            return chain
        self.places.look_further(rules.ANEW)
        return self.chain(chain)

    def _gained_anew(self, held: Sequence[Finding], main: Sequence[Finding]) -> float:
        """
        Return the surplus of a chain that was held, by what it explains more than another one.

        Its members were found beside what has fallen since, and gain something else without it.

        """
        more = self._worth(held) - self._worth(main)
        return max(gained(held), gained(main) + more) if np.isfinite(more) else gained(held)

    def _exchanged(self, chain: list[Finding]) -> list[Finding]:
        """
        Return a chain with members exchanged for what gains more beside all the others.

        What came first explained what of another one it could, before that one was there; it is
        asked again beside it (sequential replacement: Miller, Subset Selection, chapter 3). So is
        what fell beside one that is gone: without that it may explain more.

        """
        seen = {self.places.set_of(chain)}
        i = 0
        while i < len(chain):
            other = [f for k, f in enumerate(chain) if k != i]
            gone = self._gone(chain)
            names = self.places.problem.exchanges(
                chain[i].effect, [f.effect for f in (*chain[i + 1:], *sum(gone.values(), []))])
            back = {k: self.refuted.pop(k) for k in gone if self.refuted[k].name in names}
            place = self.places.at(self.places.model_of(other)) if names else None
            able = self.able(place) if place is not None else []
            found = self._first(other, (f for f in able if f.name in names), set())
            more = self._along([f.name for f in (*other, *found)]) if found else []
            if more and self.places.set_of(more) not in seen:
                seen.add(self.places.set_of(more))
                chain, i = more, 0
            else:
                self.refuted.update(back)
                i += 1
        return chain

    def _gone(self, chain: Sequence[Finding]) -> dict[str, list[Finding]]:
        """Return those of a chain that are no more in it beside which something fell, by that."""
        here = self.places.set_of(chain)
        gone = {k: [f for j, f in others.items() if j not in here]
                for k, others in self._fell.items() if k in self.refuted}
        return {k: some for k, some in gone.items() if some}

    def _as_few(self, best: list[Finding], chains: Sequence[list[Finding]]) -> list[Finding]:
        """
        Return the best set of what stood out that leaves nothing, as a chain does, and no larger.

        Of two that bend a view to and fro each alone gains little, and less than a third that does
        some of both: what then is added to that may be three for two. Where it is two it may be
        another two, so that the last of them seems to be either. What members gain, each at its
        place, is not what they gain together, and goes with the way there: it is by that that sets
        are compared, another chain's too that differs only in what bends the view or is certain,
        or has fewer members.

        """
        tell, known = [f for f in best if bends(f)], self.places.set_of(best)
        sure = self.scores[known] - float(np.log(rules.SURE / (1 - rules.SURE)))
        doubted = any(v > sure and k != known for k, v in self.scores.items())
        other = [f for f in best if not bends(f)]
        tried: list[list[Finding]] = []
        if len(tell) > 2 or len(tell) > 1 and doubted:
            tried += [[*other, *some] for some in islice(self._sets(tell, chains), SETS)]
        same = self.places.set_of(f for f in other if not certain(f))
        tried += [c for c in chains if self.places.set_of(c) != known and (
            len(c) < len(best) or same == self.places.set_of(
                f for f in c if not (bends(f) or certain(f))))]
        if not tried or self.places.left(best):
            return best
        compared = self._all_worth(best, tried)
        if not compared:
            return best
        found = max(reversed(compared), key=lambda z: z[1])[0]
        worth = {self.places.set_of(chain): explains for chain, explains in compared}
        whole, most = self.places.set_of(found), max(self.scores.values())
        # what follows a set was said of what it gained on its way
        self.scores = {k: v for k, v in self.scores.items() if not any(
            k > s for s in worth if s != whole or found is not best)}
        self.scores.update({k: most + v - worth[whole] for k, v in worth.items()})
        return found

    def _all_worth(self, best: list[Finding], tried: Iterable[list[Finding]],
                   ) -> list[tuple[list[Finding], float]]:
        """
        Return chains that leave nothing, the best one last, and what each is worth.

        Nothing in the views that the best one shows: what it hides it leaves no less. None is
        larger than one before it but the best. Lines gain what they do at their places, by what is
        there beside them, and where nothing is left they explain the same.

        """
        shown = {f.view for f in self.places.tests(self.places.model_of(best))}
        found: list[tuple[list[Finding], float]] = []
        least = len(best)
        for chain in [*tried, best]:
            if len(chain) > least and chain is not best:
                continue    # what fewer explain needs no more
            explains = self._worth(chain)
            if np.isfinite(explains) and not self.places.views_left(chain) & shown:
                least = min(least, len(chain))
                found.append((chain, explains))
        lines = [sum(f.gain for f in chain if is_line(f)) for chain, _ in found]
        return [(chain, explains + (max(lines) - gain if gain else 0.0))
                for (chain, explains), gain in zip(found, lines)]

    def _sets(self, members: list[Finding], chains: Iterable[list[Finding]],
              ) -> Iterator[tuple[Finding, ...]]:
        """Yield sets of two and more of what bent the spectrum on the way, as many at most."""
        stood = [f for c in chains for i in range(len(c)) for f in (c[i], *self._rivals(c, i))]
        named = {f.name: f for f in reversed([*members, *(f for f in stood if bends(f))])}
        for size in range(2, len(members) + 1):
            yield from combinations(reversed(named.values()), size)

    def _begun(self, begin: list[Finding], main: Sequence[Finding]) -> list[Finding]:
        """
        Return what a chain may begin with, nothing where its last does not heal what it claims.

        By itself, or with another one that lowers the error most: of those behind it in the main
        chain, or, where that leaves something, of those that stand out beside the rival.

        """
        members, last = begin[:-1], begin[-1]
        if self._heals(members, last) and self._lowers(members, last):
            return begin
        before, others = self.places.model_of(members), list(main[len(begin):])
        if self.places.left(main):
            beside = self.places.at(self.places.model_of(begin))
            others += self.able(beside)[:2] if beside is not None else []
        said = [(g, *self.against.unlowered(
            before, self.places.model_of([*begin, g]), together(last, g)))
            for g in others if pairs(last, g)]
        g, _, against = max(said, key=lambda z: z[1], default=(last, 0.0, DOUBT))
        if against:
            return []
        after = self.places.model_of([*begin, g])
        if self.against.unhealed(before, after, together(last, g)):
            return []
        return [*members, self.places.beside_others(last, label(before, last), after), g]

    def _without_a_name(self, chains: Sequence[list[Finding]]) -> list[list[Finding]]:
        """
        Return the chain that begins with what has no name, where each chain leaves something.

        What has a name stands before it, and may leave what neither explains beside it. Not where
        one in the main chain has the place: its form is asked first. Nor where what that leaves is
        in no view that would show it.

        """
        if not all(map(self.places.left, chains)):
            return []
        place = self.places.at(self.places.base)
        first = [f for f in self.able(place) if nameless(f)][:1] if place is not None else []
        if not first or any(nameless(c[0]) for c in chains if c) \
                or first[0].view not in self.places.views_left(chains[0]):
            return []
        # the main chain is fitted by now, and asking it costs nothing
        main = self.places.fit(self.places.model_of(chains[0]))
        if first[0].effect is None or first[0].effect.part_of(main.model) or not (
                self._heals([], first[0]) and self._lowers([], first[0])):
            return []
        self.places.look_further(rules.ANEW)    # behind it lies what no other chain has seen
        return [self.chain(first)]

    def _follow(self, best: Sequence[Finding], left: Mapping[frozenset[str], float]) -> None:
        """
        Give what leaves more the less surplus for it than a chain that leaves less.

        What members gain, each at its place, is more than they do together where noise stretches
        over what they leave. What differs from the best in its last member was not tried.

        """
        whole, others = self.places.set_of(best), self.places.set_of(best[:-1])
        more = {k: v - left[whole] for k, v in left.items() if v > left[whole]}
        most = gained(best) - min(more.values())
        for k in self.scores:
            tried = any(k <= other for other in more)
            if tried or k not in left and (not others < k or len(k) > len(whole)):
                self.scores[k] = min(self.scores[k], most)
        self.scores[whole] = gained(best)

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
            if more:
                chain = self.forward(chain)
                chain = self._exchanged(chain)
            chain = self.with_odds(chain)
            refuted = self.backward(chain, last=turn >= ROUNDS)
            if not refuted:
                break
            chain = [f for k, f in zip(self.places.labels_of(chain), chain) if k not in refuted]
            self.refuted.update(refuted)
            # without what explained far more than all that is left it is another search
            most = max(refuted.values(), key=lambda f: f.gain)
            anew = chain and all(outweighs(most, f) for f in chain)
            self.places.look_further(self.places.problem.looks if anew else rules.ANEW)
            for k, f in refuted.items():
                self._disproved.setdefault(k, []).append(f)
            more = self._acquitted(self.places.model_of(chain), refuted) or turn < ROUNDS
        # each held beside the others when it was last looked at
        kept = self.places.labels_of(chain)
        self.refuted = {**{k: f for k, f in self._aside.items() if k not in kept},
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
                more = model.plus(fresh(f))
                if not self.against.unconfirmed(more, more.labels[-1], f)[1]:
                    del self.refuted[k]
                    back.append(k)
        self._beside.update((k, frozenset()) for k in back)
        return bool(back)

    def backward(self, chain: list[Finding], last: bool = True) -> dict[str, Finding]:
        """
        Return the members by label, with what speaks against each, that do not hold.

        Unless it is the last look, none is refuted for what another one left when it was refuted
        itself: a candidate that was not tried yet may explain that. Nor is what explains little
        judged where far more has fallen.

        """
        labels, model = self.places.labels_of(chain), self.places.model_of(chain)
        members = dict(zip(labels, chain))
        out: dict[str, Finding] = {}
        doubted = list(members)     # what holds beside more holds beside less
        while doubted:
            said = {k: self.against.unconfirmed(model, k, members[k]) for k in doubted}
            doubted = [k for k in doubted if said[k][1]]
            if doubted:
                # of two that do the same, the one that something else could imitate
                worst = min(doubted, key=lambda k: (said[k][0], certain(members[k])))
                doubted.remove(worst)
                out[worst] = replace(members.pop(worst), against=said[worst][1])
                self._beside.setdefault(worst, frozenset(members))
                model = model.minus(worst)
        fallen = bool(out)
        gone = [] if last else [*out.values()]
        told = self._told(model, members)
        place, later = self.places.base, list(members.values())
        bent: dict[str, str] = {}   # the last one with another shape, of each that they share
        for k, f in members.items():
            before, place, later = place, place.plus(fresh(f)), later[1:]
            more = gone if last else [*gone, *(g for j, g in members.items() if j in out)]
            if any(outweighs(g, f) for g in more):     # without it nothing shows what this one is
                continue
            against = self.against.unhealed_with(before, place, f, later)
            if against and fallen and not self.against.unhealed(model.minus(k), model, f):
                against = ''    # what has fallen held its place
            if not against and (against := self.against.shaped(model, k, f) or (
                    k in told and told != model and self.against.shaped(told, k, f))):
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
                self._fell[k] = {j: g for j, g in members.items() if j != k}
        for k, f in members.items() if last or not out else ():
            against = self.against.shadowed(model, k, f)
            if against:
                out.setdefault(k, replace(f, against=against))
        return out

    @staticmethod
    def _told(model: Model, members: Mapping[str, Finding]) -> Model:
        """Return a model without what the record cannot tell from nothing: it is not named."""
        for k, f in members.items():
            if f.against == FROM_NOTHING:
                model = model.minus(k)
        return model

    def _stands_in(self, members: list[Finding], model: Model, name: str,
                   finding: Finding) -> str:
        """
        Say that a member only stands for what is there, though by no name that is known.

        Beside that and the members before it, it does not stand out; where no candidates are begun
        it is not needed. What nothing could imitate, or others yield to, stands for itself.

        """
        assert finding.effect is not None
        if finding.effect.certain or finding.effect.paired or finding.effect.sharp:
            return ''
        before = members[:members.index(finding)]
        for other in (f for k, f in self._nameless.items() if k not in model):
            place = self.places.at(self.places.model_of([other, *before]))
            if place is not None and place.candidates:
                # its label may be that of one of its name that was refuted
                there = any(f.name == finding.name and not f.against and f.gain > f.penalty
                            for f in place.candidates)
            else:
                more = model.plus(fresh(other))
                there = not self.against.unlowered(more.minus(name), more, finding)[1]
            if not there:
                return f'beside what {other.name} tells, though it is none, it explains nothing'
        return ''

    # --- probabilities ----------------------------------------------------------------------

    def with_odds(self, chain: list[Finding]) -> list[Finding]:
        """Return a chain with probabilities, shares explained, and rivals where they matter."""
        self._less_by_parts(chain)
        out, model = [], self.places.base
        whole, members = self.places.failing(model), self.places.labels_of(chain)
        for f, name in zip(chain, members):
            before, model = model, model.plus(fresh(f))
            sure, rivals = self.odds(before, name)
            if sure < rules.SURE and is_line(f):
                f, sure, rivals = self._plainest(before, f, name, sure, rivals)
            explains = None
            if whole > 0:
                fall = self.places.failing(before) - self.places.failing(model)
                explains = float(np.clip(fall / whole, 0, 1))
            rivals = [x for x in rivals if x not in members]
            against = '' if sure >= rules.SURE else \
                f'{rules.CANNOT_TELL} {" or ".join(rivals)}' if rivals else FROM_NOTHING
            out.append(replace(f, probability=sure, explains=explains, against=against))
        return out

    def _less_by_parts(self, chain: Sequence[Finding]) -> None:
        """
        Let no part of a chain count for more than it explains beside the whole.

        What two share each may gain by itself: with what it gained there, one of them without the
        other would be worth more than both.

        """
        own, labels = self.places.set_of(chain), self.places.labels_of(chain)
        most = self.scores.get(own, np.inf)     # of what is left of a chain none may be known
        for part in [k for k, v in self.scores.items() if k < own and v > most]:
            some = [f for f, name in zip(chain, labels) if name in part]
            if self.places.set_of(some) != part:    # its labels are others beside the whole
                continue
            less = self._worth(chain) - self._worth(some)
            if np.isfinite(less):
                self.scores[part] = min(self.scores[part], most - less)

    def _plainest(self, before: Model, finding: Finding, name: str, sure: float,
                  rivals: list[str]) -> tuple[Finding, float, list[str]]:
        """
        Return of a line and rivals that are lines the plainest, its probability and its rivals.

        Whether a strong line comes alone or with faint ones of its machine may not be told: it is
        there in any case.

        """
        place = self.places.at(before)
        lines = {label(before, f): f for f in (place.candidates if place is not None else ())
                 if is_line(f) and not f.against}
        alike = {name: finding, **{x: lines[x] for x in rivals if x in lines}}
        weight = self._weights(before)
        there = sum(v for k, v in weight.items() if not k.isdisjoint(alike))
        any_of = there / sum(weight.values())
        if any_of < rules.SURE or len(alike) == 1:
            return finding, sure, rivals
        plain = min(alike.values(), key=lambda f: len(f.effect.parameters) if f.effect else 0)
        return plain, any_of, [x for x in rivals if x not in alike]

    def _weights(self, before: Model) -> dict[frozenset[str], float]:
        """Return how likely each set beyond a model is, beside the likeliest."""
        here = frozenset(before.labels)
        some = {k - here: v for k, v in self.scores.items() if k >= here}
        top = max(some.values())
        return {k: float(np.exp(max(v - top, -700.0))) for k, v in some.items()}

    def odds(self, before: Model, name: str) -> tuple[float, list[str]]:
        """
        Return a member's probability at its place, and the rivals that take the rest.

        What is as likely with it as without it is beside it, and none of its rivals.

        """
        weight = self._weights(before)
        total = sum(weight.values())
        with_it = sum(v for k, v in weight.items() if name in k)
        others: dict[str, float] = {}
        beside: dict[str, float] = {}
        for k, v in weight.items():
            some = beside if name in k else others
            for x in k:
                some[x] = some.get(x, 0.0) + v
        # those that come together have the same: a set's own order differs from run to run
        rivals = [x for x in sorted(others, key=lambda x: (-others[x], x))
                  if others[x] > rules.RIVAL * total
                  and others[x] * with_it > ALIKE * beside.get(x, 0.0) * (total - with_it)]
        return with_it / total, rivals[:3]
