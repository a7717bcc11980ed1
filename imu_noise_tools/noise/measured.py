# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is measured on the samples when the evidence is made: lines, defects, modulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from .evidence import Evidence
from .in_time import beside
from .kinds import Defect, Line, MEASURED, Modulation, NoiseEffect, Response, Spectrum
from .null import DEFAULT, PENALTY
from ..core import units
from ..loop.effect import Estimate, find_effect, Finding, Model


def with_measured(evidence: Evidence, model: Model) -> tuple[
        Model, dict[str, Mapping[str, Estimate]], list[str]]:
    """Give effects that are measured on the samples their values; say where nothing was found."""
    estimates: dict[str, Mapping[str, Estimate]] = {}
    flags = []
    claimed: set[int] = set()
    # families of lines before those that take what is left
    # and what changes in time behind what hides it
    for e in sorted(model.effects, key=lambda e: (isinstance(e, Modulation),
                                                  not (isinstance(e, Line) and e.family))):
        if not isinstance(e, MEASURED):
            continue
        here = beside(evidence, model) if isinstance(e, Modulation) else evidence
        values, found, note = measure(here, e, claimed)
        model = model.with_effect(e.with_values(**values))
        estimates[e.label] = found
        if note:
            flags.append(f'{e.label}: {note}')
    return model, estimates, flags


def penalty(name: str) -> float:
    """
    Return the gain (nats) that chance reaches in one record of a thousand.

    Nothing is hidden in these records.

    """
    known = [n for n in find_effect('noise', name).lineage() if n in PENALTY]
    return PENALTY[known[0]] if known else DEFAULT


def measure(evidence: Evidence, effect: NoiseEffect, claimed: set[int]) -> tuple[
        Mapping[str, float], Mapping[str, Estimate], str]:
    """Return (values, estimates, note) of an effect that is measured on the samples."""
    if isinstance(effect, Line):
        return _measure_line(evidence, effect, claimed)
    assert isinstance(effect, (Defect, Modulation))
    finding = evidence.measured(effect)
    if finding is not None and not isinstance(effect, (Spectrum, Response)) \
            and finding.gain < penalty(effect.name):
        finding = None  # chance finds as much where there is nothing
    if finding is None or finding.effect is None:
        values = {p.name: effect.idle(p) for p in effect.parameters}
        found = {
            p.name: Estimate(
                None,
                None,
                (0.0, 0.0) if p.amplitude else None,
                units.si(p.unit, evidence.sensor),
                upper95=0.0 if p.amplitude else None,
                note='nothing of the kind in the samples',
                point=values[p.name],
            )
            for p in effect.parameters
        }
        return values, found, 'nothing of the kind in the samples'
    return dict(finding.effect.values), with_units(finding, evidence).estimates, ''


def with_units(finding: Finding, evidence: Evidence) -> Finding:
    """
    Return a finding whose estimates have units and points.

    They are marked as measured on the samples.

    """
    assert finding.effect is not None
    effect = finding.effect
    known = {p.name: p for p in effect.parameters}
    return replace(
        finding,
        estimates={
            k: replace(v, unit=units.si(known[k].unit, evidence.sensor), fixed=True,
                       point=float(effect.values[k]))
            for k, v in finding.estimates.items()
        },
    )


def _measure_line(evidence, effect, claimed):
    """Claim the free lines that it would hold."""
    free = [i for i in range(len(evidence.line_table)) if i not in claimed]
    rows = effect.rows(evidence, free)
    claimed.update(rows)
    read, unit = effect.read(evidence, rows), {p.name: p.unit for p in effect.parameters}
    found = {k: replace(v, unit=units.si(unit[k], evidence.sensor)) for k, v in read.items()}
    note = '' if rows else 'no line stands out of the spectrum'
    return {k: float(v.point) for k, v in read.items()}, found, note
