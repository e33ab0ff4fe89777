"""The safety guard: nothing beyond a limit reaches a servo, nothing is cut in silence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from drivers.backend import Backend, ClosesItself
from drivers.guard_limits import ClipCounts, GuardLimits
from drivers.state import Command, State
from robots import Robot
from robots.rotation import Array


class FaultKind(Enum):
    """Why the guard took the torque away."""

    BAD_COMMAND = "the command holds values that no servo can follow"
    BAD_MEASUREMENT = "the measurement holds values that are no numbers"
    STALE_DATA = "the measurement does not change its time any more"
    TOO_HOT = "a servo is too hot"


@dataclass(frozen=True)
class Fault:
    """Why and when the guard took the torque away."""

    kind: FaultKind
    detail: str
    time: float
    """Time of the newest measurement [s]."""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.detail}"


class SafetyGuard(ClosesItself):
    """A backend around a backend that keeps every command within its limits.

    The laws, for each joint of each command that it lets through. The *reference* is the
    last target sent, or the measured angle where the joint was limp:

    - The target never lies beyond the joint's range, or beyond a reference that already
      does: a joint outside may stay or come back, never go further out.
    - The target never moves further from the reference than top speed times the period.
    - The torque limit lies between 0 and the guard's own, the gain share between 0 and 1.

    A position servo makes force by having its target beyond its angle, so the distance
    from target to angle is free. What is cut is counted in ``clips``. Commands that cannot
    be understood, measurements that are no numbers or that stand still, and heat are
    faults: the robot goes limp and stays limp until ``clear`` or the next ``connect``.
    A joint that a command releases is told its measured angle; torque comes back from
    there, so it never returns with a jerk.
    """

    def __init__(self, backend: Backend, limits: GuardLimits | None = None) -> None:
        self._backend = backend
        self.limits = GuardLimits.of(backend.robot) if limits is None else limits
        self._reach = self.limits.max_velocity * backend.period
        self._counts = np.zeros((4, backend.robot.n), dtype=int)
        self._is_open = False
        self._forget()

    def _forget(self) -> None:
        self._fault: Fault | None = None
        self._state: State | None = None
        self._judged_time = -np.inf
        self._stale_writes = 0
        self._sent = Command.limp(self._backend.robot.n)

    @property
    def robot(self) -> Robot:
        """Return the robot behind the guard."""
        return self._backend.robot

    @property
    def period(self) -> float:
        """Return the control period [s]."""
        return self._backend.period

    @property
    def fault(self) -> Fault | None:
        """Return why the robot was made limp, ``None`` while all is well."""
        return self._fault

    @property
    def clips(self) -> ClipCounts:
        """Return how often each joint's command was cut since ``connect``."""
        return ClipCounts(*self._counts.copy())

    def connect(self) -> None:
        """Open the backend, with no fault and no clips; an open one goes limp first."""
        if self._is_open:
            self._backend.write(Command.limp(self.robot.n))
        self._forget()
        self._counts[:] = 0
        self._backend.connect()
        self._is_open = True

    def close(self) -> None:
        """Release every joint and the devices."""
        self._is_open = False
        self._backend.close()

    def clear(self) -> None:
        """Forget a fault; the next command starts from the measured angles.

        Without a fault there is nothing to forget, least of all the last target.
        """
        if self._fault is not None:
            self._forget()

    def read(self) -> State:
        """Measure the robot."""
        self._state = self._backend.read()
        return self._state

    def write(self, command: Command) -> Command:
        """Send what the limits leave of a command, or go limp; return what was sent."""
        state = self.read() if self._state is None else self._state
        if self._fault is None:
            self._fault = self._find_fault(command, state)
        allowed = Command.limp(self.robot.n) if self._fault else self._limit(command, state)
        self._sent = self._backend.write(allowed)
        return self._sent

    def _find_fault(self, command: Command, state: State) -> Fault | None:
        self._stale_writes = 0 if state.time > self._judged_time else self._stale_writes + 1
        self._judged_time = state.time
        names, limits = self.robot.joint_names, self.limits
        if not state.is_finite:
            return Fault(FaultKind.BAD_MEASUREMENT, _name_bad_joints(state, names), state.time)
        if self._stale_writes >= limits.stale_writes:
            detail = f"{self._stale_writes} commands since {state.time:.3f} s"
            return Fault(FaultKind.STALE_DATA, detail, state.time)
        if faults := limits.find_command_faults(command, names):
            return Fault(FaultKind.BAD_COMMAND, "; ".join(faults), state.time)
        if state.temperature.max() > limits.max_temperature:
            hottest = int(state.temperature.argmax())
            detail = (
                f"joint '{names[hottest]}' has {state.temperature[hottest]:.0f} °C, "
                f"allowed {limits.max_temperature:.0f} °C"
            )
            return Fault(FaultKind.TOO_HOT, detail, state.time)
        return None

    def _limit(self, command: Command, state: State) -> Command:
        limits = self.limits
        reference = np.where(self._sent.torque_limit > 0.0, self._sent.joint_pos, state.joint_pos)
        released = command.torque_limit == 0.0
        wanted = np.where(released, state.joint_pos, command.joint_pos)
        in_range = _clip(wanted, limits.lower, limits.upper, reference)
        target = np.minimum(np.maximum(in_range, reference - self._reach), reference + self._reach)
        target = np.where(released, state.joint_pos, target)
        torque = np.minimum(command.torque_limit, limits.torque_limit)
        gain = np.minimum(np.maximum(command.gain_scale, 0.0), 1.0)
        held = ~released
        self._counts += (
            held & (in_range != wanted),
            held & (target != in_range),
            torque != command.torque_limit,
            gain != command.gain_scale,
        )
        return Command(joint_pos=target, gain_scale=gain, torque_limit=torque)


def _clip(wanted: Array, lower: Array, upper: Array, reference: Array) -> Array:
    """Cut targets to the range, widened to a reference that lies outside it."""
    return np.minimum(
        np.maximum(wanted, np.minimum(lower, reference)), np.maximum(upper, reference)
    )


def _name_bad_joints(state: State, names: tuple[str, ...]) -> str:
    rows = np.stack([state.joint_pos, state.joint_vel, state.joint_current, state.temperature])
    bad = np.flatnonzero(~np.isfinite(rows.sum(axis=0)))
    return ", ".join(f"joint '{names[i]}'" for i in bad) or "IMU, supply voltage or time"
