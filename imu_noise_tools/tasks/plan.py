# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How long to record for a wanted precision."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from .. import store
from ..core import units
from ..core.errors import InputError
from ..loop.effect import Estimate, find_effect, Model
from ..noise.plan import durations_for, precision, range_in_words
from ..noise.problem import NoiseProblem

_EFFECTS = {'N': 'white', 'B': 'flicker', 'K': 'random_walk'}


def plan(
    folder: str | Path | None, given: Any, *, sensor: str = 'gyro', rate_hz: float = 100.0,
    wanted: float = 0.2
) -> list[dict]:
    """
    Return one row a parameter: what an hour gives, and how long a record must be.

    The record is as long as the wanted relative precision takes, from the interval of the
    parameter: ``seconds_at_least`` at its upper end, ``seconds`` at its lower.

    Parameters
    ----------
    folder : path or None
        A noise study to take the models from.
    given : mapping
        N, B, K in SI, where there is no study.
    sensor : str
        ``gyro`` or ``accel``, where there is no study.
    rate_hz : float
        Sample rate, where there is no study.
    wanted : float
        Relative standard deviation that is wanted.

    Raises
    ------
    InputError
        There is no study of noise in the folder.

    """
    if folder:
        if (domain := store.read(folder)['domain']) != 'noise':
            raise InputError(f'{folder}: a {domain} study; only noise has records to plan',
                             'name the study that analyse wrote')
        study = store.load(folder)
        problems = {t: cast(NoiseProblem, s.problem) for t, s in study.states.items()}
        models = {t: (s.model, problems[t].evidence.dt, s.fit.estimates)
                  for t, s in study.states.items()}
        holds = {t: problems[t].matters(s.fit).sufficient for t, s in study.states.items()}
    else:
        models = {
            sensor: (
                Model(find_effect('noise', _EFFECTS[k])({k: v}) for k, v in given.items()),
                1 / rate_hz,
                {_EFFECTS[k]: {k: Estimate(v, None, None, '')} for k, v in given.items()},
            )
        }
        holds = {sensor: True}
    rows: list[dict] = []
    for target, (model, dt, estimates) in models.items():
        if not holds[target]:
            rows.append({'target': target, 'parameter': 'all', 'value': None, 'one_hour': '',
                         'one_hour_relative': None, 'seconds': None,
                         'record': 'not planned: the model does not hold (imu_noise diagnose)'})
            continue
        hour = precision(model, 3600.0, dt)
        for (label, name), share in hour.items():
            e = estimates[label][name]
            unit, sensor = model[label].parameter(name).unit, target.partition('_')[0]
            least, most = durations_for(model, estimates, label, name, dt, wanted)
            rows.append(
                {
                    'target': target,
                    'parameter': f'{label}.{name}',
                    'value': e.value,
                    'upper95': e.upper95,
                    'unit': units.si(unit, sensor),
                    'shown': units.shown(e.value, unit, sensor) if e.upper95 is None
                    or e.value is not None else f'below {units.shown(e.upper95, unit, sensor)}',
                    'one_hour': f'{100 * share:.2g} %' if share < 10 else 'nothing',
                    'one_hour_relative': share,
                    'record': range_in_words(least, most),
                    'seconds_at_least': least,
                    'seconds': most,
                }
            )
    return rows
