# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The picture of README.md: the error falls as what is missing is found and added.

``python doc/animation.py`` simulates a gyroscope axis that hides a vibration and a Gauss-Markov
process, lets the loop find them, and draws doc/ladder.gif, a frame a rung.

"""

from __future__ import annotations

import io
from pathlib import Path
import sys

from imu_noise_tools.loop.study import Study
from imu_noise_tools.plots.curves import curves, runs
from imu_noise_tools.plots.ladder import ladder
from imu_noise_tools.plots.panels import allan, pulls, shade
from imu_noise_tools.plots.style import new_figure, png
from imu_noise_tools.simulate import simulate
from imu_noise_tools.tasks.noise import analyse_record

HIDDEN = {'white': {'N': 8.7e-5}, 'flicker': {'B': 2.4e-5},
          'gauss_markov': {'sigma': 1.5e-4, 'tc': 4.0},
          'sinusoid': {'amplitude': 2.0e-4, 'frequency': 11.7}}
SPEC = {'rate_hz': 50, 'duration_s': 3600, 'seed': 5, 'targets': {'gyro_x': HIDDEN}}
SECONDS = (2.2, 2.2, 4.0)


def frame(study: Study, rungs: int, title: str) -> bytes:
    """Return one rung as PNG: curve and pulls at the left, the ladder so far at the right."""
    state, all_steps = study.states['gyro_x'], study.history
    figure = new_figure(9, 4.6)
    grid = figure.add_gridspec(2, 2, left=0.08, right=0.98, top=0.88, bottom=0.16,
                               height_ratios=[3, 1], hspace=0.1, wspace=0.2)
    found = curves(state)
    upper = allan(figure.add_subplot(grid[0, 0]), state, found, '')
    upper.tick_params(labelbottom=False)
    lower = pulls(figure.add_subplot(grid[1, 0]), found.tau, found.pull)
    shade(upper, found.tau, runs(found.pull))
    lower.set_ylim(-12, 12)
    lower.set_yticks([-10, 0, 10], ['-10', '0', '10'])
    right = ladder(figure.add_subplot(grid[:, 1]), study, 'gyro_x')
    right.set_title('', loc='left')
    study.history = all_steps[:rungs]       # the same axes with what comes later not yet drawn
    limits = right.get_xlim(), right.get_ylim()
    right.clear()
    ladder(right, study, 'gyro_x').set_title('', loc='left')
    right.set_xlim(limits[0])
    right.set_ylim(limits[1])
    study.history = all_steps
    figure.text(0.08, 0.93, title, fontsize=12, fontweight='bold')
    return png(figure)


def main() -> int:
    """Draw it."""
    from PIL import Image

    study = analyse_record(simulate(SPEC)[0])
    states = [study.states['gyro_x']]
    while study.diagnose()['gyro_x'].found:
        study.add()
        states.append(study.states['gyro_x'])
    print('\n'.join(f'{s.added or "start"}: {s.held_out:.3f}' for s in study.history))
    frames = []
    for k, state in enumerate(states):
        study.states['gyro_x'] = state
        added = study.history[k].added
        said = f'{f"+ {added}" if added else "white + flicker + random walk"}: {state.error.side}'
        frames.append(Image.open(io.BytesIO(frame(study, k + 1, said))).convert(
            'P', palette=Image.Palette.ADAPTIVE, colors=160))
    frames[0].save(Path(__file__).parent / 'ladder.gif', save_all=True, append_images=frames[1:],
                   duration=[int(1000 * s) for s in SECONDS[:len(frames)]], loop=0, optimize=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
