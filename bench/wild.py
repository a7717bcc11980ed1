# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Judge the installed command on records of wild_mechanisms.py, as a black box.

Each record is written as an .npz and given to ``imu_noise analyse`` and ``imu_noise diagnose
--json`` as processes; only their JSON is judged (what the words mean: doc/theory/loop.md).  One
line of JSON per record and axis goes to the output as it is done, so that a run can be broken off
and taken up again; a table with shares and 95 % Wilson intervals ends it:

    python bench/wild.py --kind one --count 100 --seed 0 --jobs 2 -o one.jsonl
    python bench/wild.py --table one.jsonl nothing.jsonl

A record is *clear* where a perfect method would gain ``bar`` nats (18; 36 where flicker or
random_walk can imitate the effect); below 5 nats *complete* and *undecidable* are right as well.
Outcomes:

* one: right or wrong by the first name found, unnamed where none is;
* nothing: right where complete, wrong where a name is given, unnamed else;
* outside: right where nothing is named and the verdict is not complete, missed where it is
  complete, unnamed where the record is refused, kin where the names are in a wider sense true (a
  wandering variance called variance_change), else wrong;
* two, three, lines: right where every clear effect is found, unnamed where one is not found, and
  wrong where a name is found besides that nothing in the truth bears out (whatever else is
  found).
"""
import argparse
from concurrent.futures import ProcessPoolExecutor
from itertools import groupby
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
import wild_mechanisms

KINDS = ('nothing', 'one', 'two', 'three', 'lines', 'outside')
ACCEL = ('accel_x', 'accel_y', 'accel_z')
COMMAND = pathlib.Path(sys.executable).parent / 'imu_noise'


def run(arguments, folder, limit):
    """Run the command; return exit code, standard output, standard error and its CPU seconds."""
    out, err = folder / 'stdout', folder / 'stderr'
    # compiled once, as what is installed is
    environment = {'OMP_NUM_THREADS': '1', 'OPENBLAS_NUM_THREADS': '1', **os.environ,
                   'PYTHONDONTWRITEBYTECODE': ''}
    with open(out, 'w') as o, open(err, 'w') as e:
        process = subprocess.Popen([str(COMMAND), *arguments], stdout=o, stderr=e, cwd=folder,
                                   env=environment)
        end = time.monotonic() + limit
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > end:
                process.kill()
                _, status, usage = os.wait4(process.pid, 0)
                break
            time.sleep(.05)
        process.returncode = os.waitstatus_to_exitcode(status)
    return (process.returncode, out.read_text(), err.read_text(errors='replace'),
            usage.ru_utime + usage.ru_stime)


def named(diagnosis):
    """Return what a diagnosis names, in order: (name, probability, parameters)."""
    found = diagnosis.get('found')
    if found is None:
        found = diagnosis.get('ranked', [])[:1] if diagnosis.get('verdict') == 'missing' else []
    return [(f.get('effect') or f.get('name'), f.get('probability'), f.get('parameters', {}))
            for f in found]


def _frequency(parameters):
    value = parameters.get('frequency')
    return value.get('value') if isinstance(value, dict) else value


def _one_line(hidden):
    """Return sinusoid where harmonics have one order that is clear: no record shows a family."""
    if hidden['name'] != 'harmonics':
        return []
    power = np.sort(np.square(hidden['params']['amplitudes']))[::-1]
    return ['sinusoid'] if hidden['clear_here'] * power[1] / power.sum() < hidden['bar'] else []


def _at_an_order(hidden, frequency, duration, rate):
    """Tell whether a line is at one of the orders of a shaft, folded about half the rate."""
    if hidden['name'] != 'harmonics' or frequency is None:
        return False
    orders = np.array(hidden['params']['orders']) * hidden['params']['frequency']
    folded = np.abs(orders - rate * np.round(orders / rate))
    return bool(np.min(np.abs(folded - frequency)) < 3 / duration)


def match(found, hidden, duration, rate):
    """Return for each found name the number of the hidden effect it is, or None."""
    left, out, called = list(range(len(hidden))), [], set()
    lines = [h for h in hidden if h['name'] == 'sinusoid']
    for name, _, parameters in found:
        fits = [i for i in left if name in hidden[i]['accept']]
        frequency = _frequency(parameters)
        if name == 'sinusoid' and len(lines) > 1 and frequency is not None:
            fits = [i for i in fits if abs(hidden[i]['params'].get('frequency', 0) - frequency)
                    < max(3 / duration, 1e-3 * frequency)]
        if not fits:    # up and down again is two steps; a band on and off is both of its names
            fits = [i for i, h in enumerate(hidden)
                    if name == h['name'] == 'step' and h['form'] != 'one'
                    or name == 'sinusoid' and name in h['accept']
                    and _at_an_order(h, frequency, duration, rate)
                    or 'on_off' in h['form'] and name in h['accept'] and (name, i) not in called]
        # The name itself before an alias: a shared line may be called either way.
        fits.sort(key=lambda i: hidden[i]['name'] != name)
        out.append(fits[0] if fits else None)
        called.add((name, out[-1]))
        if fits and fits[0] in left:
            left.remove(fits[0])
    return out


def outcome(kind, verdict, found, hidden, matched):
    """Return right, wrong, unnamed, kin or missed; the module's docstring says what they mean."""
    names = [f[0] for f in found]
    if kind == 'nothing' or not hidden:
        return 'wrong' if names else 'right' if verdict == 'complete' else 'unnamed'
    if kind == 'outside':
        if not names:
            return {'complete': 'missed', 'refused': 'unnamed'}.get(verdict, 'right')
        return 'kin' if set(names) <= set(hidden[0]['kin']) else 'wrong'
    if kind == 'one':
        if not names:
            weak = hidden[0]['clear_here'] < 5 and verdict in ('complete', 'undecidable')
            return 'right' if weak else 'unnamed'
        return 'right' if names[0] in hidden[0]['accept'] else 'wrong'
    wanted = {i for i, h in enumerate(hidden) if h['clear_here'] >= h['bar']}
    if wanted <= set(matched) and None not in matched:
        return 'right'
    return 'wrong' if None in matched else 'unnamed'


