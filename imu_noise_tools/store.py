# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Studies to and from a directory, whole or not at all.

study.yaml holds plain numbers (SI), evidence.npz plain arrays.

Nothing in a study names code to run: YAML is loaded safely, arrays without pickles.

"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from difflib import get_close_matches
import hashlib
import io
import math
from pathlib import Path
import shlex
from typing import Any
import zipfile

import numpy as np
import yaml

from .core import units
from .core.errors import ImuNoiseError, InputError
from .core.files import plain_yaml
from .loop.diagnosis import Diagnosis, Remaining
from .loop.domains import DOMAINS, OLDEST, package
from .loop.effect import Estimate, find_effect, Finding, Model, Parameter, registry
from .loop.study import assess, Contrast, Step, Study

FORMAT = 'imu_noise_study/1'
NEWEST = 3      # of the evidence, raised where it means something else or holds more than before
EXPANSION, AT_LEAST = 200, 1 << 27      # evidence unpacks to no more times its size, or bytes
ALIKE = 0.75        # of two names, from which one is meant by the other
_VERSION = 'format'       # that of the evidence, among its arrays; of 1 it is not there
_LADDER = 'ladder.'       # what the rungs' pictures show, among the arrays of evidence.npz
_NUMBER = (int, float, type(None))
_ESTIMATE = {'value': (*_NUMBER, str), 'std': _NUMBER, 'upper95': _NUMBER, 'point': _NUMBER}
_SHAPE = {
    'source!': {
        **dict.fromkeys(('rate_hz', 'duration_s', 'samples', 'start', 'begin_s'), _NUMBER),
        'warnings': [str],
        'input_unit': {str: str},
    },
    'targets!': {str: {'effects!': {str: {'effect!': str, str: _ESTIMATE}}}},
    'history!': [
        {'target!': str, 'effects!': [str], 'held_out!': _NUMBER, 'held_out_std!': _NUMBER,
         'moved': [[str]]}
    ],
    'diagnosis!': {
        str: {
            'verdict!': str,
            'ranked!': [{'effect!': str, 'gain!': _NUMBER, 'parameters!': {str: _ESTIMATE}}],
            'failed!': [{'test!': str, 'p_value!': _NUMBER, 'evidence!': str}],
            'advice!': str,
        }
    },
}


class _Dumper(yaml.SafeDumper):
    """Plain YAML whose floats YAML 1.1 reads as numbers."""

    def ignore_aliases(self, data: object) -> bool:
        """Write what occurs twice twice."""
        return True


def _float(dumper: yaml.SafeDumper, value: float) -> Any:
    text = (
        repr(value)
        if math.isfinite(value)
        else {math.inf: '.inf', -math.inf: '-.inf'}.get(value, '.nan')
    )
    if 'e' in text and '.' not in text:
        text = text.replace('e', '.0e')
    return dumper.represent_scalar('tag:yaml.org,2002:float', text)


_Dumper.add_representer(float, _float)


