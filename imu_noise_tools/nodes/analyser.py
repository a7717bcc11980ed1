# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The analyser node: gathers samples, live or from a bag, and runs the loop on their noise."""

from __future__ import annotations

from pathlib import Path
import sys

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from .answers import worst
from .diagnostics import Diagnostics
from .intake import Intake
from .loop import guarded, Loop, serve
from .params import Setting, Settings
from .results import Results
from .run import run, threads_executor
from .saving import check, Folder, npz
from .streams import Streams
from .topics import STEADY
from .. import store
from ..core.errors import ImuNoiseError, InputError, UsageError
from ..loop.effect import load_effects, model_of
from ..loop.study import Study
from ..noise.problem import METHODS
from ..tasks import noise as tasks

_TICK = 0.25                # s
_PATIENCE = 12              # ticks without data after which a bag at its end is taken as it came


class Analyser(Node):
    """Data, curves and services run beside each other, in a group of callbacks each."""

    def __init__(self) -> None:
        super().__init__('analyser')
        self._settings = p = Settings(
            self,
            Setting('effects_from', '', 'Python file with effects of your own', fixed=True,
                    check=lambda path: path and load_effects(path)),
            Setting('input', 'messages', 'imu/data_raw or imu/buffer, never both', fixed=True,
                    choices=('messages', 'buffer')),
            Setting('accel_topic', '', 'Imu topic of the accelerations, where they have one of '
                    'their own beside imu/data_raw (a camera\'s)', fixed=True),
            Setting('effects', list(tasks.DEFAULT_EFFECTS), 'effects of the model that is fitted',
                    check=_model),
            Setting('method', 'likelihood', 'how the model is fitted', choices=METHODS),
            Setting('keep_motion', False, 'analyse everything, not the longest still stretch'),
            Setting('update_period', 5.0, 'time between two curves while data come', 's',
                    0.1, 3600.0),
            Setting('buffer_hours', 4.0, 'how much is held for the analysis', 'h', 0.001, 100.0,
                    fixed=True),
            Setting('output_dir', 'analyser.study', 'folder in which everything is saved',
                    check=check),
            Setting('exit_at_end', False, 'end by itself when a bag is at its end and analysed'))
        self._stream = Streams(p['buffer_hours'])
        self._intake = Intake(self, self._stream, p['input'], p['accel_topic'])
        self._results = Results(self, self._stream, self._intake)
        self._folder = Folder()
        self._study: Study | None = None
        self._passes = '0'                      # of a bag, that were dealt with
        self._refit = self._redraw = self._at_end = False
        self.status: int | None = None          # once set, the node ends with it
        group = MutuallyExclusiveCallbackGroup()
        Loop(self, self._the_study, self._show, group, more='every candidate: ~/save, study.yaml '
             'holds them, and imu_noise diagnose STUDY --json')
        for name in ('analyse', 'save', 'reset'):
            serve(self, name, getattr(self, name), group)
        self.create_timer(_TICK, self._work, callback_group=group, clock=STEADY)
        self._diagnostics = Diagnostics(
            self, lambda: self._results.statuses(self._study),
            lambda: self._stream.received if self._intake.end is None else None,
            lambda: self._stream.frame_id or self._intake.topic)
        self.create_timer(1.0, self._diagnostics.tell, clock=STEADY,
                          callback_group=MutuallyExclusiveCallbackGroup())
        self._refresh_timer = self.create_timer(
            p['update_period'], self._refresh, clock=STEADY,
            callback_group=MutuallyExclusiveCallbackGroup())
        p.changed = self._changed

    def analyse(self) -> dict:
        """Fit the model to everything that is held."""
        self._intake.read()
        self._results.tell('analysing')
        chosen = {name: self._settings[name] for name in ('effects', 'method', 'keep_motion')}
        try:
            if silence := self._intake.silence:
                raise silence
            record = self._stream.record(**self._intake.source)
            self._study = tasks.analyse_record(record, **chosen)
        except ImuNoiseError as error:
            self._results.failed(str(error))
            raise
        self._show(self._study)
        data = store.study_to_dict(self._study)
        return {'source': data['source'], 'targets': data['targets']}

    def save(self) -> dict:
        """Save the samples and everything that analyse writes."""
        return {'folder': str(self._save(tasks.outputs(self._the_study())))}

    def reset(self) -> dict:
        """Forget samples and study."""
        self._intake.clear()
        self._study = None
        return {'reset': True}

    def finish(self) -> None:
        """Save what was gathered: the samples, and the last study that was finished."""
        self._intake.read()
        if self._stream.received and self.status is None:       # else everything is written
            content = store.study_files(self._study) if self._study else {}
            self.get_logger().info(f'saved in {self._save(content)}')

    def _save(self, content):
        samples = {f'{sensor or "samples"}.npz': npz(**arrays)
                   for sensor, arrays in self._stream.arrays().items()}
        return self._folder.save(self._settings['output_dir'], {**samples, **content})

    def _the_study(self) -> Study:
        if self._study is None:
            raise InputError('nothing was analysed yet', 'call ~/analyse')
        return self._study

    def _show(self, study: Study) -> None:
        self._results.show(study)
        self._redraw = True

    def _work(self) -> None:
        """Do what comes due: analyse at the end of a bag, refit, draw, tell."""
        self._intake.read()
        end, received = self._intake.end, self._stream.received
        late = self._intake.idle() > _PATIENCE
        new = end is not None and self._intake.passes != self._passes
        if end is not None and new and (received >= end or late):
            self._passes, self._at_end = self._intake.passes, True
            self._refit = bool(received)
            if received < end or not end:
                self.get_logger().warning(f'{end - received} of {end} samples did not arrive')
        good = all([self._done(due, work) for due, work in (
            ('_refit', self.analyse), ('_redraw', self._draw))])
        leave = False
        if self._at_end:
            self._at_end = False
            good = good and self._stream.received > 0 and self._attempt(self._conclude)
            leave = self._settings['exit_at_end']
        self._results.tell('gathering' if self._study is None else 'analysed')
        if leave:       # last of all: what is published after that finds nothing to publish on
            self.status = 0 if good and self._stream.complete else 1

    def _done(self, due: str, work) -> bool:
        """Do what is due, if it is; return False where it failed."""
        if not getattr(self, due):
            return True
        setattr(self, due, False)
        return self._attempt(work)

    def _attempt(self, work) -> bool:
        said, good = guarded(self, work)
        if not good:
            self.get_logger().error(f'{said["error"]} {said.get("remedy", "")}')
        return good

    def _conclude(self) -> None:
        """Write everything, and say in four lines what was found."""
        study = self._the_study()
        folder = self._save(tasks.outputs(study))
        for line in summary(store.study_to_dict(study), folder):
            self.get_logger().info(line)

    def _draw(self) -> None:
        self._results.draw(self._the_study())

    def _refresh(self) -> None:
        self._intake.read()
        self._results.refresh(self._study)

    def _changed(self, values) -> None:
        if 'update_period' in values:
            self._refresh_timer.timer_period_ns = int(values['update_period'] * 1e9)
        if self._study is not None and {'effects', 'method', 'keep_motion'} & set(values):
            self._refit = True


def summary(data: dict, folder: str | Path | None) -> list[str]:
    """Return four lines on a study: what was analysed, a line a sensor, where it is."""
    source = data['source']
    lines = [f'analysed: {source["samples"]} samples, {source["duration_s"]:.5g} s at '
             f'{source["rate_hz"]:.6g} Hz']
    for sensor in ('gyro', 'accel'):
        axes = [e for t, e in data['targets'].items() if t.startswith(sensor)]
        lines.append(f'{sensor}, the worst of its axes: {", ".join(worst(axes))}' if axes
                     else f'no {sensor}')
    return [*lines, f'written to {folder}; next: imu_noise diagnose {folder}']


def _model(names: list[str]) -> None:
    """Refuse names that are no effects, and none at all."""
    if not len(model_of('noise', names)):
        raise UsageError('no effect is named', f'e.g. {", ".join(tasks.DEFAULT_EFFECTS)}')


def main(args: list[str] | None = None) -> int:
    """Run the node."""
    return run(Analyser, args, threads_executor)


if __name__ == '__main__':
    sys.exit(main())
