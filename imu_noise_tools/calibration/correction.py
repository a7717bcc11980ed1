# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From raw samples to corrected ones: the inverse of a calibration, and its plain form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .effects import BASE, Regressor
from .poses import Poses
from ..core.errors import ImuNoiseError, InputError
from ..loop.effect import find_effect, Model, registry

_TURNS = 8          # of the iteration; each gains the digits of the effects' size (1e-3 and less)


@dataclass(frozen=True)
class Correction:
    """
    raw = S x + bias + effects(x), solved for x.

    Parameters
    ----------
    sensor : str
        ``accel`` or ``gyro``.
    S : ndarray (3, 3)
        Scale factors and cross-axis sensitivities.
    bias : ndarray (3,)
        In units of the output.
    model : Model
        What else there is, with values; what changes the input itself (Earth rate) stays in x.
    reference_temperature : float
        Temperature at which S and bias hold, degrees Celsius.

    """

    sensor: str
    S: np.ndarray
    bias: np.ndarray
    model: Model = Model()
    reference_temperature: float = 25.0

    @property
    def more(self) -> list[Regressor]:
        """Effects beyond scale, cross-axis and bias that are taken out of the outputs."""
        return [e for e in self._within if not e.passing]

    @property
    def _within(self) -> list[Regressor]:
        """The same, with what belongs to the session that they were fitted to."""
        return [e for e in self.model.of(Regressor) if e.name not in BASE and not e.at_input]

    @property
    def heated(self) -> list[str]:
        """Names of the effects that are taken out at the temperature of each sample."""
        return [e.label for e in self.more if e.heated]

    def apply(self, raw: np.ndarray, temperature: Any = None, force: Any = None,
              time: Any = None) -> np.ndarray:
        """
        Return x for raw samples, (n, 3) or (3,).

        ``temperature`` (n,) and ``force`` (n, 3) enter only where the model holds an effect of
        them; without a temperature the reference is taken. With a ``time`` (n,), s since the start
        of the record that was calibrated, what belongs to that record alone is taken out too.

        """
        raw = np.asarray(raw, float)
        columns = np.atleast_2d(raw).T
        x = np.linalg.solve(self.S, columns - self.bias[:, None])
        if more := self.more if time is None else self._within:
            n = columns.shape[1]
            if temperature is None:
                temperature = self.reference_temperature
            here = Poses.of(self.sensor, columns, 0.0, 1.0,
                            temperature=np.broadcast_to(np.asarray(temperature, float), (n,)),
                            force=np.zeros((3, n)) if force is None
                            else np.atleast_2d(np.asarray(force, float)).T, time=time,
                            reference_temperature=self.reference_temperature)
            for _ in range(_TURNS):
                rest = sum(e.terms(here.with_inputs(x), self.S)
                           @ [e.values[p.name] for p in e.coefficients]
                           for e in more)
                x = np.linalg.solve(self.S, columns - self.bias[:, None] - rest)
        return x.T.reshape(raw.shape)


def is_heated(data: Mapping) -> bool:
    """Tell whether S and bias of a calibration.yaml's data hold at the reference temperature."""
    known = registry('calibration')
    kinds = (known.get(e['effect']) for e in (data.get('effects') or {}).values())
    return any(k is not None and issubclass(k, Regressor) and k.heated for k in kinds)


def from_dict(data: Mapping) -> Correction:
    """
    Return the correction of a calibration.yaml's data.

    Raises
    ------
    InputError
        It is not a calibration, is damaged, or holds an effect that is not known.

    """
    try:
        scale, bias = np.array(data['S'], float), np.array(data['bias'], float)
        effects = [find_effect('calibration', e['effect'])(
            {k: v for k, v in e.items() if k != 'effect'}, label) for label,
                   e in (data.get('effects') or {}).items()]
        sensor, reference = str(data['sensor']), float(data.get('reference_temperature', 25.0))
    except ImuNoiseError as error:
        raise InputError(error.message, f'{error.remedy}; effects of your own: --effects-from '
                                        f'FILE') from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(f'not a calibration ({type(error).__name__}: {error})',
                         'name what calibrate wrote') from None
    sound = scale.shape == (3, 3) and bias.shape == (3,)
    sound = sound and bool(np.isfinite(scale).all() and np.isfinite(bias).all())
    if not sound or sensor not in ('accel', 'gyro') or np.linalg.cond(scale) > 100:
        raise InputError('S and bias of this calibration cannot be applied', 'calibrate again')
    return Correction(sensor, scale, bias, Model(effects), reference)