def intervals(study, axis, truth):
    """Return for N, B and K: truth, interval, and whether the interval leaves the truth out."""
    out = {}
    for effect in study.get('targets', {}).get(axis, {}).get('effects', {}).values():
        for key in 'NBK':
            if isinstance(effect.get(key), dict) and effect[key].get('ci95'):
                low, high = effect[key]['ci95']
                true = truth['base'][axis][key]
                out[key] = {'truth': true, 'ci95': [low, high], 'value': effect[key].get('value'),
                            'excludes': not low <= true <= high}
    return out


def judge(job):
    """Make one record, run the command on it, and return one row per axis."""
    kind, seed, axes, keep, limit = job
    started = time.process_time()
    record = getattr(wild_mechanisms, kind)(seed)
    truth = record.truth
    if kind == 'nothing':
        axes = _with_accelerometer(record, axes)
    row = {'kind': kind, 'seed': seed, 'grade': truth['grade'], 'rate_hz': truth['rate_hz'],
           'samples': truth['samples'], 'fit': truth['fit']}
    with tempfile.TemporaryDirectory(prefix='wild_') as name:
        folder = pathlib.Path(name)
        np.savez(folder / 'record.npz', **record.arrays())
        if keep:
            np.savez(pathlib.Path(keep) / f'{kind}_{seed}.npz', **record.arrays())
        row['made_s'] = round(time.process_time() - started, 2)
        analyse = ['analyse', 'record.npz', '-o', 'study', '--axes', ','.join(axes), '--effects',
                   ','.join(truth['fit']), '--json']
        code, text, errors, cpu = run(analyse, folder, limit)
        if code == 1 and 'override with --keep-motion' in errors:   # of these it is known
            code, text, errors, more_cpu = run([*analyse, '--keep-motion'], folder, limit)
            row['kept_motion'], cpu = True, cpu + more_cpu
        stage, study, result = 'analyse', {}, {}
        if code == 0:
            study = _read(text)
            stage = 'diagnose'
            code, text, more, cpu2 = run(['diagnose', 'study', '--json'], folder, limit)
            errors, cpu = errors + more, cpu + cpu2
            result = _read(text).get('diagnosis', {}) if code == 0 else {}
    row['cpu_s'] = round(cpu, 2)
    if code != 0 or 'Traceback' in errors:
        row.update(failed=stage, code=code, stderr=errors[-3000:])
    rows = []
    for axis in axes:
        diagnosis = result.get(axis, {})
        hidden = [dict(h, clear_here=h['clear'][axis]) for h in truth['hidden']
                  if axis in h['clear']]
        for h in hidden:
            h['accept'] = sorted({*h['accept'], *_one_line(h)})
        found = named(diagnosis)
        matched = match(found, hidden, truth['duration_s'], truth['rate_hz'])
        verdict = diagnosis.get('verdict', 'refused' if code else 'absent')
        rows.append({
            **row, 'axis': axis, 'base': truth['base'][axis], 'hidden': [
                {k: h[k] for k in ('name', 'form', 'params', 'accept', 'kin', 'clear_here', 'bar')}
                | {'strength': h['strength'][axis],
                   'distinct': h.get('distinct')} for h in hidden],
            'clear': bool(hidden) and all(h['clear_here'] >= h['bar'] for h in hidden),
            'verdict': verdict, 'found': [[n, p] for n, p, _ in found], 'matched': matched,
            'ranked': [[f['effect'], f.get('probability'), f.get('against', '')]
                       for f in diagnosis.get('ranked', [])],
            'missed': [h['name'] for i, h in enumerate(hidden)
                       if i not in matched and h['clear_here'] >= h['bar']],
            'sufficient': diagnosis.get('sufficient'), 'remaining': diagnosis.get('remaining'),
            'judged': outcome(kind, verdict, found, hidden, matched),
            'coefficients': intervals(study, axis, truth)})
    return rows


