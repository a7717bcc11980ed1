# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How soon the page of ``imu_noise explore`` answers a click that computes nothing.

``python bench/explore.py`` simulates six axes of three hours at 200 Hz, analyses them, opens the
page in a headless Chromium, and clicks through axes and views; then again while a diagnosis of all
axes is computed. A time is that from the click until the ladder and the plot are drawn anew.

"""

from __future__ import annotations

import argparse
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile

import numpy as np
from playwright.sync_api import sync_playwright

from imu_noise_tools.tasks import noise
from imu_noise_tools.tasks.demo import SPEC
from imu_noise_tools.tasks.simulate import simulate

# resolves with the milliseconds until the plot shows what was asked for
CLICK = """([name, wanted]) => new Promise(done => {
  const button = [...document.querySelectorAll('button')].find(b => b.innerText.trim() == name);
  const plot = document.querySelector('.plot');
  let drawn = false, t0 = performance.now();
  plot.once('plotly_afterplot', () => { drawn = true; });
  const look = () => {
    const pressed = [...document.querySelectorAll('button[aria-pressed=true]')];
    const there = pressed.some(b => b.innerText.trim() == name);
    if (there && drawn) done(performance.now() - t0); else requestAnimationFrame(look);
  };
  button.click();
  look();
})"""


def clicks(page, names, rounds):
    """Return the times of clicks on each of these, ms."""
    out = []
    for _ in range(rounds):
        for name in [*names[1:], names[0]]:
            out.append(page.evaluate(CLICK, [name, name]))
            page.wait_for_timeout(150)
    return np.array(out)


def said(what, times):
    """Print the median and the worst of some times."""
    print(f'{what:45s} {len(times):3d} clicks, median {np.median(times):4.0f} ms, '
          f'95 % {np.quantile(times, 0.95):4.0f} ms, worst {times.max():4.0f} ms', flush=True)


def main():
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--study', help='one that is there already')
    parser.add_argument('--rounds', type=int, default=4)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        study = Path(args.study or Path(folder) / 'study')
        if not args.study:
            simulate({**SPEC, 'duration_s': 10800.0, 'rate_hz': 200.0}, Path(folder) / 'bag')
            noise.analyse(Path(folder) / 'bag', study)
        server = subprocess.Popen(
            [sys.executable, '-m', 'imu_noise_tools.cli.main', 'explore', study, '--no-browser'],
            stdout=subprocess.PIPE, text=True)
        try:
            measure(re.search(r'http\S+', server.stdout.readline())[0], args.rounds)
        finally:
            server.terminate()
            server.wait()


def measure(url, rounds):
    """Click through axes and views, at rest and beside a diagnosis."""
    with sync_playwright() as p:
        path = shutil.which('chromium') or shutil.which('chromium-browser')
        browser = p.chromium.launch(executable_path=path, args=['--no-sandbox'])
        page = browser.new_page(viewport={'width': 1440, 'height': 1000})
        page.goto(url)
        page.wait_for_selector('.rung', timeout=120_000)
        page.wait_for_selector('.status button', state='hidden', timeout=120_000)
        page.wait_for_timeout(1000)
        axes = page.locator('.bar button').all_inner_texts()
        views = page.locator('.tabs button').all_inner_texts()
        said('another axis', clicks(page, axes, rounds))
        said('another view', clicks(page, views, rounds))
        page.get_by_role('button', name='Diagnose all').click()
        page.wait_for_selector('.status button')
        said('another view, while all axes are diagnosed', clicks(page, views, rounds))
        computing = page.locator('.status button').is_visible()
        print('it was being computed to the end of that' if computing else 'it ended before')
        browser.close()


if __name__ == '__main__':
    main()