def plain(value: Any) -> Any:
    """Return a value with numpy's numbers, tuples and mappings made plain."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return value.item()
    return value


def dump_yaml(data: Any, one_line: bool = False) -> str:
    """Return YAML text: block style outside, flow style for small mappings inside; or one line."""
    text = yaml.dump(
        plain(data),
        Dumper=_Dumper,
        sort_keys=False,
        allow_unicode=True,
        width=float('inf') if one_line else 160,
        default_flow_style=True if one_line else None,
    )
    return text.strip() if one_line else text


def load_yaml(path: str | Path, remedy: str = 'analyse the bag again with --force') -> Any:
    """
    Return the plain data of a YAML file.

    Raise InputError with this remedy where it is not there, not YAML, or holds objects.

    """
    path = Path(path)
    try:
        if path.stat().st_size > 64 << 20:
            raise InputError(f'{path}: larger than 64 MB', remedy)
        text = path.read_text(encoding='utf-8')
        return plain_yaml(text)
    except OSError as error:
        raise InputError(f'{path}: {(error.strerror or str(error)).lower()}', remedy) from None
    except UnicodeDecodeError:
        raise InputError(f'{path}: not readable as YAML (not text)', remedy) from None
    except ValueError as error:
        raise InputError(f'{path}: {error}', remedy) from None


def study_to_dict(study: Study) -> dict:
    """Return a study as the plain data of study.yaml."""
    return plain(
        {
            'format': FORMAT,
            'domain': study.domain,
            'source': study.source,
            'targets': {t: target_to_dict(study, t) for t in study.targets},
            'history': [step_to_dict(s) for s in study.history],
            'diagnosis': {t: diagnosis_to_dict(t, d) for t, d in study.diagnosis.items()},
        }
    )


def target_to_dict(study: Study, target: str) -> dict:
    """Return one target: its effects with their estimates, and its error."""
    state = study.states[target]
    sensor = target.partition('_')[0]
    out: dict[str, Any] = {}
    if sensor in ('gyro', 'accel'):
        out['unit'] = units.si('{rate}', sensor)
    out['effects'] = {
        e.label: {
            'effect': e.name,
            **{
                k: estimate_to_dict(v, e.parameter(k), sensor)
                for k, v in state.fit.estimates.get(e.label, {}).items()
            },
        }
        for e in state.model
    }
    error = state.error
    out['error'] = {
        'held_out': _known(error.excess),
        'held_out_std': _known(error.std),
        'within_chance': None if math.isnan(error.excess) else error.within_chance,
        'views': {k: v.excess for k, v in error.views.items()},
        **state.summary,
    }
    out.update(state.problem.basis(state.fit))
    if state.fit.flags:
        out['flags'] = list(state.fit.flags)
    return out


def estimate_to_dict(e: Estimate, parameter: Parameter, sensor: str = '') -> dict:
    """Return one estimate as plain data; of a choice that is its name."""
    if parameter.choices:
        return {'value': None if e.value is None else parameter.written(e.value)}
    out: dict[str, Any] = {
        'value': e.value,
        'std': e.std,
        'ci95': None if e.ci95 is None else list(e.ci95),
        'unit': e.unit,
    }
    if e.upper95 is not None:
        out['upper95'] = e.upper95
    if e.point is not None and e.value is None:
        out['point'] = e.point
    if e.note:
        out['note'] = e.note
    if sensor in ('gyro', 'accel'):
        out['shown'] = parameter.in_words(e.value) or (
            units.shown(e.value, parameter.unit, sensor)
            if e.value is not None or e.upper95 is None
            else f'below {units.shown(e.upper95, parameter.unit, sensor)}'
        )
    return out


def _known(error: float) -> float | None:
    """Return an error as plain data: none where nothing was predicted."""
    return None if math.isnan(error) else error


def _error_of(known: float | None) -> float:
    return math.nan if known is None else known


def step_to_dict(s: Step) -> dict:
    """Return one rung of the ladder."""
    out: dict[str, Any] = {'target': s.target, 'effects': list(s.effects), 'added': s.added}
    if s.removed:
        out['removed'] = s.removed
    out.update(held_out=_known(s.held_out), held_out_std=_known(s.held_out_std))
    if s.fall is not None:
        out['fall'] = s.fall
    out['verdict'] = s.verdict
    out['failing'] = list(s.failing)
    if s.why:
        out['why'] = [_finding_to_dict(s.target, f) for f in s.why]
    if s.contrast is not None:
        out['contrast'] = {'view': s.contrast.view, 'unit': s.contrast.unit}
    if s.moved:
        out['moved'] = [list(x) for x in s.moved]
    return out


def diagnosis_to_dict(target: str, d: Diagnosis) -> dict:
    """Return the diagnosis of a target as plain data."""
    return plain(
        {
            'verdict': d.verdict,
            'found': [_finding_to_dict(target, f) for f in d.found],
            'remaining': _remaining_to_dict(target, d.remaining),
            'sufficient': d.sufficient,
            'ranked': [_finding_to_dict(target, f) for f in d.ranked],
            'failed': [_test_to_dict(f) for f in d.failed],
            'advice': d.advice,
        }
    )


def _finding_to_dict(target: str, f: Finding) -> dict:
    sensor = target.partition('_')[0]
    return {
        'effect': f.name,
        'gain': f.gain,
        'penalty': f.penalty,
        'probability': f.probability,
        'explains': f.explains,
        'parameters': {
            k: estimate_to_dict(v, f.effect.parameter(k), sensor)
            for k, v in f.estimates.items() if f.effect is not None
        },
        'evidence': f.evidence,
        'against': f.against,
    }


def _test_to_dict(f: Finding) -> dict:
    return {'test': f.name, 'p_value': f.p_value, 'evidence': f.evidence}


def _remaining_to_dict(target: str, left: Remaining | None) -> dict | None:
    if left is None:
        return None
    return {
        'failed': [_test_to_dict(f) for f in left.failed],
        'share': left.share,
        'largest_ratio': left.largest_ratio,
        'sufficient': left.sufficient,
        'nearest': left.nearest and _finding_to_dict(target, left.nearest),
    }


def history_of(data: Mapping, arrays: Mapping[str, np.ndarray] | None = None) -> list[Step]:
    """Return the ladder of what :func:`read` gave, with its pictures' arrays where they are."""
    return [_step_of(str(data['domain']), d, _contrast_of(k, d.get('contrast'), arrays or {}))
            for k, d in enumerate(data.get('history') or ())]


