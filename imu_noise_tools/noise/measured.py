# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is measured on the samples when the evidence is made: lines, defects, modulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .evidence import Evidence
from .kinds import Line, MEASURED, Response, Spectrum
from .null import DEFAULT, PENALTY
from ..core import units
from ..loop.effect import Estimate, Finding


def with_measured(evidence, model):
    """Give effects that are measured on the samples their values; say where nothing was found."""
    estimates, flags = {}, []
    claimed: set[int] = set()
    for e in model.effects:
        if not isinstance(e, MEASURED):
            continue
        values, found, note = measure(evidence, e, claimed)
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
    return PENALTY.get(name, DEFAULT)


def measure(evidence: Evidence, effect, claimed: set[int]):
    """Return (values, estimates, note) of an effect that is measured on the samples."""
    if isinstance(effect, Line):
        return _measure_line(evidence, effect, claimed)
    finding = evidence.measured(effect)
    if finding is not None and not isinstance(effect, (Spectrum, Response)) \
            and finding.gain < penalty(effect.name):
        finding = None  # chance finds as much where there is nothing
    if finding is None or finding.effect is None:
        values = {
            p.name: effect.neutral.get(
                p.name, 0.0 if p.amplitude or not p.log else float(np.sqrt(p.lower * p.upper))
            )
            for p in effect.parameters
        }
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
    known = {p.name: p for p in finding.effect.parameters}
    return replace(
        finding,
        estimates={
            k: replace(
                v,
                unit=units.si(known[k].unit, evidence.sensor),
                fixed=True,
                point=float(finding.effect.values[k]),
            )
            for k, v in finding.estimates.items()
        },
    )


def _measure_line(evidence, effect, claimed):
    """
    Claim the strongest free line (or the one nearest to a given frequency).

    Its errors are the Cramer-Rao bound.

    """
    table = evidence.line_table
    free = [i for i in range(len(table)) if i not in claimed]
    t = evidence.duration
    rate, hertz = (units.si(p.unit, evidence.sensor) for p in effect.parameters)
    if not free:
        level = float(np.median(evidence.whole.power))
        upper = float(np.sqrt(level / t) * 2.45)  # 95 % of a Rayleigh amplitude
        found = {
            'amplitude': Estimate(
                None,
                None,
                (0.0, upper),
                rate,
                upper95=upper,
                point=0.0,
                note='not observable: no line stands out of the spectrum',
            ),
            'frequency': Estimate(
                None, None, None, hertz, point=0.25 / evidence.dt, note='no line'
            ),
        }
        return (
            {'amplitude': 0.0, 'frequency': 0.25 / evidence.dt},
            found,
            'no line stands out of the spectrum',
        )
    wanted = effect.values.get('frequency')
    near = [i for i in free if wanted and abs(table[i, 0] - wanted) < max(2 / t, 1e-3 * wanted)]
    i = near[0] if near else free[0]
    claimed.add(i)
    frequency, a, b, _ = table[i]
    amplitude = float(np.hypot(a, b))
    bins = evidence.whole.bins
    at = bins.index(max(1, min(evidence.whole.n - 1, int(2 * t * frequency))))
    level = float(np.median(evidence.whole.power[max(0, at - 5):at + 6]))
    std_a = float(np.sqrt(2 * level / (2 * t)))
    std_f = float(np.sqrt(3 * level / (np.pi**2 * amplitude**2 * t**3)))
    found = {
        'amplitude': Estimate(
            amplitude,
            std_a,
            (amplitude - 1.96 * std_a, amplitude + 1.96 * std_a),
            rate,
            point=amplitude,
            fixed=True,
        ),
        'frequency': Estimate(
            float(frequency),
            std_f,
            (frequency - 1.96 * std_f, frequency + 1.96 * std_f),
            hertz,
            point=float(frequency),
            fixed=True,
        ),
    }
    return {'amplitude': amplitude, 'frequency': float(frequency)}, found, ''
