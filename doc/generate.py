# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the code itself knows, as pages of the manual: nothing of it is written by hand.

``python doc/generate.py`` writes doc/generated/: the effects of each domain from the registry, the
commands from their parsers, the nodes' parameters from their declarations, and the plots of the
theory. It needs no ROS: the nodes are read with stand-ins for rclpy and the messages.

"""

from __future__ import annotations

import argparse
import importlib
from itertools import groupby
from pathlib import Path
import re
import sys
from unittest.mock import patch

import figures

import imu_noise_tools
from imu_noise_tools.cli.main import parser
from imu_noise_tools.core import units
from imu_noise_tools.loop.domains import DOMAINS
from imu_noise_tools.loop.effect import Parameter, registry

HERE = Path(__file__).resolve().parent
OUT = HERE / 'generated'
NODES = ('bag_reader', 'analyser', 'calibration', 'filter')
BY_HAND = 'This page is written by doc/generate.py.'
ABOUT = {
    'noise': 'Effects in a record at rest. `analyse`, `add` and `simulate` take them.',
    'calibration': 'Effects in a calibration. `add` takes them, after `calibrate`.',
    'filter': 'Effects of the filter. `filter --motion` and `--noise` take them, later `add`.',
}


def cell(text: str) -> str:
    """Return a text as it can stand in a table."""
    return ' '.join(str(text).split()).replace('|', '\\|')


def plain(text: str) -> str:
    """Return a text in which Markdown finds nothing to interpret."""
    return re.sub(r'([*_<>\[\]`$~|\\])', r'\\\1', ' '.join(str(text).split()))


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> list[str]:
    """Return the lines of a table."""
    lines = [head, ('---',) * len(head), *rows]
    return [f'| {" | ".join(line)} |' for line in lines]


def unit(parameter: Parameter, domain: str) -> str:
    """Return the unit of a parameter, for both sensors where they differ."""
    if parameter.choices:
        return 'one of ' + ', '.join(f'`{c}`' for c in parameter.choices)
    both = dict.fromkeys(units.si(parameter.unit, s) for s in ('gyro', 'accel'))
    return ' or '.join(f'`{u}`' for u in (list(both)[:1] if domain == 'filter' else both))


def parameters(cls: type, domain: str) -> list[str]:
    """Return the table of an effect's parameters, numbered ones in one row."""
    rows = []
    numbered = groupby(cls.parameters, lambda p: (re.sub(r'_\d+$', '', p.name), p.unit))
    for _, group in numbered:
        some = list(group)
        name = f'`{some[0].name}`' + (f' … `{some[-1].name}`' if len(some) > 1 else '')
        rows.append((name, unit(some[0], domain), plain(some[0].title)))
    if not rows:
        return []
    if any(title for _, _, title in rows):
        return ['', *table(('parameter', 'unit', 'meaning'), rows)]
    return ['', *table(('parameter', 'unit'), [row[:2] for row in rows])]


def effects(domain: str) -> list[str]:
    """Return the page of a domain's effects."""
    lines = [f'# Effects: {domain}', '', ABOUT[domain],
             f'{BY_HAND} `imu_noise effects` prints the same.', '',
             *table(('effect', 'what it is', 'seen as'), [
                 (f'[{name}](#{domain}-{name})', *(cell(plain(x)) for x in (c.title, c.signature)))
                 for name, c in registry(domain).items()]), '']
    for name, cls in registry(domain).items():
        lines += [f'({domain}-{name})=', f'## {name}', '', f'{plain(cls.title).capitalize()}.', '']
        if cls.equation:
            lines += ['```text', cls.equation, '```']
        lines += parameters(cls, domain)
        for head, text in (('Seen as', cls.signature), ('Cause and check', cls.hint),
                           ('Needs', getattr(cls, 'needs', '') if domain == 'calibration' else ''),
                           ('Source', cls.reference)):
            if text and text != '-':
                lines += ['', f'{head}: {plain(text)}.'.replace('..', '.')]
        lines.append('')
    return lines