def _step_of(domain: str, d: Any, contrast: Contrast | None) -> Step:
    return Step(
        d['target'],
        tuple(d['effects']),
        _error_of(d['held_out']),
        _error_of(d['held_out_std']),
        d.get('added'),
        d.get('removed'),
        d.get('fall'),
        d.get('verdict', ''),
        tuple(d.get('failing') or ()),
        # of a user's own file nobody has to name to see the ladder
        tuple(_finding_of(domain, f) for f in d.get('why') or ()
              if f['effect'] in registry(domain)),
        contrast,
        tuple((label, name) for label, name in d.get('moved') or ()),
    )


def _contrast_of(k: int, d: Any, arrays: Mapping[str, np.ndarray]) -> Contrast | None:
    found = arrays.get(f'{_LADDER}{k}')
    if not d or found is None:
        return None
    x, before, after = (tuple(float(v) for v in row) for row in found)
    return Contrast(d['view'], d['unit'], x, before, after)


def _ladder_arrays(study: Study) -> dict[str, np.ndarray]:
    """Return what the rungs' pictures show, (3, k) each: x, pulls before, pulls after."""
    return {f'{_LADDER}{k}': np.array([s.contrast.x, s.contrast.before, s.contrast.after],
                                      np.float32)
            for k, s in enumerate(study.history) if s.contrast is not None}


def _estimate_of(parameter: Parameter, e: Any) -> Estimate:
    if parameter.choices:
        number = parameter.number(e['value'])
        return Estimate(number, None, None, point=number)
    return Estimate(
        e.get('value'),
        e.get('std'),
        tuple(e['ci95']) if e.get('ci95') else None,
        e.get('unit', ''),
        e.get('upper95'),
        e.get('note', ''),
        e.get('point', e.get('value')),
    )


def _finding_of(domain: str, f: Any) -> Finding:
    known = find_effect(domain, f['effect'])
    given = {known.parameter(k): v for k, v in f.get('parameters', {}).items()}
    found = {p.name: _estimate_of(p, v) for p, v in given.items()}
    effect = known({k: v.point for k, v in found.items() if v.point is not None})
    return Finding(f['effect'], f['gain'], effect, found, f.get('penalty', 0.0), '',
                   f.get('evidence', ''), f.get('probability'),
                   explains=f.get('explains'), against=f.get('against', ''))


def _diagnosis_of(domain: str, d: Any) -> Diagnosis:
    def findings(some: Any) -> tuple[Finding, ...]:
        return tuple(_finding_of(domain, f) for f in some or ())

    def tests(some: Any) -> tuple[Finding, ...]:
        return tuple(Finding(f['test'], 0.0, view=f['test'], p_value=f['p_value'],
                             evidence=f['evidence']) for f in some or ())

    left = d.get('remaining')
    if left is not None:
        near = left.get('nearest')
        left = Remaining(tests(left.get('failed')), left.get('share'), left.get('largest_ratio'),
                         left.get('sufficient'), _finding_of(domain, near) if near else None)
    return Diagnosis(d['verdict'], findings(d.get('ranked')), tests(d.get('failed')),
                     d.get('advice', ''), findings(d.get('found')), left, d.get('sufficient'))


