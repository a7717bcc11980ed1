"""The pictures of a study's report, each as PNG bytes."""

from __future__ import annotations

from ..study import Study
from .words import failing

MOST_TARGETS = 2          # targets shown in full


def pictures(study: Study) -> dict[str, bytes]:
    """
    Return the pictures of a study by name.

    ``series``, ``allan`` and, for the targets that fail most, ``target <name>`` of a noise study; ``ladder`` of any study with
    more than one step.

    """
    from ..plots import figures, ladder
    from ..plots.style import png
    out = {}
    if study.domain == 'noise':
        left_out = study.source.get('left_out') or ()
        out['series'] = png(figures.series_figure(study, left_out))
        out['allan'] = png(figures.allan_figure(study))
        for t in worst_targets(study):
            out[f'target {t}'] = png(figures.target_figure(study.states[t], study.diagnosis.get(t), left_out))
    if len(study.history) > len(study.targets):
        out['ladder'] = png(ladder.ladder_figure(study))
    return out


def worst_targets(study: Study, most: int = MOST_TARGETS) -> list[str]:
    """Return the targets that fail most, judged by their worst view."""
    def worst(t):
        return max((v.excess / v.std for v in failing(study.states[t].error)), default=0.0)

    return [t for t in sorted(study.targets, key=lambda t: -worst(t)) if worst(t) > 0][:most]
