# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Studies, specifications and calibrations that go wrong, made by code.

``studies(good)`` gives makers by name: each takes a folder that is a copy of a good study and
spoils it. ``SPECS`` and ``CALIBRATIONS`` are texts by name.

"""

from __future__ import annotations

import io
import os
from pathlib import Path
import pickle
import shutil
import zipfile

import numpy as np
import yaml

BOMB = 'a: &a [x, x, x, x, x, x, x, x, x, x]\n' + ''.join(
    f'{chr(98 + k)}: &{chr(98 + k)} [{", ".join(["*" + chr(97 + k)] * 10)}]\n' for k in range(9))
OBJECT = '!!python/object/apply:os.system ["touch ran"]\n'
DEEP = '[' * 20_000 + ']' * 20_000 + '\n'

STUDY, EVIDENCE = {}, {}        # makers of what is wrong with study.yaml, with evidence.npz


class Ran:
    """Runs code where it is unpickled."""

    def __reduce__(self):
        """Leave a trace in the working folder."""
        return os.system, ('touch ran',)


def of(kind):
    """Register a maker by its name."""
    def keep(make):
        kind[make.__name__] = make
        return make
    return keep


def text(content):
    """Return a maker that puts some text in place of study.yaml."""
    def make(folder: Path):
        (folder / 'study.yaml').write_bytes(
            content if isinstance(content, bytes) else content.encode())
    return make


STUDY.update({
    'empty_yaml': text(''), 'binary_yaml': text(bytes(range(256)) * 20),
    'broken_yaml': text('format: [imu_noise_study/1\n'), 'yaml_bomb': text(BOMB),
    'yaml_object': text(OBJECT), 'deep_yaml': text(DEEP), 'list_yaml': text('- 1\n- 2\n'),
    'null_yaml': text('null\n'), 'other_format': text('format: other/9\ndomain: noise\n'),
    'list_domain': text('format: imu_noise_study/1\ndomain: [noise]\n'),
    'unknown_domain': text('format: imu_noise_study/1\ndomain: os\n'),
    'control_characters': text('format: \x00\x07\n'), 'latin_yaml': text('format: \xe9'.encode(
        'latin-1')),
})


@of(STUDY)
def no_study(folder: Path):
    """Leave the rest alone."""
    (folder / 'study.yaml').unlink()


@of(STUDY)
def fifo_yaml(folder: Path):
    """Wait for a writer that never comes."""
    (folder / 'study.yaml').unlink()
    os.mkfifo(folder / 'study.yaml')


@of(STUDY)
def folder_yaml(folder: Path):
    """Put a folder in its place."""
    (folder / 'study.yaml').unlink()
    (folder / 'study.yaml').mkdir()


@of(STUDY)
def link_to_itself(folder: Path):
    """Put a link to nowhere in its place."""
    (folder / 'study.yaml').unlink()
    (folder / 'study.yaml').symlink_to(folder / 'study.yaml')


@of(STUDY)
def huge_yaml(folder: Path):
    """Make a file of holes that says it is a gigabyte."""
    with open(folder / 'study.yaml', 'r+b') as file:
        file.truncate(1 << 30)


def changed(**changes):
    """Return a maker that sets keys ('a/b': value; None: gone) of study.yaml."""
    def make(folder: Path):
        path = folder / 'study.yaml'
        data = yaml.safe_load(path.read_text())
        for key, value in changes.items():
            *above, last = key.split('/')
            at = data
            for k in above:
                at = at[k]
            at.pop(last, None) if value is Gone else at.__setitem__(last, value)
        path.write_text(yaml.safe_dump(data))
    return make


class Gone:
    """Stands for a key that is taken out."""


STUDY_VALUES = {        # valid YAML with wrong values: history and the like may still read it
    'no_targets': changed(targets=Gone), 'targets_list': changed(targets=[1, 2]),
    'targets_text': changed(targets='all'), 'target_null': changed(**{'targets/gyro_x': None}),
    'unknown_target': changed(**{'targets/wheel': {'effects': {}}}),
    'effects_list': changed(**{'targets/gyro_x/effects': ['white']}),
    'effect_unknown': changed(**{'targets/gyro_x/effects': {'w': {'effect': 'os.system'}}}),
    'effect_number': changed(**{'targets/gyro_x/effects': {'w': {'effect': 7}}}),
    'label_number': changed(**{'targets/gyro_x/effects': {7: {'effect': 'white'}}}),
    'history_text': changed(history='none'), 'history_numbers': changed(history=[1, 2]),
    'history_empty_step': changed(history=[{}]),
    'history_nested': changed(history=[{'target': [], 'effects': 5, 'held_out': 'x',
                                        'held_out_std': None}]),
    'diagnosis_list': changed(diagnosis=[1]),
    'diagnosis_text': changed(diagnosis={'gyro_x': 'fine'}),
    'diagnosis_odd': changed(diagnosis={'gyro_x': {'verdict': 5, 'ranked': [{}]}}),
    'source_text': changed(source='a bag'), 'source_null': changed(source=None),
    'source_rate': changed(**{'source/rate_hz': []}),
}


@of(EVIDENCE)
def no_evidence(folder: Path):
    """Leave the rest alone."""
    (folder / 'evidence.npz').unlink()


@of(EVIDENCE)
def fifo_evidence(folder: Path):
    """Wait for a writer that never comes."""
    (folder / 'evidence.npz').unlink()
    os.mkfifo(folder / 'evidence.npz')


@of(EVIDENCE)
def folder_evidence(folder: Path):
    """Put a folder in its place."""
    (folder / 'evidence.npz').unlink()
    (folder / 'evidence.npz').mkdir()


@of(EVIDENCE)
def empty_evidence(folder: Path):
    """Make a file of no bytes."""
    (folder / 'evidence.npz').write_bytes(b'')


@of(EVIDENCE)
def text_evidence(folder: Path):
    """Write some text."""
    (folder / 'evidence.npz').write_text('not an archive')


@of(EVIDENCE)
def cut_evidence(folder: Path):
    """Cut it in the middle."""
    path = folder / 'evidence.npz'
    os.truncate(path, path.stat().st_size // 2)


@of(EVIDENCE)
def bare_pickle(folder: Path):
    """Put a pickle in its place."""
    (folder / 'evidence.npz').write_bytes(pickle.dumps(Ran()))


def rewritten(folder: Path, change):
    """Rewrite the arrays by a function of all of them by name."""
    path = folder / 'evidence.npz'
    with np.load(path) as data:
        arrays = {k: data[k] for k in data.files}
    change(arrays)
    np.savez(path, **arrays)


@of(EVIDENCE)
def pickled_array(folder: Path):
    """Hide code in an array of objects."""
    rewritten(folder, lambda a: a.__setitem__('gyro_x/n', np.array([Ran()], object)))


@of(EVIDENCE)
def arrays_gone(folder: Path):
    """Lose half of the arrays."""
    rewritten(folder, lambda a: [a.pop(k) for k in list(a)[::2]])


@of(EVIDENCE)
def arrays_empty(folder: Path):
    """Empty all arrays."""
    rewritten(folder, lambda a: a.update({k: np.zeros(0) for k in a}))


@of(EVIDENCE)
def arrays_short(folder: Path):
    """Shorten all powers."""
    rewritten(folder, lambda a: a.update({k: v[:3] for k, v in a.items() if v.ndim}))


@of(EVIDENCE)
def arrays_text(folder: Path):
    """Write words in place of numbers."""
    rewritten(folder, lambda a: a.update({k: np.full(v.shape, 'x') for k, v in a.items()}))


@of(EVIDENCE)
def arrays_nan(folder: Path):
    """Lose all numbers."""
    rewritten(folder, lambda a: a.update(
        {k: np.full(v.shape, np.nan) for k, v in a.items() if v.dtype.kind == 'f'}))


@of(EVIDENCE)
def huge_count(folder: Path):
    """Claim a record of a million years."""
    rewritten(folder, lambda a: a.update(
        {k: np.array(1 << 50) for k in a if k.endswith('/n') and not a[k].ndim}))


@of(EVIDENCE)
def broken_header(folder: Path):
    """Break the header of an array, the sums of the archive being right."""
    _header(folder, b"'shape': (", b"'shape': ((")


@of(EVIDENCE)
def word_in_header(folder: Path):
    """Write a word where the header of an array has a constant."""
    _header(folder, b'False', b'Fal_e')


def _header(folder: Path, *change: bytes):
    path = folder / 'evidence.npz'
    with zipfile.ZipFile(path) as archive:
        members = {i.filename: archive.read(i) for i in archive.infolist()}
    name = next(iter(members))
    members[name] = members[name].replace(*change)
    with zipfile.ZipFile(path, 'w') as archive:
        for member, raw in members.items():
            archive.writestr(member, raw)


@of(EVIDENCE)
def zip_bomb(folder: Path):
    """Unpack to a thousand times its size."""
    with zipfile.ZipFile(folder / 'evidence.npz', 'w', zipfile.ZIP_DEFLATED) as archive:
        with archive.open('gyro_x/n.npy', 'w', force_zip64=True) as file:
            np.lib.format.write_array_header_1_0(
                file, {'descr': '<f8', 'fortran_order': False, 'shape': (20 << 21,)})
            for _ in range(20):
                file.write(bytes(1 << 24))


@of(EVIDENCE)
def huge_shape(folder: Path):
    """Claim an array of an exabyte."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {'descr': '<f8', 'fortran_order': False, 'shape': (1 << 57,)})
    with zipfile.ZipFile(folder / 'evidence.npz', 'w') as archive:
        archive.writestr('gyro_x/n.npy', buffer.getvalue() + bytes(64))


