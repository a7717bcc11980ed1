# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page over a running analyser: its topics are followed, its services are buttons."""

from __future__ import annotations

import explore_study
import numpy as np
import pytest
from test_explore_browser import browser, Served, Window

from imu_noise_tools.bag.writing import write_bag
from imu_noise_tools.cli.main import main
from nodes_support import wait_for

pytestmark = pytest.mark.thorough
__all__ = ['browser']


@pytest.fixture
def live():
    """Return the module: what it imports takes a second, which is not to be paid to collect."""
    return pytest.importorskip('imu_noise_tools.explore.live',
                               reason='pip install "imu_noise_tools[explore]"')


def test_the_curve_is_drawn_as_it_came(live):
    tau = np.geomspace(0.01, 10, 20)
    came = {'tau': tau, 'adev': 2e-5 / np.sqrt(tau), 'lo': 1.9e-5 / np.sqrt(tau),
            'hi': 2.1e-5 / np.sqrt(tau), 'model': 2e-5 / np.sqrt(tau)}
    same = live.panel('gyro_x', came)
    assert [c.name for c in same.curves] == ['measured', 'model']
    np.testing.assert_allclose(same.pull, 0, atol=1e-9)
    more = live.panel('gyro_x', {**came, 'adev': came['hi']})
    assert np.all((more.pull > 1.5) & (more.pull < 2.5))
    alone = live.panel('gyro_x', {**came, 'model': np.full(20, np.nan)})
    assert len(alone.curves) == 1 and not alone.pull.any()


def test_coefficients_are_read_from_the_topic(live):
    came = {'N [rad/s/sqrt(Hz)]': '0.000141', 'N_std [rad/s/sqrt(Hz)]': '4e-7',
            'N_lo [rad/s/sqrt(Hz)]': '0.00014', 'N_hi [rad/s/sqrt(Hz)]': '0.000142',
            'B_std [rad/s]': '1e-12', 'B_upper95 [rad/s]': '2.9e-05', 'held_out': '0.07'}
    assert live.coefficients(came) == [
        'N 0.000141 (0.000140 ... 0.000142) rad/s/√Hz',
        'B not observable, below 2.90e-05 rad/s']


def test_a_bag_played_to_the_analyser_is_seen_and_driven(ros, browser, tmp_path):
    write_bag(tmp_path / 'bag', explore_study.record())
    served = Served('--topic', '/explored/analyser')
    try:
        analyser = ros.start('analyser', '/explored', input='buffer', update_period=0.5,
                             output_dir=str(tmp_path / 'live.study'))
        ros.start('bag_reader', '/explored', bag=str(tmp_path / 'bag'), publish='buffer')
        w = Window(browser, served.url, wait='.plot .scatterlayer .trace')
        w.page.wait_for_selector('button:has-text("gyro_x")')
        w.page.wait_for_selector('text=white')
        w.click('gyro_x', 'button[aria-pressed=true]:has-text("gyro_x")')
        w.page.get_by_role('button', name='Diagnose').click()
        w.page.wait_for_selector('text=missing: sinusoid')
        w.page.get_by_role('button', name='Add the best').click()
        w.page.locator('.rung').nth(1).wait_for()
        (_, before, _), (what, after, _) = w.rungs()
        assert what == '+ sinusoid' and after < 0.6 * before
        w.shot('live')
        w.page.get_by_role('button', name='Save').click()
        assert wait_for(lambda: (tmp_path / 'live.study' / 'study.yaml').is_file())
        assert not w.wrong and analyser.running
        w.close()
        assert served.end() == 0
    finally:
        served.process.kill()


def test_without_ros_the_extra_is_named(capsys, monkeypatch):
    import sys
    monkeypatch.setitem(sys.modules, 'imu_noise_tools.nodes.follow', None)
    assert main(['explore', '--topic', '/analyser', '--no-browser']) == 1
    err = capsys.readouterr().err
    assert err.count('\n') == 1 and 'imu_noise_tools[ros]' in err
    assert main(['explore', '--no-browser']) == 2
