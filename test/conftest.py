# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all tests share."""

from __future__ import annotations

from collections import defaultdict
from contextlib import contextmanager
import os
from pathlib import Path

from params import in_share
import pytest

# Before numpy is imported: on a busy machine the threads of its linear algebra slow small matrices
# down by ten times and more.
os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

try:
    from hypothesis import HealthCheck, settings
except ImportError:
    pass
else:
    # The same examples in every run, and no limit of time: a run that fails says something of the
    # change, not of the machine. (HYPOTHESIS_PROFILE=search draws new ones.)
    settings.register_profile('same', derandomize=True, deadline=None, database=None,
                              suppress_health_check=[HealthCheck.too_slow,
                                                     HealthCheck.data_too_large])
    settings.register_profile('search', deadline=None)
    settings.load_profile(os.environ.get('HYPOTHESIS_PROFILE', 'same'))

ROOT = Path(__file__).resolve().parents[1]
# The files that take longest come first: where files run side by side, the last of them would
# otherwise run alone. One that is missing here costs time and nothing else.
LONG_FILES = ('manual', 'noise_loop', 'noise_rivals', 'fleet', 'clean_install', 'node_analyser',
              'ladder_processes', 'explore_browser', 'noise_forms', 'noise_samples', 'filter_loop',
              'noise_fit', 'python', 'explore', 'noise_lines', 'noise_robust', 'noise_effects',
              'commands_bad_input', 'plots', 'first_use', 'noise_smooth', 'noise_band', 'bag',
              'calibration_turns', 'noise_thermal', 'health', 'side_by_side', 'two_topics',
              'other_types', 'filter_smoother', 'filter_engine', 'own_effects', 'node_filter',
              'store', 'calibration_effects', 'report', 'node_start_stop', 'record',
              'calibration_session')


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Order the files of tests, the long ones first; of the thorough ones take a share."""
    share = os.environ.get('IMU_NOISE_SHARE')
    if share:
        taken = [not item.get_closest_marker('thorough') or in_share(item.nodeid, share)
                 for item in items]
        config.hook.pytest_deselected(items=[i for i, some in zip(items, taken) if not some])
        items[:] = [i for i, some in zip(items, taken) if some]
    rank = {f'test_{name}.py': k for k, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))


@pytest.fixture(scope='session')
def shared_data() -> Path:
    """Return the folder of real recordings (``bags/``, ``records/``), or skip without it."""
    folder = Path(os.environ.get('IMU_NOISE_DATA') or ROOT.parent / 'shared' / 'data')
    if not (folder / 'bags').is_dir():
        pytest.skip(f'no real recordings at {folder} (set IMU_NOISE_DATA)')
    return folder


@pytest.fixture(scope='session')
def root() -> Path:
    """Return the root of the source tree."""
    return ROOT


@pytest.fixture(scope='session')
def ros_session(tmp_path_factory):
    """Return a client on a ROS domain of its own, or skip where there is no ROS."""
    from nodes_support import Ros
    client = Ros(tmp_path_factory.mktemp('nodes'))
    yield client
    client.close()


@contextmanager
def _undrawn():
    from imu_noise_tools import report
    from imu_noise_tools.plots import style
    blank = style.png(style.new_figure(1, 1))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, 'pictures', lambda study: defaultdict(lambda: blank))
        yield


@pytest.fixture(scope='session')
def without_pictures():
    """Return what makes a context in which a fixture writes studies as ``undrawn``."""
    return _undrawn


@pytest.fixture
def undrawn():
    """Leave out the pictures of studies, which are most of the time of a short analysis."""
    with _undrawn():
        yield


@pytest.fixture
def clean_registry():
    """Forget the effects that a test registers."""
    from imu_noise_tools.loop import domains, effect
    for name in domains.DOMAINS:        # what is loaded later would be forgotten with them
        domains.package(name)
    before = {d: dict(known) for d, known in effect._REGISTRY.items()}
    yield
    effect._REGISTRY.clear()
    effect._REGISTRY.update(before)


@pytest.fixture
def ros(ros_session):
    """Return the client; processes that a test started end with the test."""
    yield ros_session
    ros_session.stop_all()


@pytest.fixture(scope='session')
def fresh_seed():
    """Return a new seed each run, printed so that a failure can be drawn again."""
    seed = int.from_bytes(os.urandom(4), 'big')
    print(f'\nfresh seed {seed}')
    return seed
