# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What speaks against a finding, in words; nothing where it holds."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from . import verdict as rules
from .effect import Finding, Model
from .findings import failures, fresh, likelier, pairs, together
from .places import Places
from .prediction import fall_of

DOUBT = 'data not fitted do not confirm it'


class Against:
    """What speaks against findings of one target, from one of its models to another."""

    def __init__(self, places: Places):
        self.places = places

    def unconfirmed(self, model: Model, name: str, finding: Finding) -> tuple[float, str]:
        """Return by how much a member lowers the error beside the others, and what if not."""
        return self.unlowered(model.minus(name), model, finding)

    def unlowered(self, without: Model, model: Model, finding: Finding) -> tuple[float, str]:
        """Return by how much a finding lowers the error from one model to another; what if not."""
        after, before = self.places.error(model), self.places.error(without)
        if after is None or before is None or finding.effect is None:
            return -np.inf, 'a part of the record cannot hold it'
        fall = fall_of(before, after, [finding.effect])
        if fall > rules.FALL:
            return fall, ''
        if fall >= 0:
            return fall, (f'{DOUBT}: their deviance falls by {fall:.1f}, chance reaches '
                          f'{rules.FALL:.0f}')
        return fall, f'it raises the held-out deviance by {-fall:.1f}'

    def unhealed(self, before_it: Model, after_it: Model, finding: Finding) -> str:
        """
        Say that the view a member claims to heal does not gain at its place what it claims.

        Nor do all views together in which it is judged: what one of them shows of a member may be
        little beside what something else leaves there. Nor do the data become likelier by it:
        where noise was taken for what several effects do, with one of them there is less of it,
        and beside less noise the others stand out as much as both did. A mean that does most of
        what it does where its view does not look, faster than that, is not asked there. What is as
        it is measured heals its own view in any case: beside it less must fail in all.

        """
        assert finding.effect is not None
        if finding.effect.paired and finding.elsewhere >= rules.HEALED * finding.gain:
            return ''
        without = self.places.tests(before_it)
        if not finding.effect.counted or finding.view not in {f.view for f in failures(without)}:
            return ''
        if finding.effect.as_measured and \
                self.places.failing(after_it) >= self.places.failing(before_it):
            return 'beside it no less fails than without it'
        with_it = self.places.tests(after_it)
        shown, said = {f.view for f in with_it}, ''
        if finding.view not in shown:
            return f'it hides the view {finding.view} and does not heal it'
        for views in ({finding.view}, {finding.view, *finding.effect.views} & shown):
            before, after = (sum(max(f.gain, 0.0) for f in tests if f.view in views)
                             for tests in (without, with_it))
            claim = min(finding.gain - max(finding.elsewhere, 0.0), before)
            if before - after >= rules.HEALED * claim:
                return ''
            said = said or (f'it claims {claim:.0f} nats of what fails in {finding.view} and '
                            f'heals {max(before - after, 0):.0f}')
        more = likelier(without, with_it, finding.view)
        return '' if more > 0 and more >= rules.HEALED * finding.gain else said

    def unhealed_with(self, before: Model, after: Model, finding: Finding,
                      later: Iterable[Finding]) -> str:
        """
        Say :meth:`unhealed`, unless it heals what it claims beside another.

        Where noise is stretched over a mean and over what adds noise, neither shows what it does
        until the other is there: the view must fail beside the other one too. Of two means either
        may do what the other claims, so that together they must heal what both claim.

        """
        against = self.unhealed(before, after, finding)
        if not against or finding.effect is None or not (
                finding.effect.paired or finding.effect.uncovers):
            return against
        for g in later:
            other, both = before.plus(fresh(g)), after.plus(fresh(g))
            if finding.view in {f.view for f in failures(self.places.tests(other))} \
                    and not self.unhealed(other, both, finding) \
                    and not (pairs(finding, g)
                             and self.unhealed(before, both, together(finding, g))):
                return ''
        return against

    def shaped(self, model: Model, name: str, finding: Finding) -> str:
        """Say that a flexible form does better in a member's place."""
        return self.places.problem.shape(self.places.problem.point(model), name, finding.gain)

    def shadowed(self, model: Model, name: str, finding: Finding) -> str:
        """
        Say that far more fails elsewhere than a member explains, and nothing explains that.

        A gain counts no part of a view for more than a little; what fails has no such limit. What
        a member explains is therefore what of its view fails without it as well.

        """
        assert finding.effect is not None
        if finding.effect.certain or finding.effect.sharp:
            return ''
        aside = {finding.view, *finding.effect.aside}
        left = sum(f.gain for f in failures(self.places.tests(model)) if f.view not in aside)
        if left <= rules.SHADOW * finding.gain:     # else a model more is fitted
            return ''
        without, with_it = (sum(f.gain for f in failures(self.places.tests(m))
                                if f.view == finding.view) for m in (model.minus(name), model))
        explains = max(finding.gain, without - with_it)
        if left <= rules.SHADOW * explains:
            return ''
        return f'it explains {explains:.0f} nats, and {left:.0f} that fail elsewhere nothing does'