def _with_accelerometer(record, axes):
    """Return the axes that a record with nothing hidden has; its truth then has them all."""
    for axis, values in zip(ACCEL, record.plan.bed.accel_base):
        record.truth['base'][axis] = dict(zip('NBK', map(float, values)))
    return [a for a in axes if a not in ACCEL or record.accel is not None]


def _read(text):
    try:
        return json.loads(text)
    except ValueError:
        return {}


# ---------------------------------------------------------------- the table

def wilson(hits, count):
    """Return a share with its 95 % Wilson interval, as words."""
    if not count:
        return '      -'
    p, z2 = hits / count, 1.96 ** 2
    centre = (p + z2 / (2 * count)) / (1 + z2 / count)
    half = 1.96 * np.sqrt(p * (1 - p) / count + z2 / (4 * count * count)) / (1 + z2 / count)
    return f'{hits:5d} / {count:<5d} {100 * p:5.1f} %  [{100 * (centre - half):5.1f}, ' \
           f'{100 * (centre + half):5.1f}]'


def _share(label, rows, hit):
    print(f'  {label:52s} {wilson(sum(map(hit, rows)), len(rows))}')


def table(rows):
    """Print shares by kind, forms, reliability of probabilities and coverage of intervals."""
    of = {kind: [r for r in rows if r['kind'] == kind] for kind in KINDS}
    print('shares (95 % Wilson)')
    none = [r for r in rows if not r['hidden']]
    _share('nothing hidden: complete', none, lambda r: r['verdict'] == 'complete')
    _share('nothing hidden: a name given', none, lambda r: r['judged'] == 'wrong')
    records = [list(some) for _, some in groupby(none, key=lambda r: (r['kind'], r['seed']))]
    _share('nothing hidden, six axes: complete', [r for r in records if len(r) == 6],
           lambda r: all(x['verdict'] == 'complete' for x in r))
    one = [r for r in of['one'] if r['hidden']]
    clear = [r for r in one if r['clear']]
    strong = [r for r in clear if r['hidden'][0]['strength'] >= 1]
    for word, some in (('clear', clear), ('clear and strength >= 1', strong), ('all', one)):
        _share(f'one, {word}: right first', some, lambda r: r['judged'] == 'right')
        _share(f'one, {word}: wrong name first', some, lambda r: r['judged'] == 'wrong')
    _share('one, clear: a name beside the truth', clear, lambda r: None in r['matched'])
    out = [r for r in of['outside'] if r['hidden']]
    far = [r for r in out if (r['hidden'][0]['distinct'] or 99) >= 36 and r['clear']]
    for word, some in (('distinct and clear', far), ('all', out)):
        _share(f'outside, {word}: wrong name', some, lambda r: r['judged'] == 'wrong')
        _share(f'outside, {word}: a kindred name', some, lambda r: r['judged'] == 'kin')
        _share(f'outside, {word}: called complete', some, lambda r: r['judged'] == 'missed')
    for kind in ('two', 'three', 'lines'):
        some = [r for r in of[kind] if r['hidden']]
        clear = [r for r in some if r['clear']]
        _share(f'{kind}, all clear: all found, nothing else', clear,
               lambda r: r['judged'] == 'right')
        _share(f'{kind}, all clear: all found', clear, lambda r: not r['missed'])
        _share(f'{kind}, all clear: first name right', clear,
               lambda r: bool(r['matched']) and r['matched'][0] is not None)
        _share(f'{kind}, all: a name beside the truth', some, lambda r: None in r['matched'])
    _forms([r for r in rows if r['kind'] in ('one', 'outside') and r['hidden']])
    print('\nreliability: probability stated, names given, share borne out')
    stated = [(p, m is not None) for r in rows if r['kind'] != 'outside'
              for (_, p), m in zip(r['found'], r['matched']) if p is not None]
    marks = [0, .5, .8, .9, .95, .99, .999, 1.0001]
    for low, high in zip(marks, marks[1:]):
        some = [ok for p, ok in stated if low <= p < high]
        mean = np.mean([p for p, _ in stated if low <= p < high]) if some else np.nan
        share = wilson(sum(some), len(some))
        print(f'  {low:5.3f} to {min(high, 1):5.3f}  mean {mean:6.4f}  {share}')
    torn = [r for r in rows if r['verdict'] == 'undecidable' and 'ranked' in r]
    _share('undecidable: a list stands', torn, lambda r: bool(r['ranked']))
    _share('undecidable: the truth is in the list', [r for r in torn if r['hidden']],
           lambda r: any(set(h['accept']) & {n for n, *_ in r['ranked']} for h in r['hidden']))
    print('\nintervals (95 %) that leave the truth out, under verdict complete')
    for word, some in (('nothing hidden', none), ('all kinds', rows)):
        for key in 'NBK':
            held = [r['coefficients'][key] for r in some
                    if r['verdict'] == 'complete' and key in r['coefficients']]
            _share(f'{word}: {key}', held, lambda c: c['excludes'])
    failed = [r for r in rows if 'failed' in r]
    cpu = [r['cpu_s'] for r in rows]
    print(f'\n{len(rows)} axes, CPU of the command: median {np.median(cpu):.1f} s, most'
          f' {max(cpu):.1f} s; refused or failed: {len(failed)}')
    for r in failed:
        last = (r['stderr'].strip().splitlines() or ['(no message)'])[-1]
        print(f"  {r['kind']} {r['seed']} {r['failed']} exit {r['code']}"
              f"{' TRACEBACK' if 'Traceback' in r['stderr'] else ''}: {last[:140]}")


