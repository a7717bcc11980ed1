# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of a study's report, each as PNG bytes."""

from __future__ import annotations

from .words import change, failing
from ..loop.domains import part
from ..loop.study import Step, Study
from ..plots import ladder, style

MOST_TARGETS = 2          # targets shown in full


def pictures(study: Study) -> dict[str, bytes]:
    """
    Return the pictures of a study by name.

    Those of its domain, with the targets that fail most in full where it has such pictures;
    ``ladder`` where something was added or removed.

    """
    out: dict[str, bytes] = {}
    if all(s.problem is not None for s in study.states.values()):
        out.update(part('plots', study.domain).pictures(study, worst_targets(study)))
    if any(s.added or s.removed for s in study.history):
        out['ladder'] = style.png(ladder.ladder_figure(study))
    return out


def worst_targets(study: Study) -> list[str]:
    """Return the targets that fail most, judged by their worst view."""
    worst = {t: max((v.excess / v.std for v in failing(s.error)), default=0.0)
             for t, s in study.states.items()}
    return [t for t in sorted(worst, key=lambda t: -worst[t]) if worst[t] > 0][:MOST_TARGETS]


def rung(before: Step, step: Step) -> bytes:
    """Return the picture of what a rung of the ladder changed, in the view that shows it."""
    assert step.contrast is not None
    return style.small_png(style.png(ladder.contrast_figure(
        step.contrast, f'before: {" + ".join(before.effects)}', f'after: {change(step)}')))
