# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Targets that are looked at side by side: what is found, kept and told is as one by one."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

from imu_noise_tools.core.errors import InputError
from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.loop.effect import load_effects, model_of
from imu_noise_tools.loop.study import Study
from imu_noise_tools.noise.gather import gather
from imu_noise_tools.noise.problem import NoiseProblem
from imu_noise_tools.store import plain, study_to_dict
from imu_noise_tools.tasks.side_by_side import diagnose
from imu_noise_tools.tasks.worker import StoppedError, Worker

AXES = ['gyro_x', 'gyro_y', 'gyro_z']
OWN = '''
from imu_noise_tools.loop.effect import Parameter
from imu_noise_tools.noise.kinds import Spectrum


class Floor(Spectrum):
    """A level of its own."""

    name = 'floor_of_mine'
    title = 'floor'
    equation = 'S(f) = A^2'
    parameters = (Parameter('A', '{rate}', 1e-9, 1e3, amplitude=True),)

    def psd(self, f, dt):
        return self['A']**2 / (1 + (f / 0.5)**2)
'''


@functools.lru_cache
def problems():
    """Return the problems of three axes, of which two have a line and one of them two."""
    n, dt, rng = 20_000, 0.01, np.random.default_rng(1)
    t = np.arange(n) * dt
    gyro = 1e-3 * rng.standard_normal((n, 3))
    gyro[:, 0] += 2e-4 * np.sin(2 * np.pi * 7 * t) + 1.5e-4 * np.sin(2 * np.pi * 23 * t)
    gyro[:, 2] += 2e-4 * np.sin(2 * np.pi * 11.3 * t)
    record = ImuRecord(gyro, None, t, 1 / dt)
    return {a: NoiseProblem(e) for a, e in gather(record, AXES).items()}


def begun() -> Study:
    """Return a study of white noise."""
    return Study.begin(problems(), model_of('noise', ['white']), {'path': 'simulated'})


def looked(processes, until_complete):
    """Return the study as it is written, what was told, and what was kept by each time."""
    study, told, kept = begun(), [], []
    diagnose(study, until_complete=until_complete, processes=processes,
             told=lambda t, step: told.append((t, step and step.added)),
             keep=lambda: kept.append(plain(study_to_dict(study))))
    return plain(study_to_dict(study)), told, kept


@pytest.mark.parametrize('until_complete', [False, True])
def test_side_by_side_is_as_one_by_one(until_complete):
    """Whatever of it ends first: the verdicts, the ladder, and the order in which it is told."""
    one, said, kept = looked(1, until_complete)
    assert list(one['diagnosis']) == AXES
    some, told, kept_beside = looked(2, until_complete)
    assert some == one and list(some['diagnosis']) == AXES
    assert told == said
    assert [t for t, step in told if step is None] == AXES
    assert len(kept_beside) == len(kept)
    if until_complete:
        assert {s['target'] for s in one['history'] if s['added']} == {'gyro_x', 'gyro_z'}
        assert kept_beside[-1] == kept[-1] == one
        for early in kept_beside:   # what is left by a process that is killed is a study
            assert [s['target'] for s in early['history'][:3]] == AXES


def test_targets_that_fail_nowhere_need_no_process(monkeypatch):
    monkeypatch.setattr(Worker, 'start', lambda self: pytest.fail('a process'))
    study = begun()
    diagnose(study, ['gyro_x', 'gyro_y'], processes=2)
    assert sorted(study.diagnosis) == ['gyro_x', 'gyro_y']


def test_an_effect_of_ones_own_goes_along(tmp_path, clean_registry):
    """To a process and back: the file that it is in is no module that another could import."""
    path = tmp_path / 'mine.py'
    path.write_text(OWN)
    load_effects(path)
    study = Study.begin(problems.__wrapped__(), model_of('noise', ['white', 'floor_of_mine']))
    diagnose(study, processes=2)
    assert all('floor_of_mine' in s.model for s in study.states.values())
    assert {t for t, d in study.diagnosis.items() if d.found} == {'gyro_x', 'gyro_z'}


def test_what_fails_in_a_process_ends_the_others():
    """With the sentence that it was, wherever in the order of the targets it is."""
    study = begun()

    def full():
        raise InputError('the disk is full')

    with pytest.raises(InputError, match='the disk is full'):
        diagnose(study, until_complete=True, processes=2, keep=full)


def test_a_process_that_is_killed_is_told(monkeypatch):
    """By a system that has no memory left, say; nothing waits for it."""
    run = Worker.run

    def killed(self, *args, **more):
        self._process.kill()
        self._process.join()
        self.start = lambda: None   # a process that is seen to be gone is begun anew
        return run(self, *args, **more)

    monkeypatch.setattr(Worker, 'run', killed)
    with pytest.raises(InputError, match='process .* was ended') as caught:
        diagnose(begun(), processes=2)
    assert '--jobs 1' in str(caught.value.remedy) and not isinstance(caught.value, StoppedError)


def test_a_process_ends_with_the_one_that_began_it(tmp_path):
    """However that ended: nothing computes on for nobody."""
    script = tmp_path / 'script.py'
    script.write_text(textwrap.dedent('''
        import time
        from imu_noise_tools.tasks.worker import Worker


        def busy(tell):
            tell('begun')
            time.sleep(600)


        if __name__ == '__main__':
            worker = Worker()
            worker.run(busy, tell=lambda _: print(worker._process.pid, flush=True))
    '''))
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as parent:
        pid = int(parent.stdout.readline())
        parent.kill()
    for _ in range(200):
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return
        time.sleep(0.1)
    os.kill(pid, signal.SIGKILL)
    pytest.fail('it is there still')
