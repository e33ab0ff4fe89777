"""Safety guard: keeps every command within limits, and counts what it cuts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from drivers.backend import Backend, Release
from drivers.safety_limits import ClipCounts, GuardLimits
from drivers.state import Command, HardwareError, Integers, State, find_command_problems
from robots.arguments import expect
from robots.quaternion import Array
from robots.servo import VOLTAGE_ROUNDING, LimitMode

UNREAD = 0x80  # in `State.alert`: an error that was not read yet, or passed before it was
RECOVERY = 0.1  # s in which torque comes back after a dip; at once, torque and supply would swing
MOST_NAMED = 4  # joints with the same error; more are counted


class FaultKind(Enum):
    """Why the guard switched torque off, or held the robot where it was."""

    BAD_COMMAND = "the command holds values that no servo can follow"
    BAD_MEASUREMENT = "the measurement holds invalid values"
    STALE_DATA = "the measurement is repeated: its time no longer changes"
    LOST_JOINTS = "servos have been silent for too long"
    LOST_IMU = "the orientation has been unknown for too long"
    SERVO_ERROR = "a servo has switched itself off"
    LOW_VOLTAGE = "the supply is too low"
    TOO_HOT = "a servo is too hot"
    PAUSED = "the control loop paused under torque"
    STOPPED = "the robot was stopped"


@dataclass(frozen=True)
class Fault:
    """Why and when the guard ended the motion."""

    kind: FaultKind
    detail: str
    time: float
    """Time of the newest measurement [s]."""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.detail}"


class SafetyGuard(Backend):
    """Wraps a backend and keeps every command within limits.

    The rules, for each joint and command. The *reference* is the last target that was sent, or
    the measured angle where torque was off:

    - The target is never beyond the joint's range, or beyond a reference that already is: a
      joint outside may stay or come back, never go further out.
    - The target never moves further from the reference than top speed times the period,
      before the servos round it to whole ticks.
    - The torque limit is between 0 and the guard's own, derated where a servo is hot; the
      gain share and the PWM limit are between 0 and 1.
    - A limp joint of the robot is never driven, and may report errors.
    - While the measurement of a joint is some periods old, all targets are held.
    - While the supply is low, or servos report that it is, the torque limit shrinks.

    A position servo needs a distance from its angle to its target to make torque, so that
    distance is free. Cuts are counted in ``clips``. Invalid commands, measurements that are not
    finite, do not change or are too old, servo errors, heat and a supply that stays low are
    faults: torque goes off and stays off until ``clear`` or the next ``connect``. ``stop`` is a
    fault that outlives a connection: only ``clear`` ends it. After a pause under torque the robot
    is held where it was measured, until ``resume``, ``clear`` or the next ``connect``.
    The target of a joint without torque is its measured angle, so that torque comes back
    without a jerk.
    """

    def __init__(self, backend: Backend, limits: GuardLimits | None = None) -> None:
        """Prepare to guard a backend; no limits for those of its robot.

        Raises:
            ValueError: if a range of the limits is not within that of its joint.
        """
        expect("backend", backend, Backend, "a backend, e.g. Twin(world)")
        self.backend = backend
        self.robot, self.period = backend.robot, backend.period
        self.has_wire = backend.has_wire
        self.limits = GuardLimits.of(backend.robot) if limits is None else limits
        self.limits.check_range(self.robot)
        self._widest = self.limits
        self._reach = self.limits.max_velocity * self.period
        self._never_driven = self.robot.strength == 0.0
        # Half a period less: ages are sums of periods, beyond rounding.
        self._hold_age = (self.limits.hold_cycles - 0.5) * self.period
        self._limp_age = (self.limits.limp_cycles - 0.5) * self.period
        self._longest_pause = max(self.limits.max_pause, self._hold_age)
        self._counts = np.zeros((5, self.robot.n), dtype=int)
        self._is_open = False
        self._stop_reason: str | None = None
        self.holds = 0
        """Cycles since ``connect`` in which targets were held for lack of a measurement."""
        self._forget()

    def _forget(self) -> None:
        self.fault: Fault | None = None
        """Why the motion ended; None if it did not."""
        self._state: State | None = None
        self._judged_time = -np.inf
        self._low_since = self._deep_since = self._supply = np.inf
        self._stale_writes = 0
        self._sent = self._limited = Command.limp(self.robot.n)  # as confirmed; as limited here

    @property
    def limit_by(self) -> LimitMode:
        """Return what torque limits act on."""
        return self.backend.limit_by

    @property
    def clips(self) -> ClipCounts:
        """Return how often each joint's command was cut since ``connect``."""
        return ClipCounts(*self._counts.copy())

    def stop(self, reason: str = "stop() was called") -> None:
        """Switch torque off from the next command on, until `clear`; any thread may call."""
        self._stop_reason = reason

    def connect(self) -> None:
        """Open the backend and reset faults and clips; an open one is released first."""
        if self._is_open:
            self.backend.write(Command.limp(self.robot.n))
        self._forget()
        self._counts[:] = 0
        self.holds = 0
        self.backend.connect()
        self.limits = self.backend.narrow(self._widest)
        self._is_open = True

    def close(self) -> None:
        """Release every joint and the devices."""
        self._is_open = False
        self.backend.close()

    @property
    def unreleased(self) -> tuple[str, ...]:
        """Return the joints that did not confirm torque off."""
        return self.backend.unreleased

    def hand_over(self) -> tuple[str, ...]:
        """Leave the joints under torque at ``close`` as the backend does, unless a stop came."""
        unconfirmed = self.backend.hand_over()
        if self.check_stop():
            self.backend.release = Release.LIMP
        return unconfirmed

    def clear(self) -> None:
        """Clear a fault; the next command starts from the measured angles.

        Without a fault nothing changes, so that the last target is kept.
        """
        self._stop_reason = None
        if self.fault is not None:
            self._forget()

    def resume(self) -> None:
        """Clear the fault of a pause; the next command starts from the measured angles."""
        if self.fault is not None and self.fault.kind is FaultKind.PAUSED:
            self._forget()

    def begin(self) -> State:
        """Measure for a controller that starts now: a pause before it is no fault.

        After one it starts from the measured angles.
        """
        state = self.read()
        if not self._sent.is_limp and state.time - self._judged_time > self._longest_pause:
            # Half a period: the next write is neither stale nor after a pause.
            self._limited, self._judged_time = self._stay(state), state.time - 0.5 * self.period
        return state

    def check_stop(self) -> Fault | None:
        """Return the fault; a stop that was called for becomes one at once."""
        if self._stop_reason is not None:  # before any other fault: only a person ends it
            time = self._state.time if self._state is not None else -np.inf
            self.fault = Fault(FaultKind.STOPPED, self._stop_reason, time)
        return self.fault

    def read(self) -> State:
        """Measure the robot."""
        self._state = self.backend.read()
        return self._state

    def is_outdated(self, state: State) -> bool:
        """Return whether joints or orientation were measured too long ago to move."""
        return self._find_lost(state).size > 0 or not state.imu_age <= self.limits.max_imu_age

    def write(self, command: Command) -> Command:
        """Send a command within the limits, or torque off after a fault; return what was sent."""
        state = self.read() if self._state is None else self._state
        earlier = self.check_stop()
        if earlier is None or earlier.kind is FaultKind.PAUSED:
            self.fault = self._find_fault(command, state) or earlier
        if self.fault and self.fault.kind is FaultKind.PAUSED and not command.is_limp:
            limited = self._limited if earlier else self._stay(state)
        elif self.fault:
            limited = Command.limp(self.robot.n)
        elif not command.is_limp and not state.joint_age.max() <= self._hold_age:
            self.holds += 1
            limited = self._limited
        else:
            limited = self._limit(command, state)
        self._limited, self._sent = limited, self.backend.write(limited)
        return self._sent

    def _find_fault(self, command: Command, state: State) -> Fault | None:
        """Find a fault of data, robot, command or loop; comparisons with NaN count as faults."""
        self._stale_writes = 0 if state.time > self._judged_time else self._stale_writes + 1
        pause = 0.0 if self._sent.is_limp else state.time - self._judged_time
        self._judged_time = max(self._judged_time, state.time)
        names, limits = self.robot.joint_names, self.limits
        if not state.is_valid:
            return Fault(FaultKind.BAD_MEASUREMENT, _name_bad_joints(state, names), state.time)
        if self._stale_writes >= limits.stale_writes:
            detail = f"{self._stale_writes} commands since {state.time:.3f} s"
            return Fault(FaultKind.STALE_DATA, detail, state.time)
        if fault := self._find_body_fault(state):
            return fault
        if problems := find_command_problems(command, names):
            return Fault(FaultKind.BAD_COMMAND, "; ".join(problems), state.time)
        if pause > (longest := self._longest_pause):
            detail = (
                f"{pause:.2f} s between two cycles, expected at most {longest:.2f} s: the program "
                "was suspended, or this computer has too little time"
            )
            return Fault(FaultKind.PAUSED, detail, state.time)
        return None

    def _find_body_fault(self, state: State) -> Fault | None:
        """Find a fault of the robot itself."""
        names, limits = self.robot.joint_names, self.limits
        alerts = state.alert * ~self._never_driven
        if low := self._find_low_supply(state, alerts):
            return low
        if alerts.any() and not _report_supply(alerts):
            return Fault(FaultKind.SERVO_ERROR, _name_alerts(alerts, names), state.time)
        if (lost := self._find_lost(state)).size:
            return Fault(FaultKind.LOST_JOINTS, _name_lost(state, lost, names), state.time)
        if not state.imu_age <= limits.max_imu_age:
            return Fault(FaultKind.LOST_IMU, f"since {state.imu_age:.2f} s", state.time)
        excess = state.temperature - limits.max_temperature
        if excess.max() > 0.0:
            hottest = int(excess.argmax())
            degrees = state.temperature[hottest]
            detail = (
                f"joint '{names[hottest]}' has {degrees:.0f} °C, "
                f"expected at most {degrees - excess[hottest]:.0f} °C"
            )
            return Fault(FaultKind.TOO_HOT, detail, state.time)
        return None

    def _find_lost(self, state: State) -> Integers:
        """Find the joints that have been silent for too long, by their numbers."""
        return np.flatnonzero(~(state.joint_age <= self._limp_age))

    def _find_low_supply(self, state: State, alerts: Integers) -> Fault | None:
        """Find a supply that stays low, or that servos keep reporting."""
        limits, time = self.limits, state.time
        is_low = state.voltage < limits.min_voltage - VOLTAGE_ROUNDING
        is_deep = _report_supply(alerts) or (is_low and state.voltage < limits.shutdown_voltage)
        self._low_since = min(self._low_since, time) if is_low else np.inf
        self._deep_since = min(self._deep_since, time) if is_deep else np.inf
        low, deep = time - self._low_since, time - self._deep_since
        if low <= limits.longest_dip and deep <= limits.longest_report:
            return None
        if not is_low:
            names = self.robot.joint_names
            return Fault(FaultKind.SERVO_ERROR, _name_alerts(alerts, names), time)
        detail = (
            f"{state.voltage:.1f} V for {low:.1f} s, expected {limits.min_voltage:.1f} V or more"
        )
        return Fault(FaultKind.LOW_VOLTAGE, detail, time)

    def _stay(self, state: State) -> Command:
        """Hold the joints where they are measured, with the limits of the last command."""
        known = state.joint_age <= self._hold_age
        return replace(
            self._limited, joint_pos=np.where(known, state.joint_pos, self._limited.joint_pos)
        )

    def _limit(self, command: Command, state: State) -> Command:
        """Cut a command to the limits, and count what was cut for each joint."""
        limits = self.limits
        driven = self._sent.torque_limit > 0.0
        reference = np.where(driven, self._limited.joint_pos, state.joint_pos)
        released = (command.torque_limit == 0.0) | self._never_driven
        wanted = np.where(released, state.joint_pos, command.joint_pos)
        in_range = _clip(wanted, limits.lower, limits.upper, reference)
        target = np.minimum(np.maximum(in_range, reference - self._reach), reference + self._reach)
        target = np.where(released, state.joint_pos, target)
        supply = state.voltage if np.isinf(self._deep_since) else limits.shutdown_voltage
        span = max(limits.min_voltage - limits.shutdown_voltage, 0.0)
        self._supply = min(supply, self._supply + span * self.period / RECOVERY)
        torque = np.minimum(command.torque_limit, limits.derate(state.temperature, self._supply))
        torque = np.where(self._never_driven, 0.0, torque)
        gain = np.minimum(np.maximum(command.gain_scale, 0.0), 1.0)
        pwm = np.minimum(np.maximum(command.pwm_limit, 0.0), 1.0)
        held = ~released
        self._counts += (
            held & (in_range != wanted),
            held & (target != in_range),
            ~self._never_driven & (torque != command.torque_limit),
            gain != command.gain_scale,
            pwm != command.pwm_limit,
        )
        return Command(joint_pos=target, gain_scale=gain, torque_limit=torque, pwm_limit=pwm)


