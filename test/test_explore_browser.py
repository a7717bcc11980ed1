# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in a real browser: the whole story by clicks, and nothing asked for from elsewhere."""

from __future__ import annotations

import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import urllib.error
from urllib.parse import urlparse
import urllib.request

import explore_study
import pytest

from imu_noise_tools import store
from imu_noise_tools.tasks.demo import SPEC
from imu_noise_tools.tasks.simulate import simulate

pytestmark = pytest.mark.thorough
CHROMIUM = next((found for name in ('chromium', 'chromium-browser', 'google-chrome')
                 if (found := shutil.which(name))), None)
PATIENCE = 120_000      # ms; a busy machine fits slowly
STORY = {**SPEC, 'duration_s': 1200.0}       # a third of it shows the same
DARK = 0.15             # luminance


class Served:
    """A server of its own in a process of its own."""

    def __init__(self, *words):
        self.process = subprocess.Popen(
            [sys.executable, '-m', 'imu_noise_tools.cli.main', 'explore',
             *map(str, words), '--no-browser'], stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
            env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'})
        line = self.process.stdout.readline()
        self.url = re.search(r'http://127\.0\.0\.1:\d+/[\w-]+/', line)[0]
        self.port = urlparse(self.url).port

    def end(self, number=signal.SIGTERM) -> int:
        """End it as a person or a system does; return its status."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(20)
        finally:
            self.process.kill()
            for stream in (self.process.stdout, self.process.stderr):
                stream.close()


class Window:
    """One window of the browser, which keeps what it asked for."""

    def __init__(self, browser, url, width=1440, height=1000, scheme='light', query='',
                 wait='.rung'):
        self.asked: list[str] = []
        self.wrong: list[str] = []
        self._context = browser.new_context(viewport={'width': width, 'height': height},
                                            color_scheme=scheme, accept_downloads=True)
        self.page = self._context.new_page()
        self.page.set_default_timeout(PATIENCE)
        self.page.on('request', lambda r: self.asked.append(r.url))
        self.page.on('websocket', lambda w: self.asked.append(w.url))
        self.page.on('pageerror', lambda e: self.wrong.append(str(e)))
        self.page.on('console', lambda m: self.wrong.append(m.text) if m.type == 'error' else None)
        self.page.goto(url + query)
        self.page.wait_for_selector(wait, state='attached')
        self.idle()

    def idle(self):
        """Wait until nothing is under way."""
        self.page.wait_for_selector('.status button', state='hidden')

    def click(self, name, then, gone=False):
        """Click a button by what is written on it; wait for what must then be there, or gone."""
        self.page.get_by_role('button', name=name, exact=True).first.click()
        found = self.page.locator(then).first
        found.wait_for(state='hidden' if gone else 'visible')
        self.idle()

    def text(self, where) -> str:
        return self.page.locator(where).inner_text()

    def rungs(self) -> list[tuple[str, float, float]]:
        """Return the ladder as it is seen: what, number, width of the bar in pixels."""
        # by element: where the page is drawn anew, what is written has no lines yet
        return [(what, float(number.replace('−', '-')), width)
                for what, number, width in self.page.locator('.rung').evaluate_all(
                    'found => found.map(r => { const top = r.querySelector(".top"); return ['
                    'top.firstElementChild.textContent, top.lastElementChild.textContent, '
                    'r.querySelector("i").getBoundingClientRect().width] })')]

    def brush(self, low, high):
        """Draw across the plot, from one x (data) to another."""
        box = self.page.locator('.plot .xy .drag').first.bounding_box() or \
            self.page.locator('.plot .nsewdrag').first.bounding_box()
        to_pixel = ('x => { const a = document.querySelector(".plot")._fullLayout.xaxis; '
                    'return a.d2p(x) }')
        a, b = (box['x'] + self.page.evaluate(to_pixel, x) for x in (low, high))
        y = box['y'] + 0.4 * box['height']
        self.page.mouse.move(a, y)
        self.page.mouse.down()
        self.page.mouse.move(0.5 * (a + b), y, steps=4)
        self.page.mouse.move(b, y, steps=4)
        self.page.mouse.up()
        self.page.locator('button:has-text("What is this?")').wait_for()

    def shot(self, name):
        """Keep a picture where IMU_NOISE_SHOTS names a folder, for people."""
        if os.environ.get('IMU_NOISE_SHOTS'):
            self.page.screenshot(path=str(Path(os.environ['IMU_NOISE_SHOTS']) / f'{name}.png'),
                                 full_page=True)

    def close(self):
        self._context.close()


@pytest.fixture(scope='module')
def browser():
    """Return a headless Chromium, or skip."""
    pytest.importorskip('nicegui', reason='pip install "imu_noise_tools[explore]"')
    api = pytest.importorskip('playwright.sync_api', reason='pip install playwright')
    if CHROMIUM is None:
        pytest.skip('no chromium (apt install chromium)')
    with api.sync_playwright() as p:
        found = p.chromium.launch(executable_path=CHROMIUM, args=['--no-sandbox'])
        yield found
        found.close()


@pytest.fixture(scope='module')
def made(tmp_path_factory):
    return explore_study.study(tmp_path_factory.mktemp('browser') / 'made' / 'a.study')


def over(folder):
    """Yield a server over a study; ``folder`` is where that is."""
    s = Served(folder)
    s.folder = folder
    yield s
    s.end()


@pytest.fixture
def served(browser, made, tmp_path):
    """Return a server over a copy of the study, which a test may change."""
    yield from over(shutil.copytree(made, tmp_path / 'a.study'))


@pytest.fixture(scope='module')
def looked_at(browser, made, tmp_path_factory):
    """Return a server whose study no test changes."""
    yield from over(shutil.copytree(made, tmp_path_factory.mktemp('looked_at') / 'a.study'))


@pytest.fixture
def demo(browser, tmp_path):
    """Return a server over what ``imu_noise demo`` records, which it has to analyse first."""
    simulate(STORY, tmp_path / 'bag')
    s = Served(tmp_path / 'bag')
    s.folder = tmp_path / 'bag.study'
    yield s
    s.end()


def history_of(folder, target='gyro_x') -> list:
    """Return what the command says was added to and removed from an axis."""
    done = subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', 'history',
                           str(folder), '--json'], capture_output=True, text=True, check=True)
    return [(s['added'], s.get('removed')) for s in json.loads(done.stdout)['history']
            if s['target'] == target]


def test_the_story_of_the_demo_by_clicks(browser, demo):
    """What ``imu_noise demo`` prints, seen: found, added, and the error falls."""
    w = Window(browser, demo.url)
    assert [r[0] for r in w.rungs()] == ['white + flicker + random_walk']
    w.shot('1_opened')
    w.click('Diagnose all', 'text=missing: sinusoid')
    assert 'coherent' in w.text('.verdict')
    w.shot('2_diagnosed')
    for target, effect in (('gyro_x', 'sinusoid'), ('gyro_y', 'gauss_markov')):
        w.click(target, f'text=missing: {effect}')
        w.click(f'Add {effect}', '.rung >> nth=1')
        (_, before, long), (what, after, short) = w.rungs()
        assert what == f'+ {effect}' and after < 0.6 * before and short < 0.8 * long
        assert 'complete' in w.text('.verdict')
        w.shot(f'3_added_{effect}')
        assert history_of(demo.folder, target) == [(None, None), (effect, None)]
    for target in ('gyro_z', 'accel_x', 'accel_y', 'accel_z'):
        w.click(target, f'h2:has-text("Ladder of {target}")')
        assert 'complete' in w.text('.verdict') and len(w.rungs()) == 1
    on_disk = store.load(demo.folder)
    assert {t: set(s.model.labels) for t, s in on_disk.states.items()} == {
        t: set(v) - {'bias'} for t, v in SPEC['targets'].items()}
    assert f'{on_disk.states["gyro_y"].error.excess:.2g}' == f'{after:.2g}'
    assert not w.wrong
    w.close()


def test_a_step_is_taken_back_and_a_reload_keeps_the_state(browser, served):
    w = Window(browser, served.url)
    w.click('Diagnose', 'text=missing: sinusoid')
    w.click('Add sinusoid', '.rung >> nth=1')
    before, after = (r[1] for r in w.rungs())
    w.click('Remove sinusoid', '.rung >> nth=2')
    assert [r[0] for r in w.rungs()][-1] == '- sinusoid' and w.rungs()[-1][1] == before
    w.click('Undo', '.rung >> nth=3')
    assert [r[0] for r in w.rungs()] == [
        'white + flicker + random_walk', '+ sinusoid', '- sinusoid', '+ sinusoid']
    assert w.rungs()[-1][1] == after
    w.page.reload()                         # the state is the study's
    w.page.wait_for_selector('.rung >> nth=3')
    assert len(w.rungs()) == 4 and w.rungs()[-1][1] == after
    assert history_of(served.folder) == [
        (None, None), ('sinusoid', None), (None, 'sinusoid'), ('sinusoid', None)]
    assert {urlparse(u).hostname for u in w.asked if not u.startswith(('data:', 'blob:'))} == {
        '127.0.0.1'}
    assert not w.wrong
    w.close()
    assert served.end() == 0


def test_a_stretch_is_asked_about_and_an_effect_put_in_by_hand(browser, looked_at):
    w = Window(browser, looked_at.url)
    w.click('Power over frequency', 'button[aria-pressed=true]:has-text("Power")')
    w.page.wait_for_function('document.querySelector(".plot")._fullLayout.xaxis.title.text == '
                             '"frequency, Hz"')
    w.brush(0.8 * explore_study.LINE, 1.25 * explore_study.LINE)
    w.click('What is this?', 'text=nearest comes')
    said = w.text('.curve')
    assert 'Nearest comes sinusoid' in said and '100 % of what fails there' in said
    assert 'What the model has there: white' in said
    w.shot('4_asked')
    w.click('Clear', 'text=nearest comes', gone=True)

    w.page.get_by_text('Put an effect in by hand').click()
    w.page.get_by_role('combobox', name='effect', exact=True).click()
    w.page.get_by_role('option', name='gauss_markov').click()
    w.page.wait_for_selector('text=not fitted')
    first = w.text('.hand-outcome')
    track = w.page.get_by_role('slider', name='standard deviation').bounding_box()
    w.page.mouse.click(track['x'] + 0.8 * track['width'], track['y'] + 0.5 * track['height'])
    w.page.wait_for_function(
        'first => document.querySelector(".hand-outcome").innerText != first', arg=first)
    w.shot('5_by_hand')
    w.click('Take away', '.hand-outcome', gone=True)
    assert len(w.rungs()) == 1              # nothing was fitted, nothing is in the ladder
    assert not w.wrong
    w.close()


def test_two_windows_and_the_command_line_see_each_other(browser, served):
    one, two = Window(browser, served.url), Window(browser, served.url, query='?axis=accel_z')
    assert 'accel_z' in two.text('.ladder h2 >> nth=0')
    one.click('Diagnose', 'text=missing: sinusoid')
    two.click('gyro_x', 'text=missing: sinusoid')
    subprocess.run([sys.executable, '-m', 'imu_noise_tools.cli.main', 'add', str(served.folder),
                    'ramp', '--axis', 'accel_z'], check=True, capture_output=True)
    one.page.wait_for_selector('text=was changed elsewhere')
    one.click('accel_z', '.rung:has-text("+ ramp")')
    one.close()
    two.close()


def test_export_shows_what_the_command_writes(browser, looked_at):
    w = Window(browser, looked_at.url)
    w.page.get_by_text('Export', exact=True).click()
    w.idle()
    w.click('Show', '.verdict pre')
    shown = w.page.locator('.verdict pre').inner_text()
    done = subprocess.run(
        [sys.executable, '-m', 'imu_noise_tools.cli.main', 'export', str(looked_at.folder),
         '--format', w.page.get_by_role('combobox', name='format').input_value(), '-o', '-'],
        check=True, capture_output=True, text=True)
    assert shown.strip() == done.stdout.strip()
    w.close()


def refused(url) -> bool:
    try:
        urllib.request.urlopen(url, timeout=10)
    except urllib.error.HTTPError as error:
        return error.code == 403
    return False


def test_without_the_token_everything_is_refused(browser, looked_at):
    root = f'http://127.0.0.1:{looked_at.port}/'
    token = looked_at.url.removeprefix(root).strip('/')
    for path in ('', 'x', 'x/', token[:-1] + '/', f'{token}x/', f'x/{token}/',
                 '_nicegui_ws/socket.io/?EIO=4&transport=polling',
                 '_nicegui/3/static/nicegui.js', '../', f'%2e/{token}/', '?token=' + token):
        assert refused(root + path), path
    w = Window(browser, looked_at.url)
    opened = '''url => new Promise(done => { const s = new WebSocket(url);
        s.onopen = () => done("open"); s.onerror = () => done("refused") })'''
    below = '_nicegui_ws/socket.io/?EIO=4&transport=websocket'
    port = looked_at.port
    assert w.page.evaluate(opened, f'ws://127.0.0.1:{port}/{below}') == 'refused'
    assert w.page.evaluate(opened, f'ws://127.0.0.1:{port}/{"a" * len(token)}/{below}') == \
        'refused'
    assert w.page.evaluate(opened, f'ws://127.0.0.1:{port}/{token}/{below}') == 'open'
    w.close()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_it_ends_well_while_it_computes(made, tmp_path, number):
    pytest.importorskip('nicegui')
    folder = shutil.copytree(made, tmp_path / 'a.study')
    s = Served(folder)
    with urllib.request.urlopen(s.url, timeout=60) as answer:
        assert answer.status == 200
    assert s.end(number) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ['a.study']
    assert not [p for p in folder.iterdir() if p.name.startswith('.')]


def luminance(page, where) -> float:
    colour = page.locator(where).first.evaluate('e => getComputedStyle(e).backgroundColor')
    return sum(w * int(v) / 255 for w, v in zip((.21, .72, .07), re.findall(r'\d+', colour)))


@pytest.mark.parametrize(('name', 'width', 'scheme'), [
    ('desktop', 1440, 'light'), ('phone', 390, 'light'), ('dark', 1440, 'dark'),
    ('phone_dark', 390, 'dark')])
def test_it_can_be_read_on_every_screen(browser, looked_at, name, width, scheme):
    w = Window(browser, looked_at.url, width=width, height=844, scheme=scheme)
    # nothing sticks out at the side, once the plot has taken its size
    w.page.wait_for_function('document.documentElement.scrollWidth <= innerWidth')
    box = w.page.locator('.plot').bounding_box()
    assert box['x'] >= 0 and box['x'] + box['width'] <= width and box['width'] > 250
    assert (luminance(w.page, 'body') < DARK) == (scheme == 'dark')
    cut = w.page.locator('button:visible').evaluate_all(
        'all => all.filter(b => b.scrollWidth > b.clientWidth + 1).map(b => b.innerText)')
    assert cut == []
    w.shot(name)
    w.close()
