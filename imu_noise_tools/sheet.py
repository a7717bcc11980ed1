# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Data sheets: values in the units of sheets, as the coefficients of a noise model (SI).

A sheet is YAML: ``name``, ``source``, ``rate_hz``, ``one_sided`` (whether a density is the root of
a one-sided one, as where it times the root of a bandwidth is the rms; without it, it is taken as
it stands, which is the larger), and for ``gyro`` and ``accel`` some of

    noise_density: 0.014 deg/s/sqrt(Hz)         # N, or N sqrt(2) where one-sided
    random_walk_of_the_integral: 0.3 deg/sqrt(h)      # angle or velocity random walk: N
    noise_rms: {value: 0.1 deg/s, bandwidth_hz: 47}   # N = rms / sqrt(2 bandwidth)
    bias_instability: 12 deg/h                  # B of IEEE 952
    allan_minimum: 8 deg/h                      # in-run bias stability: 0.664 B
    rate_random_walk: 0.5 deg/h^1.5             # K

A value may be three, in brackets, for x, y, z.

"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math
import re
from typing import Any

from .core.errors import InputError
from .core.units import DEG, G0, HOUR
from .loop.effect import model_of
from .loop.study import Study
from .noise.stated import StatedProblem

FLAT = math.sqrt(2 * math.log(2) / math.pi)     # of an Allan deviation, over B: 0.664
_RATES = {
    'gyro': {'rad/s': 1.0, 'deg/s': DEG, 'mdeg/s': 1e-3 * DEG, 'deg/h': DEG / HOUR,
             'mrad/s': 1e-3},
    'accel': {'m/s^2': 1.0, 'mm/s^2': 1e-3, 'g': G0, 'mg': 1e-3 * G0, 'ug': 1e-6 * G0}}
_INTEGRALS = {'gyro': {'deg': DEG, 'rad': 1.0}, 'accel': {'m/s': 1.0}}
_ENTRIES = ('noise_density', 'random_walk_of_the_integral', 'noise_rms', 'bias_instability',
            'allan_minimum', 'rate_random_walk')
EXAMPLE = 'e.g. noise_density: 0.014 deg/s/sqrt(Hz)'


@dataclass(frozen=True)
class Sheet:
    """Coefficients (SI) by axis and (label, parameter), as a sheet gives them."""

    name: str
    source: str
    rate_hz: float
    values: Mapping[str, Mapping[tuple[str, str], float]]
    notes: tuple[str, ...]

    def study(self, path: str = '') -> Study:
        """Return a study of noise, which every export takes."""
        axes = {a: StatedProblem(a, 1 / self.rate_hz, v) for a, v in self.values.items()}
        labels = list(dict.fromkeys(e for v in self.values.values() for e, _ in v))
        source = {'path': path or self.name, 'topic': '', 'samples': 0, 'rate_hz': self.rate_hz,
                  'duration_s': 0.0, 'start': 0.0, 'frame_id': '', 'sheet': self.name,
                  'sheet_source': self.source, 'notes': list(self.notes), 'warnings': []}
        return Study.begin(axes, model_of('noise', labels), source)


def read(data: Any, where: str = 'sheet') -> Sheet:
    """
    Return the sheet that plain data hold.

    Raises
    ------
    InputError
        No rate, no value, an entry or a unit that is not known.

    """
    if not isinstance(data, Mapping) or not any(s in data for s in _RATES):
        raise InputError(f'{where}: neither gyro nor accel in it', EXAMPLE)
    rate = data.get('rate_hz')
    if not isinstance(rate, (int, float)) or not 0 < rate < 1e6:
        raise InputError(f'{where}: no rate_hz', 'name the rate at which it is used, e.g. 200')
    side = data.get('one_sided')
    notes = [] if side is not None or not any(
        'noise_density' in (data.get(s) or {}) for s in _RATES) else [
            'densities are taken as two-sided, which the sheet does not say (the larger reading)']
    values: dict[str, dict[tuple[str, str], float]] = {}
    for sensor in (s for s in _RATES if s in data):
        entries = data[sensor]
        unknown = [k for k in entries or () if k not in _ENTRIES]
        if not isinstance(entries, Mapping) or not entries or unknown:
            raise InputError(f'{where}: {sensor} {unknown or "is empty"}',
                             f'choose from {", ".join(_ENTRIES)}; {EXAMPLE}')
        for entry in _ENTRIES:
            if entry in entries:
                slot, three = _read(entries[entry], entry, sensor, bool(side), where)
                for axis, value in zip('xyz', three):
                    values.setdefault(f'{sensor}_{axis}', {}).setdefault(slot, value)
    return Sheet(str(data.get('name') or where), str(data.get('source') or ''), float(rate),
                 values, tuple(notes))