def commands() -> list[str]:
    """Return the page of all commands and their options."""
    top = parser()
    sub = next(a for a in top._actions if isinstance(a, argparse._SubParsersAction))
    lines = ['# Commands', '', f'{plain(top.description)} {BY_HAND} `imu_noise COMMAND --help` '
             'prints the same.', '',
             'Exit status: 0 done, 1 bad input (one line says what, where and the remedy), '
             '2 wrong usage, 130 interrupted.', '']
    helps = {a.dest: a.help for a in sub._choices_actions}
    lines += [*table(('command', 'what it does'), [
        (f'[imu_noise {name}](command-{name})', cell(plain(said or '')))
        for name, said in helps.items()]), '']
    shown: set[int] = set()
    for name, command in sub.choices.items():
        if id(command) in shown:        # another spelling of one that was shown
            continue
        shown.add(id(command))
        if name not in helps:
            continue
        formatter = argparse.HelpFormatter(command.prog, width=88)
        usage = command.format_usage().replace('usage: ', '')
        about = command.description or helps[name] or ''
        lines += [f'(command-{name})=', f'## imu_noise {name}', '',
                  f'{plain(about[:1].upper() + about[1:])}', '', '```text',
                  *usage.rstrip().splitlines(), '```', '']
        rows = []
        for action in command._actions:
            if isinstance(action, argparse._HelpAction) or action.help is argparse.SUPPRESS:
                continue
            what = formatter._format_action_invocation(action)
            said = formatter._expand_help(action) if action.help else ''
            rows.append((f'`{cell(what)}`', cell(plain(said))))
        lines += [*table(('argument', 'what it does'), rows), ''] if rows else []
    return lines


ROS = ('rclpy', 'rcl_interfaces', 'diagnostic_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs',
       'rosgraph_msgs', 'builtin_interfaces')


class Declared(Exception):
    """The parameters of a node, thrown out of its constructor."""


def settings(node: str) -> list:
    """Return the parameters that a node declares, in its order."""
    from imu_noise_tools.nodes import params

    def throw(self, node, *declared):
        raise Declared(declared)

    module = importlib.import_module(f'imu_noise_tools.nodes.{node}')
    cls = getattr(module, ''.join(word.capitalize() for word in node.split('_')))
    try:
        with patch.object(params.Settings, '__init__', throw):
            cls()
    except Declared as declared:
        return list(declared.args[0])
    raise RuntimeError(f'{node} declares no parameters')


def written(value) -> str:
    """Return a default as YAML would have it."""
    if isinstance(value, float) and value != value:
        return '.nan'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return '[' + ', '.join(str(v) for v in value) + ']'
    return str(value) if value != '' else "''"


def nodes() -> list[str]:
    """Return the page of the nodes' parameters."""
    lines = ['# Parameters of the nodes', '', f'{BY_HAND} `ros2 param describe` shows the same. '
             '*Fixed* ones are read at the start; the others can be set while the node runs. A '
             'value that is not allowed is refused, and the answer says why.', '']
    for node in NODES:
        rows = []
        for s in settings(node):
            limits = []
            if s.choices:
                limits.append('one of ' + ', '.join(f'`{c}`' for c in s.choices))
            elif s.high < float('inf') and not s.optional:
                limits.append(f'{s.low:g} to {s.high:g}')
            limits += ['fixed'] * s.fixed
            default = written(s.default)
            rows.append((f'`{s.name}`', f'`{default}`', f'`{s.unit}`' if s.unit else '',
                         cell(plain(s.text)), '; '.join(limits)))
        lines += [f'({node}-parameters)=', f'## {node}', '',
                  *table(('parameter', 'default', 'unit', 'meaning', 'allowed'), rows), '']
    return lines


def results() -> list[str]:
    """Return bench/RESULTS.md, which stands outside of doc/."""
    path = Path(imu_noise_tools.__file__).parents[1] / 'bench' / 'RESULTS.md'
    if not path.exists():
        return ['# Results', '', 'They are in bench/RESULTS.md of the source tree.']
    return path.read_text(encoding='utf-8').splitlines()


def write(name: str, lines: list[str]) -> None:
    """Write a page where it has changed: Sphinx reads only what is new."""
    path, text = OUT / name, '\n'.join(lines).rstrip() + '\n'
    if not path.exists() or path.read_text(encoding='utf-8') != text:
        path.write_text(text, encoding='utf-8')


def main() -> int:
    """Write all of it."""
    OUT.mkdir(exist_ok=True)
    figures.main()
    for domain in DOMAINS:
        write(f'effects_{domain}.md', effects(domain))
    write('commands.md', commands())
    write('results.md', results())
    from sphinx.ext.autodoc.mock import mock

    with mock(ROS):
        write('nodes.md', nodes())
    return 0


if __name__ == '__main__':
    sys.exit(main())
