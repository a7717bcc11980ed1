# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of a study's report, each as PNG bytes."""

from __future__ import annotations

from .words import failing
from ..loop.study import Study

MOST_TARGETS = 2          # targets shown in full


def pictures(study: Study) -> dict[str, bytes]:
    """
    Return the pictures of a study by name.

    ``series``, ``allan`` and, for the targets that fail most, ``target <name>`` of a noise study;
    ``innovations`` of a filter's; ``ladder`` of any study in which something was added or removed.

    """
    from ..plots import ladder, noise, style
    out = {}
    if study.domain == 'noise':
        left_out = study.source.get('left_out') or ()
        out['series'] = style.png(noise.series_figure(study, left_out))
        out['allan'] = style.png(noise.allan_figure(study))
        for t in worst_targets(study):
            figure = noise.target_figure(study.states[t], study.diagnosis.get(t), left_out)
            out[f'target {t}'] = style.png(figure)
    if study.domain == 'filter' and all(s.problem for s in study.states.values()):
        from ..plots import filter
        out['innovations'] = style.png(filter.study_figure(study))
    if any(s.added or s.removed for s in study.history):
        out['ladder'] = style.png(ladder.ladder_figure(study))
    return out


def worst_targets(study: Study, most: int = MOST_TARGETS) -> list[str]:
    """Return the targets that fail most, judged by their worst view."""
    worst = {t: max((v.excess / v.std for v in failing(s.error)), default=0.0)
             for t, s in study.states.items()}
    return [t for t in sorted(worst, key=lambda t: -worst[t]) if worst[t] > 0][:most]
