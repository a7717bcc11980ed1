# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Runs what the manual shows, page by page, and holds what it shows beside what comes.

A page is run from top to bottom in a folder of its own. What counts:

```` ```console ````
    Lines that begin with ``$`` are commands, the lines below what they print (both streams).
    Numbers may differ, words may not; ``...`` stands for any lines. Without lines below anything
    may come. ``# exits with 1`` after a command is the status asked for, else it is 0. ``&`` at
    the end leaves it running until the page is at its end.
```` ```python ````
    A program; the blocks of a page share their names, in one process.
```` ```{code-block} yaml ```` with ``:caption: NAME``
    A file of that name.
``% given: NAME``
    Something that a reader brings along (see given.py).
``% picture: PATH = FOLDER : NAME``
    A picture of a study, by its name in the report; PATH is relative to doc/.

``python doc/examples.py [PAGE …]`` runs pages and says what differs; with ``--write`` what is
shown is replaced by what comes, and the pictures are drawn anew. A test runs all of them.

"""

from __future__ import annotations

from dataclasses import dataclass
import difflib
import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

HERE = Path(__file__).resolve().parent
BLOCK = re.compile(
    r'^(?P<fence>`{3,}|:{3,})(?P<kind>[^\n]*)\n(?P<text>.*?)^(?P=fence)[ \t]*$'
    r'|^% (?P<word>given|picture): (?P<said>[^\n]*)$', re.M | re.S)
STATUS = re.compile(r'\s+# exits with (\d+)$')
NUMBER = re.compile(r'(?<![A-Za-z_])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?')
ELSEWHERE = {'python.md'}           # test_python.py runs it, on records of its own
WIDTH = '100'
# Shares names between the blocks of a page: a line of code in, a line of what came of it out.
SERVER = '''
import contextlib, io, json, sys, traceback
names = {"__name__": "__main__"}
for line in sys.stdin:
    out = io.StringIO()
    try:
        with contextlib.redirect_stdout(out):
            exec(compile(json.loads(line), "<manual>", "exec"), names)
        status = 0
    except BaseException:
        out.write(traceback.format_exc())
        status = 1
    print(json.dumps([status, out.getvalue()]), flush=True)
'''


class Stale(Exception):
    """What the manual shows is not what comes."""


@dataclass
class Block:
    """One block of a page: what it is, where its text begins and ends in the page."""

    kind: str
    text: str
    start: int
    end: int
    line: int


def blocks(page: str) -> list[Block]:
    """Return the blocks of a page that say something to run, in order."""
    found = []
    for m in BLOCK.finditer(page):
        group = 'said' if m['word'] else 'text'
        kind = m['word'] or m['kind'].strip()
        found.append(Block(kind, m[group], *m.span(group), page.count('\n', 0, m.start()) + 1))
    return found


def pages() -> list[Path]:
    """Return all pages of the manual that hold something to run."""
    some = sorted(p for p in HERE.rglob('*.md')
                  if 'generated' not in p.parts and p.name not in ELSEWHERE)
    runs = {'console', 'python', 'given', 'picture'}
    return [p for p in some if any(b.kind in runs for b in blocks(p.read_text('utf-8')))]


def commands(text: str) -> list[tuple[str, list[str]]]:
    """Return the commands of a console block with the lines shown below each."""
    found: list[tuple[str, list[str]]] = []
    for line in text.splitlines():
        if line.startswith('$ '):
            found.append((line[2:], []))
        elif line.startswith('> ') and found and not found[-1][1]:
            found[-1] = (f'{found[-1][0]}\n{line[2:]}', [])
        elif found:
            found[-1][1].append(line)
        elif line.strip():
            raise Stale(f'a console block begins with {line!r}: a command begins with "$ "')
    return found


def form(line: str) -> str:
    """Return a line with its numbers and the width of its gaps left open."""
    return re.sub(r'-{2,}', '--', ' '.join(NUMBER.sub('#', line).split()))


def agree(shown: list[str], came: list[str]) -> bool:
    """Tell whether what is shown is what came, ``...`` standing for any lines."""
    want = [form(s) for s in shown if s.strip()]
    have = [form(s) for s in came if s.strip()]
    if not want:
        return True

    def match(i: int, j: int) -> bool:
        while i < len(want):
            if want[i] in ('...', '…'):
                return any(match(i + 1, k) for k in range(j, len(have) + 1))
            if j == len(have) or want[i] != have[j]:
                return False
            i, j = i + 1, j + 1
        return j == len(have)

    return match(0, 0)