def study_files(study: Study) -> dict[str, bytes | str]:
    """Return study.yaml and evidence.npz as {name: content}."""
    face = package(study.domain)
    buffer = io.BytesIO()
    arrays: dict[str, Any] = face.arrays_of({t: s.problem for t, s in study.states.items()})
    arrays.update(_ladder_arrays(study))
    arrays[_VERSION] = np.array(NEWEST)
    np.savez_compressed(buffer, **arrays)
    return {'study.yaml': dump_yaml(study_to_dict(study)), 'evidence.npz': buffer.getvalue()}


def fingerprint(folder: str | Path) -> str:
    """Return a digest of what a folder's study is read from; empty where there is none."""
    digest = hashlib.sha256()
    try:
        for name in ('study.yaml', 'evidence.npz'):
            path = Path(folder) / name
            if not path.is_file():          # a pipe would wait for ever
                return ''
            digest.update(path.read_bytes())
    except OSError:
        return ''
    return digest.hexdigest()


def read(folder: str | Path) -> dict:
    """Return the plain data of a folder's study.yaml; raise InputError for anything else."""
    path = Path(folder) / 'study.yaml'
    if not path.is_file():
        raise not_in(folder, 'study.yaml', 'name a folder that analyse, calibrate or filter wrote')
    data = load_yaml(path)
    if (
        not isinstance(data, dict)
        or data.get('format') != FORMAT
        or str(data.get('domain')) not in DOMAINS
    ):
        raise InputError(
            f'{path}: not a study of format {FORMAT}', 'analyse the bag again with --force'
        )
    wrong = _misshapen(data, _SHAPE)
    if wrong:
        raise InputError(
            f'{path}: the study is damaged at {wrong}', 'analyse the bag again with --force'
        )
    return data


def refuse_other(folder: str | Path, data: Mapping,
                 arrays: Mapping[str, np.ndarray] | None = None) -> None:
    """
    Raise InputError where the evidence of what :func:`read` gave means something else now.

    ``arrays`` are those of evidence.npz where they are read already.

    """
    path = Path(folder) / 'evidence.npz'
    arrays = load_arrays(path, (_VERSION,)) if arrays is None else arrays
    stated = arrays.get(_VERSION, np.array(1))
    number = int(stated) if stated.shape == () and stated.dtype.kind in 'iu' else 0
    if number > NEWEST:
        raise InputError(f'{path}: evidence of format {number}, for which this version is too old '
                         f'(it reads up to {NEWEST})', 'update imu_noise_tools')
    if number >= OLDEST[str(data['domain'])]:
        return
    of = data['source'].get('path')
    bag = shlex.quote(of) if of and isinstance(of, str) else 'BAG'
    raise InputError(
        f'{folder}: evidence of format {number}, written by an older version',
        f'make it anew: imu_noise analyse {bag} -o {shlex.quote(str(folder))} --force')


def not_in(folder: str | Path, name: str, remedy: str) -> InputError:
    """Return the error of a folder without such a file; its remedy names what was meant."""
    folder = Path(folder)
    what = (f'no {name} in it' if folder.is_dir() else 'a file, and no folder of a study'
            if folder.is_file() else 'no such folder')
    meant = _meant(folder, name)
    if len(meant) == 1:
        remedy = f'did you mean {meant[0]}?'
    elif meant:
        remedy = f'name one of those that have one: {", ".join(meant)}'
    return InputError(f'{folder}: {what}', remedy)


def _meant(folder: Path, name: str) -> list[str]:
    """Return paths with such a file: of a study of this bag, in this folder, or named alike."""
    def having(paths: Iterable[Path]) -> list[str]:
        return [str(p) for p in sorted(paths) if (p / name).is_file()]

    with suppress(OSError, ValueError):
        if found := having([Path(f'{folder}.study')]):
            return found
        if folder.name == name and having([folder.parent]):
            return [str(folder.parent)]
        if found := having(folder.iterdir() if folder.is_dir() else []):
            return found
        beside = {Path(p).name: p for p in having(folder.parent.iterdir())}
        return [beside[n] for n in get_close_matches(folder.name, beside, 1, ALIKE)]
    return []


