# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The loop as services, the same for every node: compare, diagnose, add_best, remove_last ..."""

from __future__ import annotations

from collections.abc import Callable
import traceback
from typing import Any

from std_srvs.srv import Trigger

from . import messages
from .answers import brief
from .run import ending, under_way
from ..core.errors import ImuNoiseError
from ..loop.study import Study
from ..store import diagnosis_to_dict, step_to_dict

MORE = 'every candidate: record a bag; imu_noise {command} BAG, imu_noise diagnose STUDY --json'


def guarded(node: Any, work: Callable[[], dict | None]) -> tuple[dict, bool]:
    """
    Return what work returns, and whether it succeeded.

    An ImuNoiseError is a refusal, with its remedy. Any other exception is a defect: it is logged,
    and must not take the node and what it has gathered along.

    """
    try:
        with under_way():
            return work() or {}, True
    except ImuNoiseError as error:
        return {'error': error.message, 'remedy': error.remedy}, False
    except Exception as error:
        if ending():        # its publishers go while it works: that is no defect
            return {'error': 'the node ends', 'remedy': 'start it again'}, False
        node.get_logger().error(traceback.format_exc())
        return {'error': f'{type(error).__name__}: {error}'}, False


def serve(node: Any, name: str, work: Callable[[], dict], group: Any = None) -> None:
    """Offer a Trigger ``~/name`` that answers when the work is done: success, and YAML."""
    def call(_, response):
        return messages.answer(response, *guarded(node, work))
    node.create_service(Trigger, f'~/{name}', call, callback_group=group)


class Loop:
    """
    The services of the loop over one study.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose they are.
    study : callable
        Returns the study, or raises an ImuNoiseError that says what must come first.
    changed : callable
        Called with the study when its models or its diagnosis have changed.
    fresh : callable or None
        Returns the study that is diagnosed, where that is not the one at hand.
    compute : callable or None
        Called as compute(function, ...) where the work is to be done elsewhere.
    more : str
        Where the candidates are that a diagnosis answers without.
    group : rclpy.callback_groups.CallbackGroup
        Of the services, so that data go on arriving while they work.

    """

    def __init__(self, node, study: Callable[[], Study], changed: Callable[[Study], None],
                 group=None, fresh: Callable[[], Study] | None = None, compute=None,
                 more: str = ''):
        self._more = more
        self._study, self._changed, self._fresh = study, changed, fresh or study
        self._compute = compute or (lambda function, *args: function(*args))
        for name in ('compare', 'diagnose', 'add_best', 'remove_last', 'history'):
            serve(node, name, getattr(self, name), group)

    def compare(self) -> dict:
        """Return, for each target, the held-out deviance, in all and by view."""
        study = self._study()
        return {'targets': {t: {
            'effects': study.states[t].model.labels, 'held_out': s.excess, 'held_out_std': s.std,
            'within_chance': s.within_chance, 'views': {k: v.excess for k, v in s.views.items()}}
            for t, s in study.compare().items()}}

    def diagnose(self) -> dict:
        """Find out what is missing; return what is found of each target, and rivals."""
        study = self._fresh()
        found = self._done(study, 'diagnose')
        self._changed(study)
        return {'diagnosis': {t: brief(diagnosis_to_dict(t, d)) for t, d in found.items()},
                'more': self._more}

    def add_best(self) -> dict:
        """Put what the diagnosis names into the model; nothing missing is a success, too."""
        return {'added': self._steps('add')}

    def remove_last(self) -> dict:
        """Take out what was added last."""
        return {'removed': self._steps('undo')}

    def history(self) -> dict:
        """Return the ladder."""
        return {'history': [step_to_dict(s) for s in self._study().history]}

    def _steps(self, what: str) -> list[dict]:
        """Change the models of the study; return the new rungs of the ladder."""
        study = self._study()
        steps = self._done(study, what)
        if steps:
            self._changed(study)
        return [step_to_dict(s) for s in steps]

    def _done(self, study: Study, what: str):
        """Return what a method of the study returns; the study is changed wherever it is done."""
        answer, after = self._compute(_do, study, what)
        vars(study).update(vars(after))
        return answer


def _do(study: Study, what: str):
    return getattr(study, what)(), study
