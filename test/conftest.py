"""What all tests share."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope='session')
def shared_data() -> Path:
    """Return the folder of real recordings (``bags/``, ``records/``), or skip where it is absent."""
    folder = Path(os.environ.get('IMU_NOISE_DATA') or ROOT.parent / 'shared' / 'data')
    if not (folder / 'bags').is_dir():
        pytest.skip(f'no real recordings at {folder} (set IMU_NOISE_DATA)')
    return folder


@pytest.fixture(scope='session')
def root() -> Path:
    """Return the root of the source tree."""
    return ROOT
