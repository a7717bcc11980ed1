# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""``compare diagnose add remove history effects export``: the loop over a study of any domain."""

from __future__ import annotations

import argparse
from typing import Any

from . import common, completion


def register(commands: Any) -> None:
    """Add the commands."""
    c = commands.add_parser(
        'compare', help='the model beside the measurement: where does it fail?'
    )
    c.add_argument('dir', metavar='DIR', help='a study')
    c.add_argument(
        'dir2', metavar='DIR2', nargs='?', help='a second study: what changed beyond chance'
    )
    sheet = c.add_argument('--sheet', metavar='SHEET.yaml',
                           help='a data sheet (a file, or the name of one that comes along): '
                                'which axes meet it?')
    completion.offer(sheet, completion.sheets)
    common.si_option(c)
    common.output_options(c, 'targets with their pulls')
    c.set_defaults(func=compare)

    c = commands.add_parser(
        'diagnose', help='which physical effect is missing, ranked, with the evidence'
    )
    c.add_argument('dir', metavar='DIR', help='a study')
    c.add_argument(
        '--bag',
        metavar='BAG',
        help='the recording, for effects of your own that look at the samples and were not given '
        'when it was analysed',
    )
    c.add_argument(
        '--until-complete',
        action='store_true',
        help='add the best and diagnose again until nothing is missing; what is done is kept: '
        'once stopped, the same command goes on from there',
    )
    _axis_option(c)
    c.add_argument('--jobs', type=int, metavar='N',
                   help='how many axes at once, each in a process of its own (default: one a '
                        'processor)')
    common.si_option(c)
    common.output_options(c, 'the diagnosis')
    c.set_defaults(func=diagnose)

    _register_changes(commands)
    c = commands.add_parser('history', help='the ladder of models tried, with the error of each')
    c.add_argument('dir', metavar='DIR', help='a study')
    common.output_options(c, 'the history')
    c.set_defaults(func=history)

    c = commands.add_parser('effects', help='what is known: equation, units, signature, reference')
    name = c.add_argument('name', metavar='NAME', nargs='?', help='one effect, or a domain')
    completion.offer(name, completion.effects_and_domains)
    common.output_options(c, 'names, parameters and units')
    c.set_defaults(func=effects)

    _register_export(commands)


def _register_changes(commands) -> None:
    """Add ``add`` and ``remove``."""
    c = commands.add_parser('add', help='put an effect into the model, refit')
    c.add_argument('dir', metavar='DIR', help='a study')
    effects = c.add_argument(
        'effects', metavar='EFFECT', nargs='*',
        help='names, for all axes or sensors but with --axis; none: the best of the diagnosis, '
             'where it finds something'
    )
    completion.offer(effects, completion.effects())
    c.add_argument('--all', action='store_true', help='all that was found, not the first')
    _change_options(c, add)

    c = commands.add_parser('remove', help='take an effect out of the model, refit')
    c.add_argument('dir', metavar='DIR', help='a study')
    label = c.add_argument('label', metavar='LABEL', help='as in study.yaml, e.g. sinusoid.2')
    completion.offer(label, completion.labels)
    _change_options(c, remove)


def _axis_option(c) -> None:
    """Add ``--axis``, which leaves all others as they are."""
    axis = c.add_argument(
        '--axis', '--axes', type=common.names, metavar='A,…', action='extend',
        help='only these axes, e.g. gyro_x,gyro_y'
    )
    completion.offer(axis, completion.axes, several=True)


def _change_options(c, func) -> None:
    """Add what is common to ``add`` and ``remove``."""
    _axis_option(c)
    common.si_option(c)
    common.output_options(c, 'the new rungs of the ladder and the targets')
    c.set_defaults(func=func)


def _register_export(commands) -> None:
    """Add ``export``."""
    c = commands.add_parser('export', help='the numbers in the file another program reads')
    c.add_argument('dir', metavar='DIR', nargs='?', help='a noise study, or a fleet')
    c.add_argument('--unit', metavar='U', help='of a fleet: this unit, beside what its model does')
    c.add_argument('--population', action='store_true',
                   help='of a fleet: for a unit never measured; covers 95 %% of units')
    c.add_argument('--model', metavar='M', help='of a fleet with several: with --population')
    c.add_argument('--list', action='store_true', help='the formats, a line on each')
    completion.offer(c.add_argument('--format', metavar='F', help='e.g. kalibr'),
                     completion.formats)
    c.add_argument(
        '--axes',
        default='worst',
        choices=('worst', 'mean', 'each'),
        help='one value over the axes (default: worst)',
    )
    c.add_argument(
        '--inflate',
        type=float,
        default=1.0,
        metavar='X',
        help='factor on all densities (default: 1)',
    )
    c.add_argument(
        '--horizon', type=float, metavar='S', help='cover model and data up to S seconds'
    )
    c.add_argument('--calibration', metavar='DIR', help='a calibration to go with it')
    c.add_argument('-o', '--output', metavar='FILE', help='-: standard output')
    c.add_argument('--force', action='store_true',
                   help='replace a file that is no earlier export of this format')
    common.output_options(c, 'the text of the file, or the formats')
    c.set_defaults(func=export)


