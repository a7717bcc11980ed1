# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters declared once: meaning, unit, range. A bad value is refused with the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from difflib import get_close_matches
import math
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult

from ..core.errors import ImuNoiseError


@dataclass(frozen=True)
class Setting:
    """
    One parameter of a node; the type is the default's: float, int, bool, str or list of str.

    ``low`` and ``high`` are allowed values. ``check`` takes a value and raises an ImuNoiseError
    where it will not do. A ``fixed`` one cannot be set while the node runs; a number that is
    ``optional`` may be NaN: not given.

    """

    name: str
    default: Any
    text: str
    unit: str = ''
    low: float = -math.inf
    high: float = math.inf
    choices: tuple[str, ...] = ()
    check: Callable[[Any], Any] | None = None
    fixed: bool = False
    optional: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows."""
        constraints = ['not while it runs'] if self.fixed else []
        if self.choices:
            constraints.append(f'one of {", ".join(self.choices)}')
        answer = ParameterDescriptor(
            name=self.name, description=f'{self.text} [{self.unit}]' if self.unit else self.text,
            additional_constraints='; '.join(constraints), read_only=self.fixed,
            # so that `speed:=10` is taken for 10.0, and one name for a list of one
            dynamic_typing=isinstance(self.default, (float, list)))
        bounded = isinstance(self.default, float) and math.isfinite(self.high - self.low)
        if bounded and not self.optional:
            answer.floating_point_range = [
                FloatingPointRange(from_value=float(self.low), to_value=float(self.high))]
        return answer

    def convert(self, value: Any) -> Any:
        """Return a value in the type of the default, or raise ValueError with the reason."""
        if isinstance(self.default, list):
            if isinstance(value, str):
                value = value.split(',')
            if not isinstance(value, (list, tuple)) or not all(isinstance(v, str) for v in value):
                raise ValueError(f'{self.name} takes a list of names, not {value!r}')
            return [v.strip() for v in value if v.strip()]
        if isinstance(self.default, float):
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise ValueError(f'{self.name} takes a number, not {value!r}')
            return float(value)
        return value

    def read(self, value: Any) -> Any:
        """Return a value converted and checked, or raise ValueError with the reason."""
        value = self.convert(value)
        if self.optional and value != value:
            return value
        if isinstance(value, (int, float)) and not self.low <= value <= self.high:
            raise ValueError(
                f'{self.name} = {value:g} is not between {self.low:g} and {self.high:g}')
        if self.choices and value not in self.choices:
            raise ValueError(f'{self.name} = {value!r} is not one of {", ".join(self.choices)}')
        if self.check:
            try:
                self.check(value)
            except ImuNoiseError as error:
                raise ValueError(str(error)) from error
        return value


class Settings:
    """
    The parameters of one node, read as ``settings['speed']``.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose they are.
    settings : Setting
        All of them; they are declared here.

    ``together``, once set, is called with all values before new ones are accepted, and may raise
    an ImuNoiseError; ``changed``, once set, is called with names and values after they have been.

    """

    def __init__(self, node, *settings: Setting):
        self._node = node
        self._settings = {s.name: s for s in settings}
        self.together: Callable[[dict], Any] | None = None
        self.changed: Callable[[dict], None] | None = None
        node.add_on_set_parameters_callback(self._validate)
        node.add_post_set_parameters_callback(self._act)
        node.declare_parameters('', [(s.name, s.default, s.descriptor()) for s in settings])

    def __getitem__(self, name: str) -> Any:
        """Return the value of one."""
        return self._settings[name].convert(self._node.get_parameter(name).value)

    def _validate(self, parameters) -> SetParametersResult:
        """Refuse what will not do (before anything is set), saying why."""
        try:
            new = {p.name: self._settings[p.name].read(p.value)
                   for p in parameters if p.name in self._settings}
            if new and self.together:
                self.together({**{name: self[name] for name in self._settings}, **new})
        except (ValueError, ImuNoiseError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _act(self, parameters) -> None:
        """Tell the node (after everything is set)."""
        ours = {p.name: self[p.name] for p in parameters if p.name in self._settings}
        if ours and self.changed:
            self.changed(ours)


def not_heeded(node: Any) -> list[str]:
    """Return a sentence on each parameter given at the start that a node does not have."""
    # rclpy passes such ones over without a word, and has no public name for what was given.
    given = getattr(node, '_parameter_overrides', {})
    unknown = sorted(name for name in given if not node.has_parameter(name)
                     and not name.startswith('qos_overrides.'))
    said = []
    for name in unknown:
        near = get_close_matches(name, list(node.get_parameters_by_prefix('')), 1)
        said.append(f'there is no parameter {name}: it is not heeded'
                    + (f' (did you mean {near[0]}?)' if near else ''))
    return said