def _read(given: Any, entry: str, sensor: str, one_sided: bool,
          where: str) -> tuple[tuple[str, str], list[float]]:
    """Return which coefficient an entry gives, and its value for x, y, z."""
    band = 0.0
    if entry == 'noise_rms':
        if not isinstance(given, Mapping) or not given.get('bandwidth_hz'):
            raise InputError(f'{where}: noise_rms without its bandwidth_hz',
                             'e.g. noise_rms: {value: 0.1 deg/s, bandwidth_hz: 47}')
        band, given = float(given['bandwidth_hz']), given['value']
    some = given if isinstance(given, list) else [given] * 3
    if len(some) != 3:
        raise InputError(f'{where}: {entry} is not one value or three', EXAMPLE)
    three = [_number(str(x), entry, sensor, where) for x in some]
    white, flicker, walk = ('white', 'N'), ('flicker', 'B'), ('random_walk', 'K')
    scale = {'noise_density': math.sqrt(0.5) if one_sided else 1.0,
             'noise_rms': 1 / math.sqrt(2 * band) if band else 1.0,
             'allan_minimum': 1 / FLAT}.get(entry, 1.0)
    slot = {'bias_instability': flicker, 'allan_minimum': flicker,
            'rate_random_walk': walk}.get(entry, white)
    return slot, [scale * x for x in three]


def _number(text: str, entry: str, sensor: str, where: str) -> float:
    """Return a value with its unit in SI."""
    found = re.fullmatch(r'\s*([+-]?[\d.]+(?:[eE][+-]?\d+)?)\s*(\S.*)', text)
    unit = _plain(found.group(2)) if found else ''
    factor = _factors(entry, sensor).get(unit)
    if found is None or factor is None or not float(found.group(1)) > 0:
        known = ', '.join(_factors(entry, sensor))
        raise InputError(f'{where}: {sensor} {entry}: {text!r} is no value with a unit of it',
                         f'units are {known}')
    return float(found.group(1)) * factor


def _plain(unit: str) -> str:
    """Return a unit in one way of writing: degrees, micro, roots and hours as here."""
    unit = unit.replace('°', 'deg').replace('µ', 'u').replace('μ', 'u').replace('²', '^2')
    unit = re.sub(r'\s|rms|\bp-p\b', '', unit).replace('dps', 'deg/s').replace('hr', 'h')
    unit = re.sub(r'√\(?(\w+)\)?', r'sqrt(\1)', unit)
    return re.sub(r'sqrt(\w+)', r'sqrt(\1)', unit).replace('^(1.5)', '^1.5')


def _factors(entry: str, sensor: str) -> dict[str, float]:
    """Return what a unit of an entry is in SI, by its plain writing."""
    rates = _RATES[sensor]
    if entry == 'noise_density':
        return {f'{u}/sqrt(Hz)': f for u, f in rates.items()}
    if entry == 'random_walk_of_the_integral':
        return {f'{u}/sqrt({t})': f / math.sqrt(s) for u, f in _INTEGRALS[sensor].items()
                for t, s in (('h', HOUR), ('s', 1.0))}
    if entry == 'rate_random_walk':
        out = {f'{u}/s/sqrt(Hz)': f for u, f in rates.items()}
        if sensor == 'gyro':
            out.update({'rad/s^2/sqrt(Hz)': 1.0, 'deg/h^1.5': DEG / HOUR ** 1.5,
                        'deg/h/sqrt(h)': DEG / HOUR ** 1.5})
        else:
            out.update({'m/s^3/sqrt(Hz)': 1.0, 'm/s/h^1.5': HOUR ** -1.5})
        return out
    return dict(rates)
