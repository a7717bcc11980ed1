# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a service answers, as somebody reads it who calls it from a shell.

``ros2 service call`` shows the message as one string: YAML in one line, with a summary first.

"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..loop.verdict import RIVAL
from ..store import dump_yaml


def text(result: Mapping[str, Any]) -> str:
    """Return a result as YAML in one line, with what people want to know of it in front."""
    said = summary(result)
    return dump_yaml({'summary': said, **result} if said else result, one_line=True)


def summary(result: Mapping[str, Any]) -> str:
    """Return one sentence on a result, or on why there is none; of a bare yes nothing."""
    if 'error' in result:
        return ': '.join(str(result[k]) for k in ('error', 'remedy') if result.get(k))
    if 'held' in result:
        left = f'left: {", ".join(result["left"])}' if result['left'] else 'none left: solve'
        return f'held: {result["held"]}; {result["done"]} of {result["of"]} done; {left}'
    if 'bias' in result:
        return _solved(result)
    if 'diagnosis' in result:
        return '; '.join(_judged(t, d) for t, d in result['diagnosis'].items())
    for change, where in (('added', 'to'), ('removed', 'from')):
        if isinstance(result.get(change), list):
            return f'{change}: ' + (', '.join(
                f'{s.get(change) or s["effects"]} {where} {s["target"]}'
                for s in result[change]) or 'nothing')
    if 'history' in result:
        steps = result['history']
        last = f', the last {steps[-1]["verdict"] or "not judged"}' if steps else ''
        return f'{len(steps)} models were tried{last}'
    if 'targets' in result:
        return _fitted(result)
    where = result.get('folder') or result.get('file')
    return f'written to {where}' if where else ''


def brief(diagnosis: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return a diagnosis with the candidates that count: what is found, and rivals.

    Values stand with what is found, of rivals as they are shown: written out, the candidates of
    six axes with which nothing is wrong are a thousand lines.

    """
    found = {f['effect'] for f in diagnosis['found']}
    ranked = [] if diagnosis['verdict'] == 'complete' else [
        {k: v for k, v in f.items() if k != 'parameters'} if f['effect'] in found else
        {**f, 'parameters': {k: v.get('shown', v.get('value'))
                             for k, v in f['parameters'].items()}}
        for f in diagnosis['ranked']
        if f['probability'] is None or f['probability'] > RIVAL or f['effect'] in found]
    return {**diagnosis, 'ranked': ranked}


def _solved(result: Mapping[str, Any]) -> str:
    """Return scale factors and biases of a calibration."""
    scale = ', '.join(f'{result["S"][k][k]:.5g}' for k in range(3))
    bias = ', '.join(f'{b:.3g}' for b in result['bias'])
    return (f'{result["sensor"]} solved by {result["method"]}: scale factors {scale}; '
            f'bias {bias} {result["unit"]}')


def _judged(target: str, diagnosis: Mapping[str, Any]) -> str:
    found = diagnosis.get('found') or ()
    if not found and diagnosis['verdict'] == 'undecidable':
        # what takes no share of the probability is no rival
        found = [f for f in diagnosis.get('ranked') or ()
                 if f.get('probability') is None or f['probability'] > RIVAL]
    names = ', '.join(f['effect'] for f in found)
    return f'{target} {diagnosis["verdict"]}' + (f' ({names})' if names else '')


def _fitted(result: Mapping[str, Any]) -> str:
    """Return what was fitted, and where the model is not within chance."""
    targets: Mapping[str, Mapping] = result['targets']
    source = result.get('source') or {}
    beyond = [t for t, e in targets.items() if not (e.get('error') or e).get('within_chance')]
    said = [f'{source["samples"]} samples at {source["rate_hz"]:.6g} Hz'] if source else []
    said.append(f'beyond chance: {", ".join(beyond)}' if beyond else 'all axes within chance')
    for sensor in ('gyro', 'accel') if source else ():
        values = list(worst(e for t, e in targets.items() if t.startswith(sensor)))
        said += [f'{sensor} {", ".join(values)}'] if values else []
    return '; '.join(said)


def worst(entries: Iterable[Mapping[str, Any]]) -> Iterable[str]:
    """Yield the largest of each coefficient of some axes, as it is shown."""
    most: dict[str, tuple[float, str]] = {}
    for entry in entries:
        for effect in entry['effects'].values():
            for name, found in effect.items():
                size = isinstance(found, Mapping) and (found.get('value') or found.get('upper95'))
                if isinstance(size, float) and isinstance(found, Mapping) and 'shown' in found:
                    most[name] = max(most.get(name, (0.0, '')), (size, str(found['shown'])))
    return (f'{name} {shown}' for name, (_, shown) in most.items())
