# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Output that is there whole or not at all.

It is written beside its place under a temporary name, then renamed.

"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
import errno
import fcntl
import os
from pathlib import Path
import re
import secrets
import shutil
import socket
import tempfile
from typing import Any

from .errors import InputError

# What marks a folder as one that this package wrote: only such a folder (or an empty one) is ever
# replaced.
MARKERS = ('study.yaml', 'metadata.yaml', 'calibration.yaml', 'studies.yaml')

DEEPEST = 50        # levels of YAML; a study has ten

_REMEDY = {
    errno.ENOSPC: 'free some disk space',
    errno.EDQUOT: 'free some disk space',
    errno.EACCES: 'choose a place that you may write to with -o',
    errno.EPERM: 'choose a place that you may write to with -o',
    errno.EROFS: 'choose a place that you may write to with -o',
    errno.ENAMETOOLONG: 'choose a shorter name with -o',
}


def cannot_write(path: str | Path, error: OSError) -> InputError:
    """Return the error for a person of what the system said about writing a path."""
    reason = (error.strerror or str(error) or type(error).__name__).lower()
    return InputError(f'{path}: cannot be written ({reason})',
                      _REMEDY.get(error.errno or 0, 'choose another place with -o'))


@contextmanager
def _mapped(path: str | Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise cannot_write(path, error) from error


def atomic_write(path: str | Path, data: str | bytes) -> None:
    """
    Write a file whole or not at all.

    Parameters
    ----------
    path : str or Path
        Where; a symbolic link is followed. A device or a pipe is written to directly.
    data : str or bytes
        Its content; text is encoded as UTF-8.

    Raises
    ------
    InputError
        It cannot be written there (no room, no permission, a folder in the way).

    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file() and not target.is_dir():
        with _mapped(path):
            target.write_bytes(_bytes(data))
        return
    with atomic_path(path) as temporary:
        _write_new(temporary, data)


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """
    Give a temporary path to write a file to, which becomes ``path`` when the block ends well.

    Missing parents are made.

    Raises
    ------
    InputError
        As :func:`atomic_write`.

    """
    with _mapped(path):
        target = Path(os.path.realpath(path))
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        made = _make_parents(target.parent)
        _sweep(target)
        temporary = _sibling(target)
    try:
        with _only_of(path, temporary):
            yield temporary
            os.replace(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        _remove(made)
        raise


@contextmanager
def _only_of(path: str | Path, temporary: Path) -> Iterator[None]:
    """Map errors of the system that come from writing, and no others."""
    try:
        yield
    except OSError as error:
        if error.filename is None or str(error.filename).startswith(str(temporary)):
            raise cannot_write(path, error) from error
        raise


def refuse_unwritable(path: str | Path, remedy: str) -> None:
    """
    See that a folder can be made at ``path`` before there is anything to write; none is left.

    Raises
    ------
    InputError
        It cannot be made, with this remedy.

    """
    target = Path(os.path.realpath(path))
    made: list[Path] = []
    try:
        made = _make_parents(target.parent)
        temporary = _sibling(target)
        temporary.mkdir()
        made.append(temporary)
    except OSError as error:
        raise InputError(cannot_write(path, error).message, remedy) from error
    finally:
        _remove(made)


@contextmanager
def new_folder(path: str | Path, force: bool = False) -> Iterator[Path]:
    """
    Give a temporary folder that becomes ``path`` when the block ends well.

    When it does not, the folder is removed.

    Parameters
    ----------
    path : str or Path
        The folder to be. Missing parents are made.
    force : bool
        Whether a folder that holds a study or a bag already is replaced, whole. A folder that
        holds anything else is never replaced.

    Yields
    ------
    Path
        An empty sibling folder to write into.

    Raises
    ------
    InputError
        Something is in the way, or it cannot be written there.

    """
    with _mapped(path):
        target = Path(os.path.realpath(path))
        _refuse_what_is_in_the_way(path, target, force)
        made = _make_parents(target.parent)
        _sweep(target)
        temporary = _sibling(target)
    try:
        with _mapped(path):
            temporary.mkdir()
        with _only_of(path, temporary):
            yield temporary
        with _mapped(path):
            _swap(temporary, target)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        _remove(made)
        raise


def plain_yaml(text: str, most_aliases: int = 0) -> Any:
    """
    Return the plain data of a YAML text: no objects, and no more levels than make sense.

    Aliases can unfold into something huge, and deep levels end the process in the C parser.

    Raises
    ------
    ValueError
        It is not such a text.

    """
    import yaml

    loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
    depth = aliases = 0
    try:
        for event in yaml.parse(text, Loader=loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            aliases += isinstance(event, yaml.AliasEvent)
            if depth > DEEPEST or aliases > most_aliases:
                what = 'aliases' if aliases > most_aliases else 'levels'
                raise ValueError(f'not readable as YAML (too many {what})')
        return yaml.load(text, Loader=loader)
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f'not readable as YAML ({str(error).splitlines()[0]})') from None


def scratch_folder() -> Path:
    """
    Return a new folder for what is unpacked, in the system's temporary one.

    Who asks for it removes it; what a killed process left is removed here.

    Raises
    ------
    InputError
        There is no temporary folder that can be written to.

    """
    try:
        name = Path(tempfile.gettempdir()) / 'imu_noise'
    except OSError as error:
        raise InputError('no temporary folder to unpack into', 'set TMPDIR') from error
    with _mapped(name.parent):
        _sweep(name)
        folder = _sibling(name)
        folder.mkdir(mode=0o700)
    return folder


@contextmanager
def only_writer(folder: str | Path) -> Iterator[None]:
    """
    Wait until nobody else writes into a folder, and keep others waiting until the block ends.

    Only who asks in the same way is kept waiting; nothing is left in the folder.

    Raises
    ------
    InputError
        There is no such folder.

    """
    with _mapped(folder):
        handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def replace_files(folder: str | Path, files: Mapping[str, str | bytes]) -> None:
    """
    Rewrite several files of a folder.

    All are written beside their places first, and renamed only then.

    Parameters
    ----------
    folder : str or Path
        An existing folder.
    files : mapping of str to str or bytes
        Content by file name, renamed in this order: put last what makes the rest valid.

    Raises
    ------
    InputError
        They cannot be written; then no file of the folder has changed.

    """
    folder = Path(folder)
    ready: list[tuple[Path, Path]] = []
    with _mapped(folder):
        try:
            for name, data in files.items():
                _sweep(folder / name)
                ready.append((_sibling(folder / name), folder / name))
                _write_new(ready[-1][0], data)
            _rename_all(ready)
        except BaseException:
            for temporary, _ in ready:
                temporary.unlink(missing_ok=True)
            raise


def _rename_all(ready: list[tuple[Path, Path]]) -> None:
    """Rename all, also when Ctrl-C comes in between: half of a study is worse than a late stop."""
    interrupted = None
    for temporary, target in ready:
        try:
            os.replace(temporary, target)
        except KeyboardInterrupt as stop:
            interrupted = stop
            if temporary.exists():
                os.replace(temporary, target)
    if interrupted:
        raise interrupted


def _bytes(data: str | bytes) -> bytes:
    return data.encode() if isinstance(data, str) else data


def _write_new(path: Path, data: str | bytes) -> None:
    with open(path, 'xb') as file:
        file.write(_bytes(data))


def _sibling(target: Path) -> Path:
    """Return a name beside the target that says which process made it."""
    owner = f'{_host()}-{os.getpid()}-{secrets.token_hex(3)}'
    return target.with_name(f'.{target.name[:100]}.{owner}.part')


def _host() -> str:
    return re.sub(r'[^A-Za-z0-9]', '', socket.gethostname())[:32] or 'host'


def _sweep(target: Path) -> None:
    """Remove what a killed process left beside the target."""
    pattern = re.compile(
        re.escape(f'.{target.name[:100]}.{_host()}-') + r'(\d+)-[0-9a-f]{6}\.part'
    )
    try:
        found = [(p, m) for p in target.parent.iterdir() if (m := pattern.fullmatch(p.name))]
    except OSError:
        return
    for left, match in found:
        if not _alive(int(match[1])):
            if left.is_dir() and not left.is_symlink():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def _refuse_what_is_in_the_way(path: str | Path, target: Path, force: bool) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f'{path}: is a file', 'choose another name with -o')
    held = {p.name for p in target.iterdir()}
    if not held:
        return
    if not held & set(MARKERS):
        raise InputError(
            f'{path}: the folder holds other files', 'choose another name with -o'
        )
    if not force:
        what = 'a study' if 'study.yaml' in held else 'an output of that name'
        raise InputError(
            f'{path}: {what} exists already',
            'choose another name with -o, or replace it with --force',
        )


def _make_parents(folder: Path) -> list[Path]:
    """Make missing folders; return those made, outermost first."""
    missing = []
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    made: list[Path] = []
    for one in reversed(missing):
        one.mkdir(exist_ok=True)
        made.append(one)
    return made


def _remove(made: list[Path]) -> None:
    """Remove parents again that were made, as far as they are empty."""
    for parent in reversed(made):
        try:
            parent.rmdir()
        except OSError:
            break


def _swap(temporary: Path, target: Path) -> None:
    """Put the new folder in its place; the old one goes only when the new one is there."""
    if not target.exists() or not any(target.iterdir()):
        os.replace(temporary, target)
        return
    old = _sibling(target)
    os.replace(target, old)
    try:
        os.replace(temporary, target)
    except BaseException:
        os.replace(old, target)
        raise
    shutil.rmtree(old, ignore_errors=True)
