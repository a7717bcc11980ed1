# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How good is an IMU, and what is wrong with the model of it.

Said once, here, and repeated nowhere:

Units
    SI everywhere inside: rad/s, m/s^2, s, Hz, degrees Celsius. Field units (deg/sqrt(h),
    ug/sqrt(Hz) ...) appear only where people read, through :mod:`imu_noise_tools.core.units`.
Densities
    A noise density N is the square root of the *two-sided* power spectral density, which is what
    IEEE 952, Kalibr and the Allan deviation at 1 s mean. ``psd`` methods return *one-sided*
    densities of the *sampled* process (2 N^2 for white noise), defined on 0 < f <= 1/(2 dt).
Frames and signs
    REP-103 and REP-145: right-handed, x forward, y left, z up; at rest an accelerometer reads +g
    on the axis that points up. A face is named after the axis that reads +g: ``+z`` means z up.
Shapes
    A record is n samples; ``gyro`` and ``accel`` are (n, 3); one axis is (n,); a calibration
    stacks inputs as rows of the regressor I (p, poses) and outputs as O (3, poses), so that
    O = G I.
Names of axes
    ``gyro_x gyro_y gyro_z accel_x accel_y accel_z``.
Uncertainty
    ``std`` is one standard deviation, ``ci95`` a 95 % interval, ``upper95`` a one-sided 95 %
    limit. A value whose interval reaches zero is ``None``: it is not observable from the record.
Sources
    IEEE 952 and IEEE 1554 (terms and Allan variance), REP-103, REP-145 (frames).


From Python
    ``import imu_noise_tools as imu``: the names of ``__all__``, from :mod:`imu_noise_tools.api`,
    which is loaded when one of them is first used.

"""

import sys

__version__ = '0.1.0'

__all__ = [
    'analyse', 'calibrate', 'data_sheet', 'filter', 'FitError', 'Fleet', 'fleet',
    'ImuNoiseError', 'ImuRecord', 'InputError', 'load', 'load_effects', 'open_fleet',
    'open_record', 'simulate', 'Study', 'UsageError']

TYPE_CHECKING = False       # typing's own would load typing

if TYPE_CHECKING:
    from .api import analyse as analyse     # noqa: I300
    from .api import calibrate as calibrate
    from .api import data_sheet as data_sheet
    from .api import filter as filter
    from .api import FitError as FitError
    from .api import Fleet as Fleet
    from .api import fleet as fleet
    from .api import ImuNoiseError as ImuNoiseError
    from .api import ImuRecord as ImuRecord
    from .api import InputError as InputError
    from .api import load as load
    from .api import load_effects as load_effects
    from .api import open_fleet as open_fleet
    from .api import open_record as open_record
    from .api import simulate as simulate
    from .api import Study as Study
    from .api import UsageError as UsageError
else:
    def __getattr__(name):
        if name not in __all__:
            raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
        from . import api
        return getattr(api, name)


def __dir__() -> list[str]:
    return [*(n for n in globals() if n.startswith('__')), *__all__]


class _Package(type(sys)):      # type: ignore[misc]
    """This module, in which the rooms ``filter`` and ``simulate`` do not hide the functions."""

    def __setattr__(self, name: str, value: object) -> None:
        """Leave out a room that the import system binds here under the name of a function."""
        if not (name in __all__ and isinstance(value, type(sys))):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
