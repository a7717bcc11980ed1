# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Quality of service, and the Imu subscription that every working node has."""

from __future__ import annotations

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.qos import (DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile,
                       ReliabilityPolicy)
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu

from ..core.errors import InputError

_KIND = 'sensor_msgs/msg/Imu'
_QUIET_S = 5            # nodes find each other in less, on a busy machine too
_AT_ONCE = 1000         # messages taken in one callback at the most, so that timers get their turn
# A timer of this clock goes on while simulated time stands still.
STEADY = Clock(clock_type=ClockType.STEADY_TIME)


def result() -> QoSProfile:
    """Return the profile of results: a late viewer gets the last one."""
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


def complete(reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE) -> QoSProfile:
    """Return the profile of what must not be lost: a full reader holds its writer back."""
    return QoSProfile(depth=1000, history=HistoryPolicy.KEEP_ALL, reliability=reliability)


def live(reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE) -> QoSProfile:
    """Return the profile of what must be recent: five seconds at 1 kHz, then the oldest goes."""
    return QoSProfile(depth=5000, reliability=reliability)


def overridable(*but: QoSPolicyKind) -> QoSOverridingOptions:
    """Return options that let parameters change depth, history and reliability (``but`` some)."""
    kinds = (QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY)
    return QoSOverridingOptions([k for k in kinds if k not in but])


class ImuInput:
    """
    A subscription to ``imu/data_raw`` that hands over messages as bytes.

    It is reliable, and best-effort as soon as a publisher is (a reliable reader gets nothing from
    such), unless ``qos_overrides.<topic>.subscription.reliability`` says which. A topic on which
    nothing comes is spoken of after some seconds, and again when there is another reason.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose it is.
    take : callable
        Called with a list of serialised messages: all that have come, or one where not ``drain``.
    profile : callable
        :func:`complete` or :func:`live`.
    topic : str
        Its name, where it is another.
    drain : bool
        Empty the reader in one callback, which makes the multi-threaded executor some fifty times
        faster. (The events executor counts what it announced: never drain behind its back.)

    """

    def __init__(self, node, take, profile=complete, drain=True, topic='imu/data_raw'):
        self._node, self._take, self._profile = node, take, profile
        self._callback = self._drain if drain else self._one
        self._name, self._heard, self._quiet, self._told = topic, False, 0, ''
        self._mixed = 0
        self.topic = node.resolve_topic_name(topic)
        self._group = MutuallyExclusiveCallbackGroup()
        self.best_effort = False
        name = f'qos_overrides.{self.topic}.subscription.reliability'
        self._automatic = node.declare_parameter(name, 'automatic', ParameterDescriptor(
            description='reliable, best_effort, or automatic: as the publishers are',
            read_only=True)).value == 'automatic'
        self._options = overridable(*(QoSPolicyKind.RELIABILITY,) * self._automatic)
        self._subscription = self._subscribe()
        node.create_timer(1.0, self._look, callback_group=self._group, clock=STEADY)

    def _subscribe(self):
        """Subscribe as the publishers allow."""
        wanted = ReliabilityPolicy.BEST_EFFORT if self.best_effort else ReliabilityPolicy.RELIABLE
        return self._node.create_subscription(
            Imu, self.topic, self._callback, self._profile(wanted), raw=True,
            callback_group=self._group, qos_overriding_options=self._options)

    def _look(self) -> None:
        """Follow the publishers, and say why nothing comes."""
        if self._automatic:
            self._match()
        self._count()
        self._quiet += 1
        if self._quiet >= _QUIET_S and (why := self.silence()) and why.message != self._told:
            self._told = why.message
            self._node.get_logger().warning(str(why))

    def _sources(self) -> list[str]:
        return [f'{p.node_namespace.rstrip("/")}/{p.node_name}'
                for p in self._node.get_publishers_info_by_topic(self.topic)
                if p.topic_type == _KIND]

    @property
    def several(self) -> bool:
        """Whether more than one publishes, or did a moment ago."""
        return len(self._sources()) > 1

    def _count(self) -> None:
        """Say once where several publish for some seconds: one that died stays known a while."""
        sources = self._sources()
        self._mixed = self._mixed + 1 if len(sources) > 1 else 0
        if self._mixed == _QUIET_S:
            self._node.get_logger().warning(
                f'{len(sources)} publish on {self.topic} ({", ".join(sorted(sources))}): their '
                'samples come mixed; give each IMU a topic of its own')

    def silence(self) -> InputError | None:
        """Return why nothing was ever received, by who publishes; None where something was."""
        if self._heard:
            return None
        kinds = {p.topic_type for p in self._node.get_publishers_info_by_topic(self.topic)}
        if _KIND in kinds:
            return InputError(f'nothing was received yet: who publishes on {self.topic} is silent',
                              'start the sensor, or play a bag')
        others = self._others()
        remedy = f'remap {self._name} to {" or ".join(others)}' if others else (
            f'publish on {self.topic}, play a bag, or remap {self._name}')
        if kinds:
            return InputError(f'nothing was received yet: {self.topic} has the type '
                              f'{", ".join(sorted(kinds))}, not {_KIND}', remedy)
        return InputError(f'nothing was received yet: nobody publishes on {self.topic}', remedy)

    def _others(self) -> list[str]:
        """Return the Imu topics on which others publish that do not wait for this one too."""
        node = self._node
        waiting = {(s.node_namespace, s.node_name)
                   for s in node.get_subscriptions_info_by_topic(self.topic)}
        return [t for t, kinds in node.get_topic_names_and_types()
                if _KIND in kinds and t != self.topic and any(
                    p.topic_type == _KIND and (p.node_namespace, p.node_name) not in waiting
                    for p in node.get_publishers_info_by_topic(t))]

    def _match(self) -> None:
        """Go over to best effort where a publisher is, and back when none is left."""
        kinds = {p.qos_profile.reliability
                 for p in self._node.get_publishers_info_by_topic(self.topic)}
        best_effort = ReliabilityPolicy.BEST_EFFORT in kinds
        if kinds and best_effort != self.best_effort:
            self.best_effort = best_effort
            kind = 'best-effort' if best_effort else 'reliable'
            self._node.get_logger().info(f'{self.topic}: {kind}, as its publisher is')
            self._node.destroy_subscription(self._subscription)
            self._subscription = self._subscribe()

    def _one(self, raw: bytes) -> None:
        """Take this message."""
        self._heard = True
        self._take([raw])

    def _drain(self, raw: bytes) -> None:
        """Take this message and all that wait behind it."""
        self._heard = True
        batch, handle = [raw], self._subscription.handle
        with handle:
            while len(batch) < _AT_ONCE:
                taken = handle.take_message(Imu, True)
                if taken is None:
                    break
                batch.append(taken[0])
        self._take(batch)
