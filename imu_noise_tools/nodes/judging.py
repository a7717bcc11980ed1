# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a running filter to a study of its innovations, and from the study back to what runs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..core.record import AXES
from ..filter.design import aligned, AUTO, Design
from ..filter.held import held_samples
from ..filter.motion import AnyMotion
from ..filter.problem import problem_of
from ..filter.statespace import DOMAIN, Motion, OutputNoise
from ..loop.effect import Model, model_of
from ..loop.study import Study

GYRO = AXES[:3]


def begin_study(t: np.ndarray, z: np.ndarray, design: Design, stated: Mapping[str, Mapping],
                source: Mapping) -> Study:
    """
    Return the study of a running design on its latest samples.

    Parameters
    ----------
    t, z : ndarray (n,), (n, 3)
        Stamps, s, and rates, rad/s.
    design : Design
        What runs; its bank for any motion is one effect, any_motion.
    stated : mapping of axis to mapping of label to values
        What was given; the rest is fitted.
    source : mapping
        Where the samples came from, for people.

    Raises
    ------
    InputError
        Too few samples, or a constant axis.

    """
    motion = [AnyMotion.name] if design.motion is None else [e.name for e in design.motion[0]]
    model = model_of(DOMAIN, [*motion, *(e.name for e in design.noise[0])])
    held = held_samples(z)
    problems = {axis: problem_of(t, z[:, k], axis, stated[axis], design.alpha, held)
                for k, axis in enumerate(GYRO)}
    return Study.begin(problems, model, source)


def running(study: Study, automatic: bool) -> dict:
    """Return what is to run by a study: motion, noise, and the values of each axis."""
    whole = aligned([study.states[axis].model for axis in GYRO])
    motion = [e.name for e in whole[0].of(Motion)]
    return {'motion': [AUTO] if automatic else motion,
            'noise': [Model(m.of(OutputNoise)) for m in whole],
            'values': [{e.label: dict(e.values) for e in m} for m in whole]}