def compare(args: argparse.Namespace) -> int:
    """Run ``compare``."""
    from .. import store
    from . import text
    from ..report import terminal

    common.load_own_effects(args)
    study = store.load(args.dir, intervals=bool(args.dir2 or args.sheet))
    if args.sheet:
        return _against(study, args)
    if args.dir2:
        other = store.load(args.dir2)
        from ..tasks import compare as tasks

        changes = tasks.compare_two(study, other)
        if args.json:
            common.print_json({'changes': changes, 'limit': tasks.limit(changes)})
        else:
            print(text.changes(changes, args.dir, args.dir2, args.si))
        return 0
    if args.json:
        common.print_json(
            {
                'targets': {
                    t: {
                        **store.target_to_dict(study, t)['error'],
                        'pulls': {
                            k: {'unit': v.unit, 'x': v.x, 'pull': v.pull}
                            for k, v in s.views.items()
                        },
                    }
                    for t, s in study.compare().items()
                }
            }
        )
    else:
        print(terminal.compare(study, verbose=args.verbose))
    return 0


def _against(study, args) -> int:
    """Compare a study with a data sheet."""
    from ..report.terminal import table
    from ..tasks import sheet

    rows = sheet.against(study, args.sheet)
    if args.json:
        common.print_json({'sheet': rows})
        return 0
    si = 'SI' if args.si else ''
    print(table([(r['target'], r['parameter'], r['measured_shown'], r['interval_shown'],
                  r['sheet_shown'], *([r['si']] if si else []), f'{r["ratio"]:.3g}', r['verdict'])
                 for r in rows],
                ('axis', '', 'measured', '95 %', 'sheet', *([si] if si else []), 'ratio',
                 'verdict')))
    return 0


def diagnose(args: argparse.Namespace) -> int:
    """Run ``diagnose``."""
    from .. import store
    from ..core.errors import UsageError
    from ..report import terminal
    from ..tasks import loop as tasks, noise, side_by_side

    if args.jobs is not None and args.jobs < 1:
        raise UsageError(f'invalid --jobs {args.jobs}', 'it must be one or more')
    common.load_own_effects(args)
    with common.progress_line(args) as progress:

        def work(study, keep):
            chosen = study.chosen(args.axis)
            if args.bag:
                noise.look_again(study, args.bag, progress)

            def told(target, step=None):
                said = terminal.verdict(study, target, args.verbose, args.si) if step is None \
                    else terminal.rung(step)
                common.say_at_once(said, progress)

            tell = None if args.json else told
            # with effects or evidence that are new, what was settled may be no longer
            settled = [t for t in study.settled if t in chosen] \
                if args.until_complete and not (args.bag or args.effects_from) else []
            if settled and tell:
                common.say_at_once(f'kept from before: {", ".join(settled)} (diagnose without '
                                   '--until-complete looks at them anew)', progress)
                for target in settled:
                    tell(target)
            return side_by_side.diagnose(
                study, [t for t in chosen if t not in settled],
                until_complete=args.until_complete, processes=args.jobs,
                progress=progress, told=tell, keep=keep)

        study, _ = tasks.change_by_steps(args.dir, work)
    if args.json:
        out = {'diagnosis': store.study_to_dict(study)['diagnosis']}
        if args.until_complete:
            out['history'] = store.study_to_dict(study)['history']
        common.print_json(out)
    else:
        if args.until_complete:
            some = study.chosen(args.axis)
            print(terminal.history(s for s in study.history if s.target in some))
        if after := terminal.after_diagnosis(study, args.dir):
            print(after)
    return 0


def _print_steps(args, study, steps):
    from .. import store
    from ..report import terminal

    if args.json:
        common.print_json(
            {
                'history': [store.step_to_dict(s) for s in steps],
                'targets': {s.target: store.target_to_dict(study, s.target) for s in steps},
            }
        )
    elif steps:
        print(terminal.steps(study, steps, si=args.si))
        _print_solved(args, study.domain, {s.target for s in steps})
    else:
        print('nothing is missing that the diagnosis can name: no effect added')


def _print_solved(args, domain, targets):
    from ..loop.domains import part

    if said := part('cli', domain).solved(args.dir, targets):
        print(said)


