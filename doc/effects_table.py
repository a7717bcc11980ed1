# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The table of noise effects in README.md, from the registry.

``python doc/effects_table.py`` prints it, with ``--write`` it is put in the place of the one in
README.md. A test fails when they differ.

"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
import re
import sys

from imu_noise_tools.core import units
from imu_noise_tools.loop.effect import Parameter, registry

README = Path(__file__).parent.parent / 'README.md'
HEAD = ('| effect | parameters [gyroscope \\| accelerometer] | what it is | seen as |',
        '|---|---|---|---|')


def parameter(some: list[Parameter]) -> str:
    """Return a parameter, or the first and last of numbered ones, with its unit or choices."""
    first = some[0]
    name = first.name if len(some) == 1 else f'{first.name} … {some[-1].name}'
    if first.choices:
        return f'{name} ({", ".join(first.choices)})'
    shown = dict.fromkeys(units.si(first.unit, sensor) for sensor in ('gyro', 'accel'))
    return f'{name} [{" | ".join(shown)}]'


def table() -> list[str]:
    """Return the lines of the table."""
    rows = []
    for cls in registry('noise').values():
        numbered = groupby(cls.parameters, lambda p: (re.sub(r'_\d+$', '', p.name), p.unit))
        parameters = ', '.join(parameter(list(some)) for _, some in numbered)
        cells = (f'`{cls.name}`', parameters, cls.title, cls.signature)
        rows.append(f'| {" | ".join(cell.replace("|", chr(92) + "|") for cell in cells)} |')
    return [*HEAD, *rows]


def written() -> tuple[list[str], int, int]:
    """Return the lines of README.md, and where its table begins and ends."""
    lines = README.read_text(encoding='utf-8').splitlines()
    begin = lines.index(HEAD[0])
    end = next(i for i in range(begin, len(lines)) if not lines[i].startswith('|'))
    return lines, begin, end


def main() -> int:
    """Print the table, or write it."""
    if sys.argv[1:] != ['--write']:
        print('\n'.join(table()))
        return 0
    lines, begin, end = written()
    README.write_text('\n'.join([*lines[:begin], *table(), *lines[end:]]) + '\n', encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
