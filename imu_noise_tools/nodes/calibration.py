# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The calibration node: captures poses when asked, solves them, and corrects the stream."""

from __future__ import annotations

from pathlib import Path
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from sensor_msgs.msg import Imu

from . import messages
from .diagnostics import Diagnostics
from .loop import Loop, MORE, serve
from .params import Setting, Settings
from .run import run, threads_executor
from .saving import free
from .times import ARRIVALS, Times
from .topics import ImuInput, live, overridable, result, STEADY
from ..calibration import applied, HOLD_S
from ..core.errors import InputError
from ..core.files import refuse_unwritable
from ..core.units import DEG, G0, read_in
from ..loop.study import Study
from ..tasks.calibration import as_dict, assumed, doubts, FILE, place, Session

_REMEDY = 'set the parameter file to a place that can be written'


class Calibration(Node):
    """The stream is fed and corrected in one group of callbacks, services work in another."""

    def __init__(self) -> None:
        super().__init__('calibration')
        self._settings = p = Settings(
            self,
            Setting('sensor', 'accel', 'what is calibrated', choices=('accel', 'gyro'),
                    fixed=True),
            Setting('gravity', G0, 'local gravity', 'm/s^2', 0.1, 30.0, fixed=True),
            Setting('rate_deg_s', 0.0, 'rate of the turntable, for the gyro; 0: none', 'deg/s',
                    0.0, 1e4, fixed=True),
            Setting('turn_deg', 0.0, 'angle of turns by hand, for the gyro; 0: none', 'deg',
                    0.0, 1e5, fixed=True),
            Setting('still_seconds', HOLD_S, 'how long a pose is still before it counts', 's',
                    0.2, 60.0),
            Setting('tilt_deg', 1.0, 'how well faces are level, rms', 'deg', 0.0, 10.0),
            Setting('method', 'auto', 'how poses are solved',
                    choices=('auto', 'faces', 'wls', 'ols', 'norm', 'few')),
            Setting('file', '', f'loaded at the start if there, written by ~/save (else {FILE})',
                    fixed=True))
        self._session = Session(
            p['sensor'], p['gravity'], p['rate_deg_s'] * DEG or None, p['turn_deg'] * DEG or None)
        self._lock = threading.Lock()           # samples come while a capture looks at them
        self._saved = True
        self._samples, self._times, self._arrived = 0, Times(), time.monotonic_ns()
        self._status = self.create_publisher(DiagnosticArray, '~/calibration', result())
        self._output = self.create_publisher(
            Imu, 'imu/data_calibrated', live(), qos_overriding_options=overridable())
        self._frame = ImuInput(self, self._take).topic
        self._diagnostics = Diagnostics(
            self, self._statuses, lambda: self._samples, lambda: self._frame)
        group = MutuallyExclusiveCallbackGroup()
        Loop(self, lambda: self._session.study, self._adopt, group,
             more=MORE.format(command='calibrate'))
        for name in ('capture', 'solve', 'save', 'reset'):
            serve(self, name, getattr(self, name), group)
        for tell in (self._tell, self._diagnostics.tell):
            self.create_timer(1.0, tell, callback_group=group, clock=STEADY)
        p.changed = self._changed
        self._changed({})
        self._begin_with(p['file'])
        self._tell()

    def _begin_with(self, file: str) -> None:
        """Load what is there; refuse a file that is neither there nor can be made."""
        log, there = self.get_logger(), bool(file) and Path(file).exists()
        try:
            refuse_unwritable(place(file or FILE), _REMEDY)
        except InputError as error:
            if file and not there:
                raise
            log.warning(f'~/save will fail: {error}')
        if not there:
            if file:
                log.info(f'{file} is not there: nothing is corrected until poses are solved; '
                         '~/save writes it')
            return
        self._session.load(file)
        log.info(f'{file} is applied until something is solved')
        for said in read_in(self._session.input_unit, 'as the calibration\'s recording was'):
            log.info(said)
        for said in (*doubts(file), *assumed(*self._session.corrections)):
            log.warning(f'{file}: {said}')

    def _changed(self, _) -> None:
        p, method = self._settings, self._settings['method']
        self._session.still_seconds = p['still_seconds']
        self._session.tilt = p['tilt_deg'] * DEG
        self._session.method = None if method == 'auto' else method

    def _take(self, batch: list[bytes]) -> None:
        samples = messages.samples(batch)
        if not len(samples):
            return
        # messages read in one go came one by one since the last were
        before, self._arrived = self._arrived, time.monotonic_ns()
        arrivals = np.linspace(before, self._arrived, len(samples) + 1)[1:].astype(np.int64)
        with self._lock:
            for stamp, arrival, gyro, accel in zip(
                    samples.stamps.tolist(), arrivals.tolist(), samples.gyro, samples.accel):
                at = self._times.of(stamp, arrival, (*gyro.tolist(), *accel.tolist()))
                self._session.feed(at * 1e-9, gyro, accel)
        if self._times.standing:
            self.get_logger().warning(f'{self._frame}: {ARRIVALS}', once=True)
        self._samples += len(samples)
        self._frame = samples.frame_id or self._frame
        corrections = self._session.corrections
        if not corrections:
            return
        changes = dict(zip(('gyro', 'accel'), applied(
            corrections, *self._session.in_si(samples.gyro, samples.accel))))
        mine = {*self._session.input_unit, *(c.sensor for c in corrections)}
        changes = {sensor: changes[sensor] for sensor in mine}
        for k, index in enumerate(samples.readable.nonzero()[0]):
            self._output.publish(messages.with_vectors(
                messages.plain(batch[index]), **{name: x[k] for name, x in changes.items()}))

    def capture(self) -> dict:
        """Average the still window that ends now; say which face it was and which are left."""
        with self._lock:
            seen = self._session.capture()
        self._tell()
        return {'held': seen.name, 'done': seen.done, 'of': seen.of, 'left': list(seen.left),
                'note': seen.note}

    def solve(self) -> dict:
        """Solve the poses captured so far; from now on the stream is corrected."""
        self._session.solve()
        return self._solved()

    def save(self) -> dict:
        """Write calibration.yaml."""
        path = self._save(Path(self._settings['file'] or FILE))
        self._saved = True
        return {'file': str(path.resolve())}

    def _save(self, path: Path) -> Path:
        self._session.study         # one that is not solved has another remedy
        try:
            return self._session.save(path)
        except InputError as error:
            raise InputError(error.message, _REMEDY) from error

    def reset(self) -> dict:
        """Forget poses, solution and what was loaded."""
        with self._lock:
            self._session.reset()
        self._saved = True
        self._tell()
        return {'reset': True}

    def finish(self) -> None:
        """Save a solution that was not, beside what is there."""
        if not self._saved:
            path = self._save(free(place(self._settings['file'] or FILE)))
            self.get_logger().info(f'saved {path}')

    def _adopt(self, study: Study) -> None:
        self._session.adopt(study)
        self._solved()

    def _solved(self) -> dict:
        self._saved = False
        self._tell()
        return as_dict(self._session.study)

    def _tell(self) -> None:
        """Publish what is captured, and what corrects the stream."""
        self._status.publish(messages.diagnostics(self, self._statuses()))

    def _statuses(self) -> list[DiagnosticStatus]:
        """Return a status of the session, and one of each sensor that is corrected."""
        session = self._session
        solutions = {c.sensor: c for c in (session.calibration, session.gyro) if c is not None}
        wanted, left = session.wanted, session.left
        text = f'left: {", ".join(left)}' if left else 'every face captured'
        standing = self._times.standing
        text += f'; {ARRIVALS}' * standing
        statuses = [messages.status('session', text, {
            'samples': self._samples, 'captured': len(wanted) - len(left), 'of': len(wanted),
            'left': ' '.join(left), 'solved': bool(solutions)},
            messages.WARN if standing else messages.OK)]
        for correction in session.corrections:
            unit = 'm/s^2' if correction.sensor == 'accel' else 'rad/s'
            matrix = {f'S_{"xyz"[i]}{"xyz"[j]} [1]': v
                      for (i, j), v in np.ndenumerate(correction.S)}
            bias = {f'bias_{axis} [{unit}]': v for axis, v in zip('xyz', correction.bias)}
            solution = solutions.get(correction.sensor)
            doubts = solution.warnings if solution else ()
            statuses.append(messages.status(
                correction.sensor, '; '.join(('solved' if solution else 'loaded', *doubts)),
                {**matrix, **bias}, messages.WARN if doubts else messages.OK))
        return statuses


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run(Calibration, args, threads_executor)


if __name__ == '__main__':
    sys.exit(main())