def _forms(rows):
    print('\n  by form (clear ones)'.ljust(47), 'count right wrong unnamed other   first names')
    forms = {}
    for r in rows:
        if r['clear']:
            h = r['hidden'][0]
            word = h['name'] if h['name'].startswith('outside') else f"{h['name']}, {h['form']}"
            forms.setdefault(word, []).append(r)
    for form, some in sorted(forms.items()):
        judged = [r['judged'] for r in some]
        first = {}
        for r in some:
            name = r['found'][0][0] if r['found'] else r['verdict']
            first[name] = first.get(name, 0) + 1
        counts = [judged.count(w) for w in ('right', 'wrong', 'unnamed')]
        words = ', '.join(f'{k} {v}' for k, v in sorted(first.items(), key=lambda kv: -kv[1]))
        print(f'  {form:44s} {len(some):5d} {counts[0]:5d} {counts[1]:5d} {counts[2]:7d}'
              f' {len(some) - sum(counts):5d}   {words}')


def main():
    """Run records of one kind, or print the table of earlier runs."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0])
    parser.add_argument('--kind', default='one', help='of ' + ', '.join(KINDS) + ', or all')
    parser.add_argument('--count', type=int, default=10)
    parser.add_argument('--seed', type=int, default=0, help='the first seed')
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--axes', default='gyro_x', help='gyroscope axes, with commas; of nothing '
                        'hidden those of the accelerometer, too, or all')
    parser.add_argument('--limit', type=float, default=600, help='seconds for one process')
    parser.add_argument('--keep', help='a folder for the records')
    parser.add_argument('-o', '--output', default='wild.jsonl')
    parser.add_argument('--table', nargs='+', metavar='JSONL',
                        help='only print the table of these')
    args = parser.parse_args()
    if args.table:
        table([json.loads(line) for name in args.table for line in open(name)])
        return
    kinds = KINDS if args.kind == 'all' else args.kind.split(',')
    known = (*wild_mechanisms.AXES, *(ACCEL if kinds == ['nothing'] else ()))
    axes = list(known) if args.axes == 'all' else args.axes.split(',')
    if not set(axes) <= set(known):
        parser.error(f'axes are of {known}')
    if not set(kinds) <= set(KINDS):
        parser.error(f'kinds are of {KINDS}')
    always = [a for a in axes if a not in ACCEL] or axes    # not every record has the others
    if args.keep:
        pathlib.Path(args.keep).mkdir(parents=True, exist_ok=True)
    output = pathlib.Path(args.output)
    rows = [json.loads(line) for line in open(output)] if output.exists() else []
    done = {(r['kind'], r['seed'], r['axis']) for r in rows}
    jobs = [(kind, seed, axes, args.keep, args.limit) for kind in kinds
            for seed in range(args.seed, args.seed + args.count)
            if not all((kind, seed, axis) in done for axis in always)]
    with ProcessPoolExecutor(args.jobs) as pool, open(output, 'a') as out:
        for many in pool.map(judge, jobs):
            for r in many:
                rows.append(r)
                out.write(json.dumps(r) + '\n')
                out.flush()
                truth = ', '.join(f"{h['name']}/{h['form']} {h['clear_here']:.0f}"
                                  for h in r['hidden'])
                found = ', '.join(str(n) for n, _ in r['found'])
                print(f"{r['kind']} {r['seed']} {r['axis']}: {truth or 'nothing'} ->"
                      f" {r['verdict']} ({found or '-'}): {r['judged']}, {r['cpu_s']} s",
                      flush=True)
    print()
    table(rows)


if __name__ == '__main__':
    main()