def _misshapen(data: Any, shape: Any, where: str = '') -> str:
    """
    Return where plain data is not of a shape, or nothing.

    A shape is a list of one shape, types, or a mapping of names to shapes: with ! they must be
    there, ``str`` stands for any other name.

    """
    if isinstance(shape, list):
        if not isinstance(data, list):
            return where
        inside = [(f'{where}[{k}]', value, shape[0]) for k, value in enumerate(data)]
    elif isinstance(shape, dict):
        if not isinstance(data, dict):
            return where
        known = {k.rstrip('!'): v for k, v in shape.items() if isinstance(k, str)}
        missing = [k[:-1] for k in shape if str(k).endswith('!') and k[:-1] not in data]
        strange = [k for k in data if not isinstance(k, str)]
        if missing or strange:
            return f'{where}/{(missing + strange)[0]}'
        inside = [(f'{where}/{k}', v, known.get(k, shape.get(str))) for k, v in data.items()]
        inside = [i for i in inside if i[2] is not None]
    else:
        return '' if isinstance(data, shape) else where
    return next((found for i, v, s in inside if (found := _misshapen(v, s, i))), '')


def load(folder: str | Path, intervals: bool = True) -> Study:
    """
    Return the study of a folder, its models fitted again to the evidence.

    The numbers are the same, and all that hangs on them; the values' intervals only if asked for.

    Raises
    ------
    InputError
        No study, a damaged one, one of an older or newer format, or one with effects that are not
        known (give their file with ``--effects-from``).

    """
    data = read(folder)
    arrays = load_arrays(Path(folder) / 'evidence.npz')
    refuse_other(folder, data, arrays)
    try:
        problems = package(data['domain']).problems(
            {k: v for k, v in arrays.items() if k != _VERSION and not k.startswith(_LADDER)})
        states = {}
        for target, entry in data['targets'].items():
            model = Model(
                find_effect(data['domain'], e['effect'])({}, label)
                for label, e in entry['effects'].items()
            )
            states[target] = assess(problems[target], model, intervals)
        return Study(
            data['domain'],
            states,
            data.get('source'),
            history_of(data, arrays),
            {
                t: _diagnosis_of(data['domain'], d)
                for t, d in (data.get('diagnosis') or {}).items()
            },
        )
    except ImuNoiseError as error:
        raise InputError(
            f'{folder}: {error.message}',
            f"{error.remedy}; a user's own effects: --effects-from FILE",
        ) from None
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:
        raise InputError(
            f'{folder}: the study is damaged ({type(error).__name__}: {error})',
            'analyse the bag again with --force',
        ) from None


def load_arrays(path: str | Path, names: Collection[str] = ()) -> dict[str, np.ndarray]:
    """
    Return the arrays of an .npz file, never unpickling; of some ``names`` those that are there.

    Raise InputError where it is damaged or bloated.

    """
    path = Path(path)
    try:
        if not path.is_file():
            raise InputError(f'{path}: no such file', 'analyse the bag again with --force')
        with zipfile.ZipFile(path) as archive:
            size = sum(i.file_size for i in archive.infolist())
            if size > max(AT_LEAST, EXPANSION * path.stat().st_size):
                raise InputError(
                    f'{path}: would unpack to {size / 1e9:.0f} GB',
                    'not the evidence of a study',
                )
        with np.load(path, allow_pickle=False) as data:
            return {k: data[k] for k in data.files if not names or k in names}
    except OSError as error:
        raise InputError(
            f'{path}: {error.strerror or error}', 'analyse the bag again with --force'
        ) from None
    except InputError:
        raise
    except Exception as error:      # of zipfile, zlib, numpy, and the tokenizer that numpy uses
        what = str(error)[:100] if '<' not in str(error) else 'the header of an array'
        raise InputError(
            f'{path}: damaged ({what})', 'analyse the bag again with --force'
        ) from None
