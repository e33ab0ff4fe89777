"""A policy replayed on the signals of a trace: what it observes, does and targets there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.policy.action import next_target
from humanoid_getup.policy.foreign.record import FOREIGN_KEY, ForeignRecord, Window, from_record
from humanoid_getup.policy.golden.trace import GoldenTrace
from humanoid_getup.policy.observation import Sensed, observe
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots.quaternion import Array


@dataclass(frozen=True)
class ObservedPart:
    """A named part of an observation: the newest entries of a term."""

    name: str
    quantity: str
    whole: slice
    """Where the observation holds it, with its history."""
    newest: slice
    """Where the observation holds its newest entries."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ReplayedStep:
    """What a policy observes and does in T steps."""

    observation: Array
    """(T, size)"""
    action: Array
    """What the network returns, (T, k)."""
    share: Array
    """Numbers of our action space, (T, k)."""


def find_record(policy: OnnxPolicy) -> ForeignRecord | None:
    """Find the layout of an imported policy; ``None`` for one of our own.

    Raises:
        ForeignPolicyError: if it is malformed.
    """
    text = policy.metadata.get(FOREIGN_KEY)
    return from_record(text) if text else None


class ReplayedPolicy:
    """Replays a policy on a trace; each step begins where the trace was, not where it is itself."""

    def __init__(self, policy: OnnxPolicy, trace: GoldenTrace) -> None:
        """Take a policy and a trace whose joints are in the robot's order."""
        self.policy, self.trace, self.robot = policy, trace, policy.robot
        self.record = find_record(policy)
        """Layout of an imported policy; ``None`` for one of our own."""

    @property
    def size(self) -> int:
        """Return the size of the network's observation."""
        return self.parts[-1].whole.stop

    @property
    def parts(self) -> list[ObservedPart]:
        """Return the parts of the network's observation."""
        if self.record is not None:
            return list(_divide(self.record.windows))
        terms = self.policy.contract.observation
        return list(
            _divide([Window(name=t.name, quantity=t.name, size=t.size, history=1) for t in terms])
        )

    @property
    def signals(self) -> Sensed:
        """Return what the robot measured in the trace."""
        trace = self.trace
        return Sensed(
            gravity=trace.gravity,
            gyro=trace.gyro,
            joint_pos=trace.joint_pos,
            joint_vel=trace.joint_vel,
        )

    def step(self, signals: Sensed) -> ReplayedStep:
        """Observe signals, (T, ...), and act on them."""
        seen = observe(
            self.robot, signals, self.last_target(), self._memory(), self._torque_share()
        )
        share, memory = self.policy.act(seen)
        if self.record is None:
            return ReplayedStep(observation=seen.astype(float), action=share, share=share)
        k = len(self.record.moved)
        return ReplayedStep(
            observation=memory[:, 1 + k :], action=memory[:, 1 : 1 + k], share=share
        )

    def aim(self, share: Array, *, unlimited: bool = False) -> Array:
        """Compute the targets of actions in our action space, (T, n) [rad].

        Unlimited ones are not bound by the speed of the servos.
        """
        action, trace = self.policy.action, self.trace
        if unlimited:
            action = replace(action, reach=np.full(self.robot.n, np.inf))
        return next_target(
            self.robot, action, self.last_target(), trace.joint_pos, trace.gravity, share
        )

    def start(self) -> Array:
        """Return the targets that servos have at the beginning of each step, (T, n) [rad]."""
        if self.trace.sent is not None:
            return self.trace.sent
        assert self.trace.target is not None
        return self.trace.target

    def state(self) -> tuple[Array, Array]:
        """Return true joint angles and speeds, as far as they are known, (T, n) each."""
        trace = self.trace
        angle = trace.joint_pos if trace.true_joint_pos is None else trace.true_joint_pos
        return angle, trace.joint_vel if trace.true_joint_vel is None else trace.true_joint_vel

    def last_target(self) -> Array:
        """Return the target at which each step begins: at first the measured angles."""
        trace = self.trace
        if trace.target is None:
            return trace.joint_pos
        return np.concatenate((trace.joint_pos[:1], trace.target[:-1]))

    def _memory(self) -> Array:
        """Return what the network remembers at each step, from the trace."""
        before = _delay(self.trace.action)
        if self.record is None:
            return np.clip(before, -1.0, 1.0)
        begun = (np.arange(len(self.trace)) > 0).astype(float)[:, None]
        return np.concatenate((begun, before, _delay(self.trace.observation)), axis=1)

    def _torque_share(self) -> Array:
        return np.broadcast_to(self.policy.torque_share, (len(self.trace), 1))


def _delay(values: Array) -> Array:
    """Return the values of the step before; zeros at first."""
    return np.concatenate((np.zeros_like(values[:1]), values[:-1]))


def _divide(windows: list[Window] | tuple[Window, ...]) -> Iterator[ObservedPart]:
    start = 0
    for window in windows:
        end = start + window.length
        yield ObservedPart(
            window.name, window.quantity, slice(start, end), slice(end - window.size, end)
        )
        start = end
