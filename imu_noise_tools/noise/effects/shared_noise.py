# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""A disturbance that axes share."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Coupling, Inputs, Parameter
from ..shared import HEARD, LATER, quarter_later, SHAKEN
from ...core.record import AXES, sensor_of
from ...loop.effect import Effect


class SharedNoise(Coupling):
    """This axis holds a share of what the other axes of the same sensor measure."""

    name = 'shared_noise'
    symbol = 'gain, later, other_gain, other_later, source, other, heard'
    title = 'noise shared with another axis'
    equation = (
        'y = ... + gain s + later H[s] + other_gain o + other_later H[o], s the source, o the '
        'third axis, H a quarter of a period later; as recorded, or what in them is not their '
        'own noise'
    )
    signature = 'coherence between axes of one sensor at rest, at any phase'
    hint = (
        'Common supply or reference noise, real motion of the mount, or cross-talk: one source '
        'for all axes that are named. At rest on a heavy base true motion should be gone: record '
        'there; if it stays it is electrical.'
    )
    reference = 'Bendat and Piersol, Random Data, coherence functions'
    must_be_normal = True
    yields = 'what several axes have in the mean'   # a step of them is no noise that they share
    needs = 'analyse a record with all axes of the sensor'
    decide = 'record on a heavy base, on another supply'
    parameters = (
        *(
            Parameter(name, '1', -1e3, 1e3, log=False, amplitude=True, linear=True, title=title)
            for name, title in (
                ('gain', 'share of the source'),
                ('later', 'share of the source a quarter of a period later'),
                ('other_gain', 'share of the third axis, which hears the same'),
                ('other_later', 'share of the third axis a quarter of a period later'),
            )
        ),
        Parameter.choice('source', AXES, title='the axis that hears the same most clearly'),
        Parameter.choice('other', AXES, title='the third axis; the source where there is none'),
        Parameter.choice('heard', HEARD, title='what of it'),
    )
    optional = ('later', 'other_gain', 'other_later')

    def starts(self, evidence: Evidence) -> list[Effect]:
        """Take the axis of the same sensor that is most coherent with this one, and the third."""
        if 'source' in self.values:
            return [self]
        axes = sorted((a for a in evidence.channels
                       if a in AXES and sensor_of(a) == evidence.sensor),
                      key=lambda a: -_coherence(evidence, a))
        if not axes:
            return []
        some = [self.with_values(source=axes[0], other=axes[-1], heard=h) for h in HEARD]
        return [e for e in some if e.channels(evidence)]

    def channels(self, evidence: Evidence) -> tuple[str, ...]:
        """Return the source and the third axis, each as it is and later."""
        some = [self.chosen(k) if k in self.values else AXES[0] for k in ('source', 'other')]
        if not set(some) <= set(evidence.channels):
            return ()
        if self.values.get('heard'):
            if not evidence.shaken_together(some[0]):
                return ()
            some = [a + SHAKEN for a in some]
        if some[0] == some[1]:      # there is no third axis: nothing in its place
            some[1] += LATER + LATER
        return tuple(a + what for a in some for what in ('', LATER))

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Add the shares of the other axes."""
        for name, prefix in (('source', ''), ('other', 'other_')):
            gain, late = self[f'{prefix}gain'], self[f'{prefix}later']
            if gain or late:
                other = inputs.axes[self.chosen(name)]
                other = other - np.mean(other)
                x = x + gain * other + late * quarter_later(other)
        return x

    @classmethod
    def example(cls) -> Effect:
        """Return half of what gyro_y shows."""
        return cls({p.name: 0.0 for p in cls.parameters}
                   | {'gain': 0.5, 'source': 'gyro_y', 'other': 'gyro_z', 'heard': 'all'})


def _coherence(evidence, channel: str) -> float:
    """Return what is coherent with another axis, at any phase, in standard errors squared."""
    bins, out = evidence.whole.bins, 0.0
    for heard in (channel, channel + LATER):    # of a drift that is later has more power
        level = evidence.whole.power * evidence.common.pair(heard, heard, 'whole')
        both = evidence.coupled(evidence.axis, heard, 'whole') ** 2
        out += float(np.sum(bins.count * both / np.maximum(level, 1e-300)))
    return out
