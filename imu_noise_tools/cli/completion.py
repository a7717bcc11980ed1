# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``completion``: what a shell offers where a name is typed; nothing here is loaded otherwise."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable
import os
from typing import Any

PROGRAM = 'imu_noise'
SHELLS = ('bash', 'zsh', 'fish')
HOW = """put into the shell's own file:
  bash  eval "$(imu_noise completion bash)"           in ~/.bashrc
  zsh   eval "$(imu_noise completion zsh)"            in ~/.zshrc, after compinit
  fish  imu_noise completion fish | source            in ~/.config/fish/config.fish
"""
Names = Callable[[argparse.Namespace], Iterable[str]]


def register(commands: Any) -> None:
    """Add the command."""
    c = commands.add_parser(
        'completion', help='names and options at the tab key, for bash, zsh and fish', epilog=HOW,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    c.add_argument('shell', choices=SHELLS)
    c.set_defaults(func=completion)


def completion(args: argparse.Namespace) -> int:
    """Run ``completion``."""
    from ..core.errors import InputError

    try:
        import argcomplete
    except ImportError:
        raise InputError('argcomplete is not installed', 'pip install argcomplete') from None
    print(argcomplete.shellcode([PROGRAM], shell=args.shell))
    return 0


def answer(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks for completions, and end; return at once where none asks."""
    if '_ARGCOMPLETE' in os.environ:
        import argcomplete

        argcomplete.autocomplete(parser)


def offer(action: argparse.Action, names: Names, several: bool = False) -> None:
    """
    Offer names where an argument is typed.

    ``several``: the argument is a list with commas, of which the last name is completed.

    """
    def completer(prefix: str, parsed_args: argparse.Namespace, **_: Any) -> list[str]:
        before, comma, _last = prefix.rpartition(',') if several else ('', '', '')
        had = before.split(',')
        return [f'{before}{comma}{n}' for n in names(parsed_args) if n not in had]

    setattr(action, 'completer', completer)


def axes(args: argparse.Namespace) -> Iterable[str]:
    """Return the axes; of a study that is named, its own."""
    from ..core.record import AXES

    return _of_study(args, lambda data: data['targets']) or AXES


def effects(*domains: str) -> Names:
    """Return what names the effects of these domains; without one, those of the study's."""
    def names(args: argparse.Namespace) -> Iterable[str]:
        from ..loop.domains import DOMAINS
        from ..loop.effect import registry

        some = domains or _of_study(args, lambda data: (data['domain'],)) or DOMAINS
        return [n for d in some for n in registry(d)]

    return names


def effects_and_domains(args: argparse.Namespace) -> Iterable[str]:
    """Return the domains and the effects of all of them."""
    from ..loop.domains import DOMAINS

    return [*DOMAINS, *effects(*DOMAINS)(args)]


def blocks(kind: str) -> Names:
    """Return what names the effects of a filter that are of a kind: Motion or OutputNoise."""
    def names(args: argparse.Namespace) -> Iterable[str]:
        from ..loop.effect import registry

        found = [n for n, c in registry('filter').items()
                 if kind in (base.__name__ for base in c.__mro__)]
        return ['auto', *found] if kind == 'Motion' else found

    return names


def labels(args: argparse.Namespace) -> Iterable[str]:
    """Return the labels of the effects in a study's models."""
    return dict.fromkeys(_of_study(
        args, lambda data: [x for t in data['targets'].values() for x in t['effects']]))


def formats(args: argparse.Namespace) -> Iterable[str]:
    """Return the formats of exports."""
    from ..export import formats as known

    return known()


def sheets(args: argparse.Namespace) -> Iterable[str]:
    """Return the data sheets that come along, and files."""
    from argcomplete.completers import FilesCompleter

    from ..tasks.sheet import known

    return [*known(), *FilesCompleter(('yaml',))('')]


def _of_study(args: argparse.Namespace, what: Callable[[dict], Iterable[str]]) -> list[str]:
    """Return something of the study that the command line names; nothing where it names none."""
    from .. import store
    from ..core.errors import ImuNoiseError

    try:
        return list(what(store.read(getattr(args, 'dir', None) or '')))
    except ImuNoiseError:
        return []