def add(args: argparse.Namespace) -> int:
    """Run ``add``."""
    from ..loop.effect import find_effect
    from .. import store
    from ..tasks import loop as tasks, side_by_side

    common.load_own_effects(args)
    for name in args.effects:
        find_effect(store.read(args.dir)['domain'], name)

    def work(study):
        steps = study.add(args.effects or None, args.axis, everything=args.all)
        side_by_side.diagnose(study, dict.fromkeys(s.target for s in steps))
        return steps

    study, steps = tasks.change(args.dir, work)
    _print_steps(args, study, steps)
    return 0


def remove(args: argparse.Namespace) -> int:
    """Run ``remove``."""
    from ..tasks import loop as tasks

    common.load_own_effects(args)
    study, steps = tasks.change(args.dir, lambda s: s.remove(args.label, args.axis))
    _print_steps(args, study, steps)
    return 0


def history(args: argparse.Namespace) -> int:
    """Run ``history``."""
    from .. import store
    from ..report import terminal

    data = store.read(args.dir)
    if args.json:
        common.print_json({'history': data.get('history') or []})
    else:
        print(terminal.history(store.history_of(data)))
        _print_solved(args, data['domain'], data['targets'])
    return 0


def effects(args: argparse.Namespace) -> int:
    """Run ``effects``."""
    from . import text
    from ..core.errors import unknown
    from ..loop.domains import DOMAINS
    from ..loop.effect import registry

    common.load_own_effects(args)
    domains = [args.name] if args.name in DOMAINS else list(DOMAINS)
    one = args.name if args.name not in DOMAINS else None
    found = [c for d in domains for c in registry(d).values() if one in (None, c.name)]
    if not found:
        raise unknown('effect', one, [*DOMAINS, *(n for d in DOMAINS for n in registry(d))])
    if args.json:
        common.print_json(
            {
                'effects': [
                    {
                        'name': c.name,
                        'domain': c.domain,
                        'title': c.title,
                        'equation': c.equation,
                        'signature': c.signature,
                        'hint': c.hint,
                        'reference': c.reference,
                        'parameters': [
                            {'name': p.name, 'title': p.title, **(
                                {'choices': p.choices} if p.choices
                                else {'unit': text.unit_of(p)})}
                            for p in c.parameters
                        ],
                    }
                    for c in found
                ]
            }
        )
    elif one:
        print('\n\n'.join(text.effect(c) for c in found))
    else:
        print(text.effects_table(found))
    return 0


def _list_formats(args, formats: dict[str, str]) -> int:
    """Print what the numbers can be written as."""
    from ..report.terminal import table

    if args.json:
        common.print_json({'formats': formats})
    else:
        print(table(list(formats.items()), ('format', 'what is written')))
    return 0


def _of_fleet(args):
    """Return the stated study of a unit of a fleet or of its population; None for no fleet."""
    from pathlib import Path

    from ..core.errors import UsageError

    if not (Path(args.dir) / 'fleet.json').is_file():
        if args.unit or args.population:
            raise UsageError('--unit and --population are for fleets',
                             'name a folder that fleet wrote')
        return None
    from ..fleet import export as fleets

    if bool(args.unit) == args.population:
        raise UsageError(f'{args.dir}: a fleet', 'choose --unit U or --population')
    if args.population:
        return fleets.population_study(args.dir, args.model)
    return fleets.unit_study(args.dir, args.unit)


def export(args: argparse.Namespace) -> int:
    """Run ``export``."""
    from .. import export as exports, store
    from ..core.errors import InputError, unknown, UsageError
    from ..loop.domains import package

    if args.list:
        return _list_formats(args, exports.descriptions())
    missing = [name for name, given in (
        ('DIR', args.dir), ('--format', args.format), ('-o', args.output)) if given is None]
    if missing:
        raise UsageError(f'export needs {" and ".join(missing)}',
                         'e.g. export DIR --format kalibr -o FILE; --list shows the formats')
    common.load_own_effects(args)
    if args.format not in exports.formats():
        raise unknown('format', args.format, exports.formats())
    if not args.inflate > 0:
        raise UsageError(f'invalid --inflate {args.inflate:g}', 'it must be above zero')
    if args.horizon is not None and not args.horizon > 0:
        raise UsageError(f'invalid --horizon {args.horizon:g}', 'it must be above zero (seconds)')
    study = _of_fleet(args) or store.load(args.dir)
    if not package(study.domain).NUMBERS:
        raise InputError(
            f'{args.dir}: a {study.domain} study has no noise densities',
            'name the study that analyse wrote',
        )
    content = exports.export(
        study,
        args.format,
        axes=args.axes,
        inflate=args.inflate,
        horizon=args.horizon,
        calibration=args.calibration,
    )
    if args.output != '-':
        exports.write(args.output, content, args.force)
    if args.json:
        common.print_json({'format': args.format, 'output': args.output, 'text': content})
    elif args.output == '-':
        print(content, end='')
    else:
        print(f'written to {args.output}')
    return 0