def spoil(good: Path, target: Path, make) -> Path:
    """Return a spoilt copy of a good study."""
    shutil.copytree(good, target)
    make(target)
    return target


_WHITE = 'targets: {gyro_x: {white: {N: 1.0e-4}}}\n'
SPECS = {
    'empty': '', 'list': '- 1\n', 'broken': 'rate_hz: [\n', 'bomb': BOMB, 'object': OBJECT,
    'deep': DEEP, 'nothing': 'rate_hz: 100\nduration_s: 10\n',
    'no_rate': 'duration_s: 10\n' + _WHITE,
    'negative_rate': 'rate_hz: -1\nduration_s: 100\n' + _WHITE,
    'text_rate': 'rate_hz: fast\nduration_s: 100\n' + _WHITE,
    'nan_rate': 'rate_hz: .nan\nduration_s: 100\n' + _WHITE,
    'infinite': 'rate_hz: 100\nduration_s: .inf\n' + _WHITE,
    'endless': 'rate_hz: 1000\nduration_s: 1.0e+12\n' + _WHITE,
    'list_rate': 'rate_hz: [1]\nduration_s: 100\n' + _WHITE,
    'huge_seed': 'rate_hz: 100\nduration_s: 10\nseed: -5\n' + _WHITE,
    'text_seed': 'rate_hz: 100\nduration_s: 10\nseed: x\n' + _WHITE,
    'targets_list': 'rate_hz: 100\nduration_s: 10\ntargets: [gyro_x]\n',
    'wrong_axis': 'rate_hz: 100\nduration_s: 10\ntargets: {wheel: {white: {N: 1}}}\n',
    'wrong_effect': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {magic: {N: 1}}}\n',
    'wrong_parameter': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {white: {Q: 1}}}\n',
    'parameter_text': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {white: {N: much}}}\n',
    'parameter_list': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {white: {N: [1]}}}\n',
    'parameter_nan': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {white: {N: .nan}}}\n',
    'parameter_negative': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {white: {N: -1}}}\n',
    'parameter_none': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {white: }}\n',
    'axis_none': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: }\n',
    'axis_number': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: 5}\n',
    'number_label': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {5: {N: 1}}}\n',
    'no_temperature': 'rate_hz: 100\nduration_s: 10\n'
                      'targets: {gyro_x: {temperature: {slope: 1, curvature: 0, lag: 0}}}\n',
    'covariates_list': 'rate_hz: 100\nduration_s: 10\ncovariates: [temperature]\n' + _WHITE,
    'covariate_text': 'rate_hz: 100\nduration_s: 10\ncovariates: {temperature: warm}\n' + _WHITE,
    'covariate_value': 'rate_hz: 100\nduration_s: 10\ncovariates: {temperature: {base: x}}\n'
                       + _WHITE,
    'motion_text': 'rate_hz: 100\nduration_s: 10\nmotion: up\n' + _WHITE,
    'motion_odd': 'rate_hz: 100\nduration_s: 10\nmotion: {rocking: {axis: q}}\n' + _WHITE,
    'motion_unknown': 'rate_hz: 100\nduration_s: 10\nmotion: {flying: {}}\n' + _WHITE,
    'motion_value': 'rate_hz: 100\nduration_s: 10\n'
                    'motion: {rocking: {axis: x, amplitude_deg: much, period_s: 0}}\n' + _WHITE,
    'zero_period': 'rate_hz: 100\nduration_s: 10\n'
                   'motion: {rocking: {axis: x, amplitude_deg: 5, period_s: 0}}\n' + _WHITE,
    'bias_text': 'rate_hz: 100\nduration_s: 10\ntargets: {gyro_x: {bias: big, white: {N: 1}}}\n',
}

CALIBRATIONS = {
    'empty': '', 'list': '- 1\n', 'broken': 'G: [\n', 'bomb': BOMB, 'object': OBJECT,
    'deep': DEEP, 'no_matrix': 'sensor: accel\n', 'text': 'sensor: accel\nS: x\nbias: y\n',
    'short': 'sensor: accel\nS: [[1, 0], [0, 1]]\nbias: [0, 0]\n',
    'ragged': 'sensor: accel\nS: [[1, 0], [0, 1, 0], [0]]\nbias: [0, 0, 0]\n',
    'nan': 'sensor: accel\nS: [[.nan, 0, 0], [0, 1, 0], [0, 0, 1]]\nbias: [0, 0, 0]\n',
    'singular': 'sensor: accel\nS: [[0, 0, 0], [0, 1, 0], [0, 0, 1]]\nbias: [0, 0, 0]\n',
    'wrong_sensor': 'sensor: wheel\nS: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nbias: [0, 0, 0]\n',
    'null': 'sensor: accel\nS: null\nbias: null\n',
    'mapping': 'sensor: {a: b}\nS: {a: 1}\nbias: {b: 2}\n',
}
