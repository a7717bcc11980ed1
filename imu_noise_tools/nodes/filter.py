# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The filter node: one Imu message in, one with less noise out."""

from __future__ import annotations

from collections import deque
import math
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu

from . import messages
from .aside import Aside
from .diagnostics import Diagnostics
from .filter_settings import chosen, given_values, unit_of, value_settings
from .judging import begin_study, GYRO, running
from .loop import Loop, MORE, serve
from .params import Setting, Settings
from .run import run
from .times import ARRIVALS, Times
from .topics import ImuInput, live, overridable, result, STEADY
from ..core.errors import InputError
from ..core.units import read_in, to_si
from ..filter.design import AUTO
from ..filter.engine import designed, Engine
from ..filter.evaluate import Innovations
from ..loop.study import Study
from ..tasks.filter import BIAS, CORRELATED, from_study

_SHOWN = 4096           # latest innovations of which the figures are published
_JUDGED = 16384         # latest samples that a diagnosis looks at


class Filter(Node):
    """Every message is filtered in its own callback; services and figures run aside."""

    def __init__(self) -> None:
        super().__init__('filter')
        self._settings = p = Settings(
            self,
            Setting('model', '', 'folder of an analysed study, for the noise'),
            Setting('motion', [AUTO], 'what drives the rate; auto: a bank for any motion'),
            Setting('noise', ['white'], 'what adds to the output'),
            Setting('alpha', 1.0, 'fading memory; 1: none', '1', 0.01, 1.0),
            Setting('delay', 0.0, 'for how long a message waits for later ones; 0: for none', 's',
                    0.0, 100.0),
            Setting('rate_hz', 0.0, 'nominal rate; 0: by the first stamps', 'Hz', 0.0, 1e5,
                    fixed=True),
            *value_settings())
        self._engine = Engine(rate_hz=p['rate_hz'] or None, **chosen(p))
        self._read_in(unit_of(p))
        self._lock = threading.Lock()           # of the engine: it is switched from two threads
        self._adopting = False
        p.together = lambda new: designed(**chosen(new))
        p.changed = self._changed
        # messages whose rates are to come, and those without a rate between them: (raw, has one)
        self._waiting: deque[tuple[bytes, bool]] = deque()
        self._told = 0                          # samples when figures were last told
        self._times = Times()
        self._named = False                     # the frame, by the first message
        self._frame = self.resolve_topic_name('imu/data_raw')
        self._study: Study | None = None
        self._output = self.create_publisher(
            Imu, 'imu/data_filtered', live(), qos_overriding_options=overridable())
        self._innovations = self.create_publisher(DiagnosticArray, '~/innovations', result())
        self._input = ImuInput(self, self._take, live, drain=False)
        self._topic = self._input.topic
        self._aside = Aside(self)
        Loop(self._aside, self._the_study, self._adopt, fresh=self._begin,
             compute=self._aside.compute, more=MORE.format(command='filter'))
        serve(self._aside, 'reset', self.reset)
        self._diagnostics = Diagnostics(
            self, self._statuses, self._received, lambda: self._frame)
        self._aside.create_timer(1.0, self._tell, clock=STEADY)
        self._aside.create_timer(1.0, self._diagnostics.tell, clock=STEADY)
        self._aside.begin()
        self.get_logger().info(f'{BIAS}; {CORRELATED}')

    def _changed(self, values) -> None:
        if not self._adopting:
            # what the loop has put into the model stays when only the memory changes
            new = values if set(values) <= {'alpha', 'delay'} else chosen(self._settings)
            self._switch(**new)
            if 'model' in values:
                self._read_in(unit_of(self._settings))

    def _read_in(self, unit: str) -> None:
        """Take rates in this unit from now on; what is published is rad/s."""
        self._factor = to_si('gyro', unit)
        if self._factor != 1:
            for said in read_in({'gyro': unit}, 'as the model\'s recording was'):
                self.get_logger().info(said)

    def _switch(self, **new) -> None:
        with self._lock:
            self._engine.switch(**new)
            self._publish_due()         # nothing waits for what another model would say

    def _take(self, batch: list[bytes]) -> None:
        """Filter a message and publish it; one that is not finite is refused, and counted."""
        raw = messages.plain(batch[0])
        stamp, rate, there = messages.rate_of(raw)
        if not there:
            with self._lock:
                self._waiting.append((raw, False))
                self._publish_rateless()
            return
        if not self._named:
            self._named, self._frame = True, messages.frame_of(raw) or self._topic
        with self._lock:
            at = self._time(stamp, rate)
            rate = tuple(self._factor * x for x in rate)
            if self._engine.step(at, rate) is not None:
                self._waiting.append((raw, True))
            self._publish_due()

    def _time(self, stamp: int, rate: tuple[float, ...]) -> float:
        """Return the time of a message, s; that it is not that of its stamp is said once."""
        before = self._times.standing
        at = self._times.of(stamp, time.monotonic_ns(), rate)
        if self._times.standing and not before:
            self.get_logger().warning(f'{self._topic}: {ARRIVALS}', once=True)
            if self._engine.rate_hz is None:
                self._engine.reset()        # no rate is read from stamps that are none
        return at * 1e-9

    def _publish_due(self) -> None:
        """Publish the messages whose delay is over: they come out in the order they came in."""
        for answer in self._engine.due():
            self._output.publish(messages.with_rate(self._waiting.popleft()[0], *answer))
            self._publish_rateless()

    def _publish_rateless(self) -> None:
        """Publish what has no rate to wait for, once no message before it waits."""
        while self._waiting and not self._waiting[0][1]:
            self._output.publish(self._waiting.popleft()[0])

    def _release(self) -> None:
        """Let nothing wait for messages that do not come."""
        with self._lock:
            self._engine.finish()
            self._publish_due()

    # Aside: the loop, reset, figures.

    def reset(self) -> dict:
        """Forget the stream; the settings stay."""
        with self._lock:
            self._engine.finish()
            self._publish_due()         # what came before is answered by the model it came to
            self._engine.reset()
        self._study = None
        return {'reset': True}

    def _the_study(self) -> Study:
        return self._study or self._begin()

    def _begin(self) -> Study:
        """Return the study of the running model on the latest samples; the ladder goes on."""
        p = self._settings
        with self._lock:
            t, z, _ = self._engine.history.latest(_JUDGED)
            design, counts = self._engine.design, self._engine.counts
        if not len(t):
            raise self._input.silence() or InputError(
                f'{self._topic}: no rate was received yet', 'wait for some, or check the driver')
        stated: dict[str, dict] = dict.fromkeys(GYRO, {})
        if p['model']:
            stated = {**stated, **from_study(p['model'], p['motion'], p['noise'])[2]}
        stated = {axis: {**stated[axis], **given_values(p)} for axis in GYRO}
        source = {'path': self._topic, 'topic': self._topic, 'samples': counts.samples,
                  'rate_hz': self._engine.rate_hz, 'judged': len(t), **design.names}
        study = self._aside.compute(begin_study, t, z, design, stated, source)
        if self._study:
            study.history = [*self._study.history, *study.history]
        self._study = study
        return study

    def _adopt(self, study: Study) -> None:
        """Let what the loop has come to run, where that is something else."""
        self._study = study
        before = self._engine.design.names
        new = running(study, automatic=self._engine.design.motion is None)
        names = {'motion': new['motion'], 'noise': [e.name for e in new['noise'][0]]}
        if names != before:
            self._switch(**new)
            self._adopting = True
            self.set_parameters([Parameter(k, value=v) for k, v in names.items()])
            self._adopting = False
        self._tell()

    def _tell(self) -> None:
        """Publish how the innovations look, axis by axis; a stream that stops is let out."""
        if self._told == self._engine.counts.samples:
            self._release()
        self._told = self._engine.counts.samples
        self._innovations.publish(messages.diagnostics(self, self._statuses()))

    def _received(self) -> int:
        """Return how many messages came, those that are not finite too."""
        return self._engine.counts.samples + self._engine.counts.refused

    def _statuses(self) -> list[DiagnosticStatus]:
        """Return how the stream is, and how the innovations look, axis by axis."""
        _, _, scores = self._engine.history.latest(_SHOWN)
        counts, names = self._engine.counts, self._engine.design.names
        about = {**vars(counts), 'rate [Hz]': self._engine.rate_hz,
                 **{k: ' '.join(v) for k, v in names.items()}}
        said, level = f'{counts.samples} samples', messages.OK
        if counts.refused:
            said, level = f'{said}, {counts.refused} refused: not finite', messages.WARN
        elif silence := self._input.silence():
            said = silence.message
        if self._times.standing:
            said, level = f'{said}; {ARRIVALS}', messages.WARN
        statuses = [messages.status('stream', said, about, level)]
        for k, axis in enumerate(GYRO):
            found = Innovations.of(scores[:, k])
            judged = self._study.diagnosis.get(axis) if self._study else None
            verdict = judged.verdict if judged else 'not judged'
            missing = judged is not None and judged.verdict in ('missing', 'unknown')
            beyond = _beyond_chance(found)
            level = messages.WARN if missing or beyond else messages.OK
            said = f'{verdict}: innovations beyond chance' if beyond else verdict
            statuses.append(messages.status(axis, said, {
                'nis [1]': found.nis, 'mean [1]': found.mean, 'autocorrelation [1]': found.lag1,
                'kurtosis [1]': found.kurtosis, 'samples': found.n, 'verdict': verdict},
                level))
        return statuses

    def finish(self) -> None:
        """Stop what runs aside; what still waits comes out."""
        self._aside.end()
        self._release()


def _beyond_chance(found: Innovations) -> bool:
    """
    Tell whether innovations are not those of a true model, by more than chance and by much.

    Of n white ones the autocorrelation has the standard error 1/sqrt(n), the mean square
    sqrt((2 + kurtosis)/n); five of them, and a tenth or a factor of two, are beyond.

    """
    if found.n < 100:
        return False
    scatter = math.sqrt(max(2.0 + found.kurtosis, 1.0) / found.n)
    level = not 0.5 < found.nis < 2.0 and abs(found.nis - 1) > 5 * scatter
    return level or abs(found.lag1) > max(0.1, 5 / math.sqrt(found.n))


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run(Filter, args)


if __name__ == '__main__':
    sys.exit(main())
