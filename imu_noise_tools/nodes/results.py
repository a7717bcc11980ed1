# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the analyser publishes: counts, curves, coefficients, diagnosis, a picture."""

from __future__ import annotations

import threading

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Float64MultiArray

from . import messages
from .intake import Intake
from .streams import Streams
from .topics import result
from .. import store
from ..core.record import AXES
from ..loop.study import Study
from ..noise.behind import model_avar


class Results:
    """The topics of a study and of the stream it is made from."""

    def __init__(self, node, stream: Streams, intake: Intake):
        self._node, self._stream, self._intake = node, stream, intake
        self._drawn = 0
        self._state = 'gathering'
        self._coefficients: list[DiagnosticStatus] = []
        self._lock = threading.Lock()           # or a live curve comes after the final one
        kinds = {'status': DiagnosticArray, 'coefficients': DiagnosticArray,
                 'diagnosis': DiagnosticArray, 'plot': Image,
                 **{f'allan/{axis}': Float64MultiArray for axis in AXES}}
        self._outputs = {n: node.create_publisher(k, f'~/{n}', result()) for n, k in kinds.items()}

    def _publish(self, name: str, statuses) -> None:
        frame = self._stream.frame_id
        self._outputs[name].publish(messages.diagnostics(self._node, statuses, frame))

    def _counts(self) -> dict:
        s = self._stream
        return {'held': s.held, 'missed': s.missed, 'refused': s.refused,
                'not_finite': s.not_finite, 'complete': s.complete}

    def _flaws(self) -> str:
        """Return what is wrong with what came, to be put behind its number."""
        s = self._stream
        late = 0 if s.expected is None else s.expected - s.received
        flaws = ''.join(f', {n} {what}' for n, what in (
            (s.missed, 'missed'), (late, 'did not arrive'), (s.refused, 'could not be read'),
            (s.not_finite, 'not finite'), (s.received - s.held, 'no longer held')) if n > 0)
        flaws += '; several publish, their samples come mixed' if s.mixed else ''
        return flaws + (f'; {s.standing}' if s.standing else '')

    def tell(self, state: str) -> None:
        """Publish how many samples came."""
        self._state = state
        self._publish('status', [self._incoming(state, 'analyser')])

    def _incoming(self, state: str, name: str = 'input') -> DiagnosticStatus:
        """Return how what comes in is."""
        counts, received, flaws = self._counts(), self._stream.received, self._flaws()
        level = messages.OK if counts['complete'] and not flaws else messages.WARN
        silence = self._intake.silence
        said = silence.message if silence else f'{received} samples{flaws}'
        values = {'state': state, 'samples': received, **counts, 'rate [Hz]': self._stream.rate_hz}
        return messages.status(name, f'{state}, {said}', values, level)

    def show(self, study: Study) -> None:
        """Publish a study: coefficients, diagnosis, and curves with the model beside them."""
        data = store.study_to_dict(study)
        source, counts, flaws = data['source'], self._counts(), self._flaws()
        about = messages.status(
            'record', f'{source["samples"]} samples at {source["rate_hz"]:g} Hz{flaws}', {
                'samples': source['samples'], 'rate [Hz]': source['rate_hz'],
                'duration [s]': source['duration_s'], **counts},
            messages.OK if counts['complete'] and not flaws else messages.WARN)
        self._coefficients = [about, *(
            messages.coefficients(t, e) for t, e in data['targets'].items()), *(
            messages.status(axis, 'never changes', level=messages.ERROR)
            for axis in self._stuck(data['targets']))]
        self._publish('coefficients', self._coefficients)
        self._publish('diagnosis', [
            messages.diagnosis(t, d) for t, d in data['diagnosis'].items()])
        with self._lock:
            self._drawn = self._stream.received
            for axis, state in study.states.items():
                c = state.problem.evidence.curve        # type: ignore[attr-defined]
                model = _deviation(state.model, c.m, c.dt)
                self._curve(axis, c.tau, c.dev, c.lo, c.hi, model, 'analysed')

    def _stuck(self, targets) -> list[str]:
        """Return the axes of a sensor that others of it were analysed beside."""
        there = {t.partition('_')[0] for t in targets}
        return [a for a in AXES if a not in targets and a.partition('_')[0] in there]

    def failed(self, why: str) -> None:
        """Publish that there is no result, and why."""
        self._coefficients = [messages.status(
            'record', why, {'samples': self._stream.received, **self._counts()}, messages.ERROR)]
        self._publish('coefficients', self._coefficients)

    def statuses(self, study: Study | None) -> list[DiagnosticStatus]:
        """Return how what comes in, and each axis, is: the stream first."""
        out = [self._incoming(self._state)]
        out += [messages.copied(s) for s in self._coefficients]
        judged = {} if study is None else study.diagnosis
        for status in out[1:]:
            if status.name in judged and status.level == messages.OK:
                found = messages.diagnosis(status.name, store.diagnosis_to_dict(
                    status.name, judged[status.name]))
                status.level, status.message = found.level, found.message
        return out

    def draw(self, study: Study) -> None:
        """Publish the picture of a study."""
        from ..plots.noise import allan_figure
        from ..plots.signed import signed
        from ..plots.style import pixels
        self._outputs['plot'].publish(messages.image(
            self._node, pixels(signed(allan_figure(study), study.source))))

    def refresh(self, study: Study | None) -> None:
        """Publish the live curves where samples have come since, with the model there is."""
        with self._lock:
            received = self._stream.received
            if received == self._drawn:
                return
            self._drawn = received
            for axis, k, dt, (tau, dev, lo, hi) in self._stream.curves():
                if len(tau) and np.all(dev[:, k] > 0):
                    model = None
                    if study is not None and axis in study.states:
                        model = _deviation(study.states[axis].model, np.round(tau / dt), dt)
                    self._curve(axis, tau, dev[:, k], lo[:, k], hi[:, k], model,
                                'live: stride m/16')

    def _curve(self, axis: str, *columns) -> None:
        self._outputs[f'allan/{axis}'].publish(messages.curve(*columns))


def _deviation(model, m, dt) -> np.ndarray:
    """Return the deviation that a model gives at cluster sizes m."""
    return np.sqrt(np.maximum(model_avar(model, m, dt), 0))
