# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The whole story on a simulated IMU.

Record, analyse, see the model fail, find the missing effect, add it, watch the error fall.

"""

from __future__ import annotations

from collections.abc import Callable
import importlib.util
import os
from pathlib import Path
import random
import signal
import subprocess
import sys
import time
from typing import Any

from . import noise, side_by_side
from .simulate import simulate
from .. import store
from ..core import files
from ..core.errors import ImuNoiseError
from ..report import words

GYRO = {'white': {'N': 8.7e-5}, 'flicker': {'B': 2.4e-5}, 'random_walk': {'K': 1.5e-6}}
ACCEL = {'white': {'N': 1.0e-3}, 'flicker': {'B': 4.0e-4}, 'random_walk': {'K': 1.5e-5}}
PATIENCE = 120.0        # s, until the analyser has the whole bag
# what is hidden: a machine that shakes one axis, and a part of the electronics that regulates
# slowly in another
SPEC: dict[str, Any] = {
    'rate_hz': 100.0,
    'duration_s': 3600.0,
    'seed': 7,
    'targets': {
        'gyro_x': {**GYRO, 'sinusoid': {'amplitude': 1.2e-4, 'frequency': 23.4}, 'bias': 2e-3},
        'gyro_y': {**GYRO, 'gauss_markov': {'sigma': 1.5e-4, 'tc': 4.0}, 'bias': -1e-3},
        'gyro_z': {**GYRO, 'bias': 5e-4},
        'accel_x': ACCEL,
        'accel_y': ACCEL,
        'accel_z': ACCEL,
    },
}


def demo(out: str | Path, progress: Any = None, say: Callable[[str], None] = print) -> dict:
    """
    Run the story into a folder (made anew); return what was found.

    Where rclpy is to be had the bag is also played by the real ``bag_reader`` to the real
    ``analyser``, as processes, and what they save must equal what the command line computes.

    """
    out = Path(out).resolve()
    with files.new_folder(out, force=True) as new:
        new = Path(new)
        say(
            '1. Simulate an hour of an IMU at rest, with something hidden in gyro_x and gyro_y: '
            f'{out / "bag"}'
        )
        simulate(SPEC, new / 'bag')
        say('2. Analyse it as anybody would: white + flicker + random_walk on every axis')
        study, _ = noise.analyse(new / 'bag', new / 'study', progress=progress)
        equal = _nodes(new, study, say)
        say('4. Compare: where does the model fail, by how much more than chance allows?')
        for t, s in study.compare().items():
            bad = ', '.join(words.title_of(v.name) for v in words.failing(s))
            say(f'   {t}: {words.ERROR} {words.error_in_words(s)}'
                + (f'; fails in {bad}' if bad else ''))
        say('5. Diagnose, add what is missing, and look again, until nothing is missing')
        known = len(study.history)
        side_by_side.diagnose(study, until_complete=True, progress=progress)
        steps = study.history[known:]
        for s in steps:
            before = next(r for r in study.history if r.target == s.target)
            say(
                f'   {s.target}: {words.change(s)}: error {before.held_out:.3f} -> '
                f'{s.held_out:.3f} (chance: up to {words.CHANCE * s.held_out_std:.3f}), '
                f'{s.verdict}'
            )
        for t, d in study.diagnosis.items():
            say(f'   {t}: {d.verdict}')
        study.source['path'] = str(out / 'bag')
        for name, data in noise.outputs(study, out / 'study').items():
            files.atomic_write(new / 'study' / name, data)
            if name == 'report.html':
                files.atomic_write(new / name, data)
    truth = {a: sorted(set(v) - {'bias'}) for a, v in SPEC['targets'].items()}
    found = {t: sorted(s.model.labels) for t, s in study.states.items()}
    say(
        '6. What was hidden was found.'
        if found == truth
        else f'6. Found {found}, where there was {truth}.'
    )
    say(
        'Look at, in this order:\n'
        f'   {out / "report.html"}: what failed, which effect it was, and how the error fell\n'
        f'   {out / "study" / "imu.yaml"}: the numbers for Kalibr, and what they rest on\n'
        f'   {out / "study" / "allan.png"}: the curve of every axis beside its model'
    )
    return {
        'report': str(out / 'report.html'),
        'truth': truth,
        'found': found,
        'nodes_equal_command_line': equal,
        'history': [store.step_to_dict(s) for s in study.history],
    }


def _nodes(folder: Path, study, say) -> bool | None:
    """
    Play the bag through the real nodes.

    Return whether they computed the same, None where they could not run.

    """
    if importlib.util.find_spec('rclpy') is None:
        say(
            '3. The ROS nodes are left out: rclpy cannot be imported here (pip install ".[ros]", '
            'or source ROS)'
        )
        return None
    say(
        '3. The same through the ROS nodes, as processes: bag_reader plays the bag to the analyser'
    )
    started: list[subprocess.Popen] = []
    env = dict(
        os.environ,
        ROS_DOMAIN_ID=str(random.SystemRandom().randint(2, 100)),
        ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
    )
    try:
        started.append(_start('analyser', folder, env, 'input:=buffer',
                              f'output_dir:={folder / "analyser"}'))
        started.append(_start('bag_reader', folder, env, f'bag:={folder / "bag"}',
                              'publish:=buffer', 'wait_for_subscribers:=60.0'))
        equal = _same_as(study, _ask(env, 'analyse', say))
        _ask(env, 'save', say)
    except ImuNoiseError as error:
        say(f'   {error}')
        equal = None
    finally:
        for process in started:
            process.send_signal(signal.SIGINT)
        for process in started:
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    if equal is not None:
        say(
            '   the analyser computed '
            + (
                'the same coefficients as the command line'
                if equal
                else 'something else: see analyser.log'
            )
        )
    return equal


def _start(node: str, folder: Path, env: dict, *parameters: str) -> subprocess.Popen:
    """Start a node; what it says goes into a log of its name."""
    command = [sys.executable, '-m', f'imu_noise_tools.nodes.{node}', '--ros-args',
               '-r', '__ns:=/demo', *(word for p in parameters for word in ('-p', p))]
    with open(folder / f'{node}.log', 'w') as text:
        return subprocess.Popen(
            command, env=env, stdout=text, stderr=subprocess.STDOUT, start_new_session=True
        )


def _ask(env, service, say):
    """Call a service of the analyser until it has the whole bag."""
    end = time.monotonic() + PATIENCE
    wanted = int(SPEC['rate_hz'] * SPEC['duration_s'])
    while True:
        done = subprocess.run(
            [
                sys.executable,
                '-m',
                'imu_noise_tools.nodes.trigger',
                f'/demo/analyser/{service}',
                '--patience',
                '90',
            ],
            env=env,
            capture_output=True,
            text=True,
        )
        if done.returncode == 0:
            answer = files.plain_yaml(done.stdout)
            samples = answer.get('source', {}).get('samples', wanted)
            if samples == wanted:
                say(f'   {service}: done ({wanted} samples)')
                return answer
        if time.monotonic() > end:
            raise ImuNoiseError(
                f'the analyser did not {service}: {(done.stderr or done.stdout).strip()[:200]}',
                'see analyser.log',
            )
        time.sleep(0.5)


def _same_as(study, answer) -> bool:
    """Tell whether every coefficient of an answer equals the study's."""
    for target, state in study.states.items():
        for label, found in state.fit.estimates.items():
            for name, e in found.items():
                other = answer['targets'][target]['effects'][label][name]['value']
                if (
                    (e.value is None) != (other is None)
                    or e.value is not None
                    and abs(other / e.value - 1) > 1e-9
                ):
                    return False
    return True
