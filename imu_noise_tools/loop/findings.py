# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What can be said of findings by themselves: what they gain, what fails, what hides another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from . import verdict as rules
from .effect import Effect, Finding, Model, Score

FAR = 10.0  # times as long, or as high, from which it is another one


def label(model: Model, finding: Finding) -> str:
    """Return the label that a finding would have in a model."""
    return model.plus(fresh(finding)).labels[-1]


def fresh(finding: Finding) -> Effect:
    """Return the effect of a finding, not fitted."""
    assert finding.effect is not None
    return type(finding.effect)()


def gained(chain: Iterable[Finding]) -> float:
    """Return the surplus of a chain's members together."""
    return float(sum(surplus(f) for f in chain))


def surplus(finding: Finding) -> float:
    """
    Return what a finding gains beyond chance, nats.

    A form with more to choose must be that much better: of nested names with equal gain the
    simpler one holds. What nearly every sensor has is there before it is looked for.

    """
    return finding.gain - price(finding)


def rivals(ranked: Iterable[Finding]) -> list[Finding]:
    """
    Return what stands out of the ranked and takes a share of the probability.

    Where some of it cannot be told from others these and those: what may be there beside them is
    another question.

    """
    some = [f for f in ranked if f.gain > f.penalty
            and (f.probability is None or f.probability > rules.RIVAL)]
    doubted = [f for f in some if f.against.startswith(rules.CANNOT_TELL)]
    named = {name.partition('.')[0] for f in doubted
             for name in f.against.removeprefix(rules.CANNOT_TELL).strip().split(' or ')}
    return [f for f in some if not doubted or f in doubted or f.name in named]


def price(finding: Finding) -> float:
    """Return what a finding must gain to be as likely as not, nats."""
    known = rules.COMMON if finding.effect is not None and finding.effect.common else 0.0
    return finding.penalty + rules.PRICE * finding.shapes - known


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


def elsewhere(one: Finding, other: Finding) -> bool:
    """Tell whether two findings of a name differ by more than FAR times in what they look for."""
    assert one.effect is not None and other.effect is not None
    scales = [p.name for p in one.effect.parameters if p.log and not (
        p.amplitude or p.linear or p.discrete or p.choices)]
    both = [(one.effect.values.get(k, 0.0), other.effect.values.get(k, 0.0)) for k in scales]
    return any(min(pair) > 0 and max(pair) > FAR * min(pair) for pair in both)


def certain(finding: Finding) -> bool:
    """Tell whether nothing else could imitate what shows a finding."""
    return finding.effect is not None and finding.effect.certain


def nameless(finding: Finding) -> bool:
    """Tell whether a finding says where something is, and not what."""
    return finding.effect is not None and finding.effect.nameless


def is_line(finding: Finding) -> bool:
    """Tell whether a finding is a line: few of all coefficients, that nothing could imitate."""
    return finding.effect is not None and finding.effect.certain and not finding.effect.counted


def bends(finding: Finding) -> bool:
    """Tell whether a finding bends a view that others of its kind bend as well."""
    return finding.effect is not None and finding.effect.uncovers and not finding.effect.certain


def fitted(finding: Finding) -> bool:
    """Tell whether what a finding explains is in the fit of a model that holds it."""
    effect = finding.effect
    return effect is not None and (effect.uncovers or effect.paired) and not effect.certain


def yields(one: Finding, other: Finding) -> bool:
    """
    Tell whether one of two findings may explain what the other one does in several axes.

    What explains far more than the other one is not that.

    """
    return one.effect is not None and other.effect is not None \
        and bool(one.effect.yields) and other.effect.paired and not outweighs(one, other)


def outweighs(one: Finding, other: Finding) -> bool:
    """Tell whether a finding explains so much that another one stands in its shadow."""
    return one.gain > rules.SHADOW * other.gain


def pairs(one: Finding, other: Finding) -> bool:
    """
    Tell whether one of two findings may hide the other one in the view of both.

    Or whether beside the first there is less noise, under which a mean is hidden.

    """
    if one.effect is None or other.effect is None:
        return False
    if one.effect.uncovers and other.effect.paired:
        return True
    return one.view == other.view and may_pair(one.effect, True, type(other.effect))


def may_pair(one: Effect, others: bool, kind: type[Effect]) -> bool:
    """Tell whether an effect and a finding of some kind may be a pair: of its own, or others."""
    return kind.name == one.name or others and (
        one.paired and kind.paired or one.uncovers and (kind.uncovers or kind.paired))


def likelier(without: Iterable[Finding], with_it: Iterable[Finding], view: str) -> float:
    """Return by how much likelier a view's data are by some tests than by others, nats."""
    before, after = ([f.log_score for f in tests if f.view == view]
                     for tests in (without, with_it))
    if len(before) != len(after):
        return 0.0
    return sum(0.5 * (b - a) for b, a in zip(before, after) if b is not None and a is not None)


def together(one: Finding, other: Finding) -> Finding:
    """Return what two findings claim together."""
    return replace(one, gain=one.gain + other.gain, elsewhere=one.elsewhere + other.elsewhere,
                   samples=one.samples + other.samples)
