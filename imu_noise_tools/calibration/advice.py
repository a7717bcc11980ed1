# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What to do next about a calibration, in words."""

from __future__ import annotations

from typing import Any, TYPE_CHECKING

import numpy as np

from . import flexible, solve, telling
from .effects import Regressor, Scatter
from ..core.errors import degrees_of_freedom, FitError
from ..loop.effect import Fit, registry
from ..loop.findings import rivals
from ..loop.verdict import SURE

if TYPE_CHECKING:
    from .problem import CalibrationProblem

HIDES = 'hides in '
_OF_INPUT = ('hold the same poses again in another order to see it repeat, and describe it as an '
             'effect of your own')
_FOLLOWED = {'direction': _OF_INPUT, 'own': _OF_INPUT,
             'time': 'record the temperature along, let it warm up before the first pose, and '
                     'hold the first faces again at the end'}


def advise(problem: CalibrationProblem, verdict: str, ranked: list[Any]) -> str:
    """Return one sentence: what to do next, and which poses would tell what these cannot."""
    if verdict == 'missing':
        doubt = _doubt(problem, ranked)
        return f'add {ranked[0].name}: {ranked[0].effect.hint}{"; " * bool(doubt)}{doubt}'
    if verdict == 'undecidable':
        return _undecided(problem, rivals(ranked))
    if verdict == 'unknown':
        course = problem.refuting({f.name for f in ranked if isinstance(f.effect, Scatter)
                                   and f.against})
        if course is not None:
            return (f'no known effect explains it, but {course.followed(problem.target)} and no '
                    f'scatter: {_FOLLOWED[course.of]}; until then intervals are too narrow')
        return 'look at the poses that fail, and hold them again'
    hidden = problem.blind(problem.fit(solve.base_model()))
    said = 'nothing is missing' + (
        f'; these poses could not show {", ".join(name for name, _, _ in hidden)}'
        if hidden else '')
    only = [f'{name} hides in {why.removeprefix(HIDES)}' for name, why, _ in hidden
            if why.startswith(HIDES)]
    return '; '.join([said, *([f'the values hold only without these: {", ".join(only)}']
                              if only else [])])


def _undecided(problem: CalibrationProblem, some: list[Any]) -> str:
    """Say what would tell some from each other."""
    names = [f.name for f in some]
    needs = dict.fromkeys(f.effect.needs for f in some if f.effect.needs)
    left = problem.fit(solve.base_model()).details.dof
    if sum(len(f.estimates) >= left for f in some) > 1:
        return (f'{problem.poses.n} poses leave {degrees_of_freedom(left)}, which '
                f'any of {", ".join(names)} explains: hold more poses, in other directions')
    said = f'{names[0]} fits, but poses left out do not confirm it' if len(names) < 2 else \
        (f'these poses cannot tell {names[0]} from {names[1]}' if len(names) == 2 else
         f'these poses cannot tell {", ".join(names[:-1])} and {names[-1]} apart')
    kinds = [f.name for f in some if isinstance(f.effect, Regressor)]
    return '; '.join(filter(None, (
        said, _to_record(problem, kinds, list(needs)), _unsettled(problem, kinds))))


def _to_record(problem: CalibrationProblem, names: list[str], needs: list[str]) -> str:
    """Say which poses would tell rivals apart; those that are held already may not."""
    plain = f'record {"; or ".join(needs)}' if needs else ''
    kinds = [k for k in map(registry('calibration').get, names)
             if k is not None and issubclass(k, Regressor) and k.shaped]
    if len(names) != 2 or len(kinds) != 2 or problem.target != 'accel':
        return plain
    one, other = (problem.fit(solve.base_model() + k()) for k in kinds)
    where, count = telling.advised(one, other, problem.poses, problem.method)
    if not count:
        return (f'no {telling.MOST} poses by hand would tell them apart at this noise: hold '
                f'each longer')
    if where.startswith('edges'):
        return plain
    return (f'record some {count} more poses in {where}, where the two differ most: those '
            f'that are held already hardly tell them')


def _unsettled(problem: CalibrationProblem, names: list[str]) -> str:
    """Say how far the values of the base move with each rival, so that intervals miss."""
    base = problem.fit(solve.base_model()).details
    moved: dict[str, Any] = {}
    for name in names:
        effect = registry('calibration')[name]()
        try:
            moved[name] = problem.fit(solve.base_model() + effect).details
        except FitError:
            continue
    if not moved:
        return ''

    def far(one: Any, other: Any) -> str:
        return (f'bias by up to {np.abs(one.bias - other.bias).max():.2g} {problem.unit} and '
                f'scale and cross-axis terms by up to '
                f'{1e6 * np.abs(one.scale - other.scale).max():.0f} ppm')

    said = [f'add {k} moves {far(d, base)}' for k, d in moved.items()]
    return ('intervals do not hold until it is decided: ' + ', '.join(said)
            + (': either mends most of it' if _alike(base, [*moved.values()]) else ''))


def _alike(base: Any, some: list[Any]) -> bool:
    """Tell whether fits differ among each other by less than half of what they move."""
    if len(some) < 2:
        return False
    moved = min(np.abs(d.bias - base.bias).max() for d in some)
    apart = max(np.abs(d.bias - some[0].bias).max() for d in some[1:])
    return bool(apart < 0.5 * moved)


def _doubt(problem: CalibrationProblem, ranked: list[Any]) -> str:
    """Say what these poses cannot tell of a scatter that is found."""
    found = [f for f in ranked if not f.against and (f.probability or 0.0) >= SURE]
    model = solve.base_model()
    for f in found:
        model = model + type(f.effect)()
    some = [f.name for f in found if isinstance(f.effect, Scatter)]
    fit = problem.fit(model)
    return '; '.join(filter(None, (scatter_in_words(problem, fit, k) for k in some)))


def scatter_in_words(problem: CalibrationProblem, fit: Fit, label: str) -> str:
    """Say what of a scatter follows direction or time, and which of the two is not told."""
    effect = fit.model[label]
    if not isinstance(effect, Scatter) or effect.tilts:
        return ''
    course = problem.course(fit, label)
    if course is not None and course.chance <= flexible.RARE:
        return f'{course.followed(problem.target)} by {100 * course.share:.0f} %'
    told = course.told if course is not None else {'direction': 0.0, 'time': 0.0}
    open_ = [{'direction': 'function of direction', 'time': 'course in time'}[k]
             for k, v in told.items() if v < SURE]
    said = [f'{problem.poses.n} poses are too few to tell it from a {" or a ".join(open_)}'
            ] if open_ else []
    if course is not None and course.chance < flexible.DOUBTED:
        followed = course.followed(problem.target).replace('is', 'may be')
        said.append(f'{followed}: scatter looks as much like one in '
                    f'{100 * course.chance:.2g} % of cases')
    return '; '.join(said)
