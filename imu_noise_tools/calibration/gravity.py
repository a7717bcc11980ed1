# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Local gravity and the rotation of the Earth."""

from __future__ import annotations

import numpy as np

from ..core.errors import UsageError
from ..core.units import G0

EARTH_RATE = 7.292115e-5        # rad/s, WGS-84; 15.04 deg/h

# WGS-84 (NIMA TR8350.2): equatorial normal gravity, Somigliana's constant, first eccentricity
# squared, semi-major axis, flattening, and m = omega^2 a^2 b / GM
_GE, _K, _E2 = 9.7803253359, 0.00193185265241, 0.00669437999013
_A, _F, _M = 6378137.0, 1 / 298.257223563, 0.00344978650684


def normal_gravity(latitude_deg: float, height_m: float = 0.0) -> float:
    """
    Return the normal gravity of the WGS-84 ellipsoid, m/s^2.

    Somigliana's closed formula on the ellipsoid, and its second-order expansion in the height
    above it (NIMA TR8350.2, equations 4-1 and 4-3). Local gravity differs from it by up to about
    1e-3 m/s^2.

    Raises
    ------
    UsageError
        A latitude outside -90 to 90 degrees, or a height outside -1 to 20 km.

    """
    if not -90 <= latitude_deg <= 90:
        raise UsageError(f'latitude {latitude_deg:g} is not between -90 and 90',
                         'give it in degrees')
    if not -1000 <= height_m <= 20000:
        raise UsageError(f'height {height_m:g} m is not between -1000 and 20000',
                         'give the height above the ellipsoid in metres')
    s2 = np.sin(np.radians(latitude_deg)) ** 2
    surface = _GE * (1 + _K * s2) / np.sqrt(1 - _E2 * s2)
    h = height_m / _A
    return float(surface * (1 - 2 * (1 + _F + _M - 2 * _F * s2) * h + 3 * h ** 2))


def gravity(given: float | None = None, latitude: float | None = None,
            height: float | None = None) -> tuple[float, str]:
    """
    Return (gravity in m/s^2, where it comes from in words).

    Raises
    ------
    UsageError
        Both a value and a latitude are given, a height without a latitude, or a value no place on
        Earth has.

    """
    if given is not None and latitude is not None:
        raise UsageError('both --gravity and --latitude are given', 'give only one of them')
    if height is not None and latitude is None:
        raise UsageError('--height is given without --latitude', 'add --latitude')
    if given is not None:
        if not 9.6 <= given <= 9.9:
            raise UsageError(f'gravity {given:g} m/s^2 is found nowhere on Earth',
                             'it is 9.76 to 9.84 m/s^2')
        return float(given), 'given'
    if latitude is not None:
        value = normal_gravity(latitude, height or 0.0)
        where = f'latitude {latitude:g} deg, height {height or 0:g} m'
        return value, f'WGS-84 normal gravity at {where}'
    return G0, ('standard gravity (local gravity is 9.76 to 9.84: all scale factors may be off by '
                'up to 0.5 %; give --gravity or --latitude)')
