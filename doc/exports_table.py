# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The page on export formats, exports.md, from the formats themselves.

``python doc/exports_table.py`` prints it, with ``--write`` it is put in its place. A test fails
when they differ.

"""

from __future__ import annotations

from pathlib import Path
import sys
from types import ModuleType

from imu_noise_tools import export

PAGE = Path(__file__).parent / 'exports.md'
HEAD = """# Export formats: what each consumer reads, and where its code says so

Made by `python doc/exports_table.py --write`. f is the sample rate, N and K the square roots of
two-sided densities (continuous time, SI). *Consumer*: the program that reads the file. Each format
is tested with a reader written from the consumer's code that is named here: with the numbers of
the file, the variance that its filter adds per second must be N² and K² (`test/test_exports.py`).
Commits are of the consumer's own repository. [Which values to use](values.md) says what N, B and K
mean to an estimator.

| format | goes in | how | consumer | file:lines at commit | `--calibration` |
|---|---|---|---|---|---|
"""


def row(name: str, module: ModuleType) -> str:
    """Return the line of one format."""
    places = '<br>'.join(f'`{file}`: {where}, at {commit}'
                         for file, where, commit in module.PLACES) or 'the effects themselves'
    held = 'yes' if getattr(module, 'CALIBRATION', False) else ''
    cells = (f'`{name}`', module.HOLDS, module.HOW, module.CONSUMER or 'whoever asks', places,
             held)
    return f'| {" | ".join(cells)} |\n'


def page() -> str:
    """Return the page."""
    return HEAD + ''.join(row(n, export.module(n)) for n in export.formats())


def main() -> int:
    """Print the page, or write it."""
    if sys.argv[1:] == ['--write']:
        PAGE.write_text(page(), encoding='utf-8')
    else:
        print(page(), end='')
    return 0


if __name__ == '__main__':
    sys.exit(main())
