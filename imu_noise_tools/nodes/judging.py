# Copyright 2026 imu_noise_tools maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""From a running filter to a study of its innovations, and from the study back to what runs."""

from __future__ import annotations

from collections.abc import Mapping

from ..denoise.design import aligned, AUTO, Design
from ..denoise.problem import problem_of, START
from ..denoise.statespace import DOMAIN, Motion, OutputNoise
from ..effect import Model, model_of
from ..record import AXES
from ..study import Study

GYRO = AXES[:3]


def begin_study(t, z, design: Design, stated: Mapping[str, Mapping], source: Mapping) -> Study:
    """
    Return the study of a running design on its latest samples.

    Parameters
    ----------
    t, z : ndarray (n,), (n, 3)
        Stamps, s, and rates, rad/s.
    design : Design
        What runs. Its bank for any motion is no sum of effects: then the study starts from
        constant_rate + ar_increment.
    stated : mapping of axis to mapping of label to values
        What was given; the rest is fitted.
    source : mapping
        Where the samples came from, for people.

    Raises
    ------
    InputError
        Too few samples, or a constant axis.

    """
    motion = START[:2] if design.motion is None else [e.name for e in design.motion[0]]
    model = model_of(DOMAIN, [*motion, *(e.name for e in design.noise[0])])
    problems = {axis: problem_of(t, z[:, k], axis, stated[axis], design.alpha)
                for k, axis in enumerate(GYRO)}
    return Study.begin(problems, model, source)


def running(study: Study, automatic: bool) -> dict:
    """Return what is to run by a study: motion, noise, and the values of each axis."""
    whole = aligned([study.states[axis].model for axis in GYRO])
    motion = [e.name for e in whole[0].of(Motion)]
    return {'motion': [AUTO] if automatic else motion,
            'noise': [Model(m.of(OutputNoise)) for m in whole],
            'values': [{e.label: dict(e.values) for e in m} for m in whole]}
