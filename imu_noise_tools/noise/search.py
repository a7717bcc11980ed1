# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search for the minimum of the likelihood of one axis, from several starts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .descent import Known, minimise
from .kinds import Spectrum
from .likelihood import Likelihood
from .starts import (
    begun_anew, entered_behind, most_promising, peaks_anew, reddest, Start
)
from ..loop.effect import Fit, Model
from ..loop.verdict import PRICE

REDDEST = 1.0  # weight of -ln(slowest amplitude) in the point estimate
_ROUNDS = 3  # how often responses are begun anew, each from the best so far
_FORMS = 2  # forms of a response that are begun anew beside a narrow peak


@dataclass(frozen=True)
class Search:
    """How the searched parameters are looked for: cautiously or not, from how many starts."""

    cautious: bool
    mean: Fit | None
    enough: float  # nats that end a search; a comparison needs no more than 1e-3

    @property
    def most(self) -> int:
        """Starts that are tried."""
        return 6 if self.cautious else 3

    def from_starts(self, plain: Likelihood, proposed: list[Start],
                    most: int | None = None) -> Found | None:
        """
        Return the best :class:`Found` of several starts; None where none is finite.

        A form with more parameters must be that much better.

        """
        return self._best(most_promising(plain, proposed, self.mean, most or self.most), None)

    def with_responses_anew(self, found: Found) -> Found:
        """Return the better of a minimum and what a response begun anew there reaches."""
        anew = self._anew(found)
        # own noise that is all white is white noise as well: the first holds where both do
        behind = self._best(entered_behind(found.likelihood, found.x), None, margin=PRICE)
        return anew if behind is None else min(
            anew, self._anew(behind, changed=True), key=lambda f: f.cost)

    def _anew(self, found: Found, changed: bool = False) -> Found:
        """
        Return the best of a minimum and what responses begun anew reach, again from there.

        Where a response has ``changed`` peaks are begun anew as well.

        """
        tried: set[tuple[Model, bytes]] = set()
        for k in range(_ROUNDS):
            begun = begun_anew(found.likelihood, found.x, _FORMS)
            if k > 0 or changed:
                begun += peaks_anew(found.likelihood, found.x)
            begins = {(other.model, x0.tobytes()): (other, x0) for other, x0 in begun}
            # what began alike in a round before ends where it ended then
            better = self._best((v for k, v in begins.items() if k not in tried), found)
            tried |= begins.keys()
            if better is None or better is found:
                break
            found = better
        return found

    def _best(self, begins: Iterable[tuple[Likelihood, np.ndarray]],
              best: Found | None, margin: float = 1e-9) -> Found | None:
        """
        Return the best of the minima reached from some starts, and of one that is known.

        What comes later must be better by a ``margin``, nats.

        """
        least = np.inf if best is None else best.cost
        ends = [] if best is None else [best]
        for likelihood, x0 in begins:
            found = self.from_point(likelihood, x0, ends, least)
            if found in ends:
                continue
            ends.append(found)
            cost = found.cost
            if np.isfinite(cost) and cost < least - margin:
                best, least = found, cost
        return best

    def from_point(self, likelihood: Likelihood, x0: np.ndarray,
                   ends: Sequence[Found] = (), least: float = np.inf) -> Found:
        """
        Return the minimum reached from one point, one of the ``ends`` where it leads there.

        Or where the way ends that will not come down to a cost known, the ``least``.

        """
        slowest = reddest(likelihood, x0) if self.cautious else None
        alike = [f for f in ends if f.slowest == slowest and f.is_of(likelihood)]
        known = Known([(f.x, f.nll) for f in alike], least - PRICE * len(x0))
        end = minimise(likelihood, x0, penalty=REDDEST, reddest=slowest, enough=self.enough,
                       known=known)
        met = next((f for f in alike if f.x is end[0]), None)
        if met is not None:
            return met
        x, nll = _revived(likelihood, end, slowest, self.enough)
        return Found(likelihood, x, nll, slowest)


@dataclass(frozen=True, eq=False)
class Found:
    """A minimum: where, how deep, and which amplitude was kept off zero."""

    likelihood: Likelihood
    x: np.ndarray
    nll: float
    slowest: int | None

    @cached_property
    def information(self) -> np.ndarray:
        """The Fisher matrix (p, p) there, which is wanted of few of those that are found."""
        return self.likelihood.information(self.x)

    def is_of(self, likelihood: Likelihood) -> bool:
        """Tell whether it is a minimum of another likelihood on the same basis as well."""
        lower, upper = likelihood.bounds
        return likelihood is self.likelihood or (
            len(self.x) == len(lower) and bool(np.all((lower <= self.x) & (self.x <= upper)))
            and likelihood.with_search(self.x) == self.likelihood.with_search(self.x))

    @property
    def cost(self) -> float:
        """
        By what forms with more or fewer parameters are compared.

        A shape at its bound is no estimate: there another form goes on, and of two as good that
        which has room is meant. Levels that are taken from the record cost what they gain by
        chance.

        """
        likelihood = self.likelihood
        free = len(self.x) + likelihood.ended(self.x)
        taken = sum(e.by_chance(likelihood.evidence) for e in likelihood.model.of(Spectrum))
        return self.nll + PRICE * free + taken + likelihood.value(self.x)[1].form


def _revived(likelihood, found, reddest, enough):
    """
    Return the better of a minimum and what follows when dead amplitudes are revived.

    These are the amplitudes that died on the way to the minimum.

    """
    x = found[0]
    _, linear, v, each = likelihood.value(x)
    asked_for = linear.weight * (linear.power / v - 1) / v
    again = x.copy()
    for j, slot in enumerate(likelihood.slots):
        share = np.max(each[slot.label] / v) if slot.label in each else 1.0
        # what is dead stays so where a little more of it would be worse
        if slot.parameter.amplitude and slot.parameter.log and share < 1e-3 \
                and asked_for @ each[slot.label] > 0:
            again[j] += 0.5 * np.log(0.3 / max(share, 1e-300))
    if np.array_equal(again, x):
        return found
    other = minimise(likelihood, again, penalty=REDDEST, reddest=reddest, enough=enough)
    return other if other[1] < found[1] - 1e-6 else found