def _clip(wanted: Array, lower: Array, upper: Array, reference: Array) -> Array:
    """Clip targets to the range, widened to a reference outside it."""
    return np.minimum(
        np.maximum(wanted, np.minimum(lower, reference)), np.maximum(upper, reference)
    )


def _report_supply(alerts: Integers) -> bool:
    """Tell whether servos report their supply, or what was not read yet, and no other error."""
    others = ~(HardwareError.VOLTAGE.value | UNREAD)
    return bool(np.any(alerts) and not np.any(alerts & others))


def _name_lost(state: State, lost: Integers, names: tuple[str, ...]) -> str:
    """Name silent joints; for a whole robot that is silent, what that may come from."""
    ages = state.joint_age[lost]
    if len(lost) == len(names):
        who = f"all {len(names)} servos" if len(names) > 1 else f"joint '{''.join(names)}'"
        return (
            f"{who} since {ages.min():.2f} s: no power, the adapter or its cable is loose, or this "
            "computer has too little time"
        )
    rows = zip(lost, ages, strict=True)
    return ", ".join(f"joint '{names[i]}' since {age:.2f} s" for i, age in rows)


def _name_alerts(alerts: Integers, names: tuple[str, ...]) -> str:
    """Name the joints of each kind of error, or count them."""
    kinds = []
    for bits in dict.fromkeys(alerts[alerts != 0].tolist()):
        rows, what = np.flatnonzero(alerts == bits), HardwareError(bits).describe()
        if len(rows) > MOST_NAMED:
            kinds.append(f"{len(rows)} joints report {what}")
        else:
            kinds += [f"joint '{names[row]}' reports {what}" for row in rows]
    return ", ".join(kinds)


def _name_bad_joints(state: State, names: tuple[str, ...]) -> str:
    rows = np.stack([state.joint_pos, state.joint_vel, state.joint_current, state.temperature])
    bad = np.flatnonzero(~np.isfinite(rows.sum(axis=0)))
    return ", ".join(f"joint '{names[i]}'" for i in bad) or "IMU, supply voltage or time"