class Run:
    """A page's folder, the processes in it, and what is to be replaced in the page."""

    def __init__(self, folder: Path, write: bool):
        self.folder = folder
        self.write = write
        self.replaced: list[tuple[int, int, str]] = []
        self._left: list[subprocess.Popen] = []
        self._python: subprocess.Popen | None = None
        self._env = {
            **os.environ, 'COLUMNS': WIDTH, 'NO_COLOR': '1', 'PYTHONPATH': str(HERE.parent),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'PATH': os.pathsep.join(
                [str(Path(sys.executable).parent), os.environ.get('PATH', ''), str(HERE / 'bin')])}

    def do(self, block: Block) -> None:
        """Run one block; raise Stale where it fails or what comes is not what is shown."""
        if block.kind == 'console':
            self._console(block)
        elif block.kind == 'python':
            status, said = self._ask(block.text)
            if status:
                raise Stale(said)
        elif block.kind == 'given':
            sys.path.insert(0, str(HERE))
            import given
            given.bring(block.text.strip(), self.folder)
        elif block.kind == 'picture':
            self._picture(block.text)
        elif block.kind.startswith('{code-block}') and block.text.startswith(':caption: '):
            head, _, text = block.text.partition('\n\n')
            (self.folder / head.splitlines()[0].split(': ', 1)[1].strip()).write_text(text)

    def _console(self, block: Block) -> None:
        lines = []
        for command, shown in commands(block.text):
            came = self._shell(command)
            lines += [f'$ {command}'.replace('\n', '\n> ')]
            fits = agree(shown, came)
            if not fits and not self.write:
                want, have = map(form, shown), map(form, came)
                raise Stale('\n'.join([f'$ {command}', *difflib.unified_diff(
                    list(want), list(have), 'shown', 'came', lineterm='')]))
            cut = any(s.strip() in ('...', '…') for s in shown)
            lines += shown if fits and cut else came if shown else []
        if self.write:
            self.replaced.append((block.start, block.end, '\n'.join(lines) + '\n'))

    def _shell(self, command: str) -> list[str]:
        status = int(m[1]) if (m := STATUS.search(command)) else 0
        command = STATUS.sub('', command)
        if command.endswith('&'):
            self._left.append(subprocess.Popen(
                ['bash', '-c', f'exec {command[:-1]}'], cwd=self.folder, env=self._env,
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
            return []
        done = subprocess.run(
            ['bash', '-c', command], cwd=self.folder, env=self._env, text=True, timeout=600,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode != status:
            raise Stale(f'$ {command}\nexit status {done.returncode}, not {status}\n{done.stdout}')
        return done.stdout.rstrip().splitlines()

    def _ask(self, code: str) -> tuple[int, str]:
        if self._python is None:
            self._python = subprocess.Popen(
                [sys.executable, '-c', SERVER], cwd=self.folder, env=self._env, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert self._python.stdin and self._python.stdout
        self._python.stdin.write(json.dumps(code) + '\n')
        self._python.stdin.flush()
        answer = self._python.stdout.readline()
        return tuple(json.loads(answer)) if answer else (1, 'the process ended')

    def _picture(self, said: str) -> None:
        path, _, rest = said.partition(' = ')
        folder, _, name = rest.partition(' : ')
        if not (self.folder / folder.strip() / 'study.yaml').exists():
            raise Stale(f'no study {folder} for the picture {path}')
        if not self.write:
            if not (HERE / path).exists():
                raise Stale(f'no picture {path}: python doc/examples.py --write')
            return
        from imu_noise_tools import store
        from imu_noise_tools.loop import domains
        from imu_noise_tools.plots.ladder import ladder_figure
        from imu_noise_tools.plots.style import png
        study, name = store.load(self.folder / folder.strip()), name.strip()
        full = [name.removeprefix('target ')] if name.startswith('target ') else []
        pictures = domains.part('plots', study.domain).pictures(study, full)
        if name not in {*pictures, 'ladder'}:
            raise Stale(f'no picture {name}: there are {", ".join(pictures)} and ladder')
        data = png(ladder_figure(study)) if name == 'ladder' else pictures[name]
        (HERE / path).parent.mkdir(exist_ok=True)
        (HERE / path).write_bytes(data)

    def close(self) -> None:
        """End what was left running."""
        if self._python and self._python.stdin:
            self._python.stdin.close()
            self._python.wait(60)
        for process in self._left:
            process.send_signal(signal.SIGINT)
        for process in self._left:
            process.wait(60)


def run(page: Path, folder: Path, write: bool = False) -> None:
    """Run a page in a folder; raise Stale with page and line of what is not as shown."""
    text = page.read_text(encoding='utf-8')
    work = Run(folder, write)
    try:
        for block in blocks(text):
            try:
                work.do(block)
            except Stale as stale:
                raise Stale(f'{page.relative_to(HERE.parent)}:{block.line}: {stale}') from None
    finally:
        work.close()
        for start, end, new in reversed(work.replaced):
            text = text[:start] + new + text[end:]
        if work.replaced:
            page.write_text(text, encoding='utf-8')


def main(words: list[str]) -> int:
    """Run the pages named, or all of them."""
    write = '--write' in words
    named = [Path(w).resolve() for w in words if w != '--write']
    failed = 0
    for page in named or pages():
        folder, begin = Path(tempfile.mkdtemp(prefix='manual-')), time.monotonic()
        try:
            run(page, folder, write)
            print(f'{page.relative_to(HERE)}: {time.monotonic() - begin:.0f} s')
        except Stale as stale:
            failed += 1
            print(stale)
        finally:
            shutil.rmtree(folder)
    return 1 if failed else 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
