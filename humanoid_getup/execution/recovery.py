"""Recovery of a robot with torque off after a fault: cooling, reboots, waiting."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np

from drivers import Command, DriverError, Fault, FaultKind, SafetyGuard, State
from drivers.control_loop import Pacer, prioritized
from drivers.state import HardwareError
from robots.servo import VOLTAGE_ROUNDING

OVERHEATING, OVERLOAD = int(HardwareError.OVERHEATING), int(HardwareError.OVERLOAD)
VOLTAGE = int(HardwareError.VOLTAGE)
MOST_REBOOTS, REBOOT_WINDOW = 3, 300.0  # s; more reboots mean a fault that they do not clear
ALERT_TIME = 1.0  # s within which a servo in error reports its error
REBOOT_TIME = 3.0  # s until a servo that was rebooted answers without an error
CONNECT_TRIES, CONNECT_WAIT = 10, 2.0  # s each; a supply that sagged may come back
RESTED = (FaultKind.TOO_HOT, FaultKind.LOW_VOLTAGE, FaultKind.PAUSED)
REMEDIED = (FaultKind.TOO_HOT, FaultKind.SERVO_ERROR, FaultKind.LOW_VOLTAGE)
SLACK = 4  # cycles that a wait may take for each cycle of its nominal time


@runtime_checkable
class RebootsServos(Protocol):
    """A backend that can also restart servos."""

    def reboot(self, joint: str) -> None:
        """Restart a joint's servo; its torque stays off, its goal is its present angle."""
        ...


class UnrecoveredError(Exception):
    """The robot cannot continue by itself; the message says why."""


class StoppedError(Exception):
    """The operator has stopped the robot; it must not move."""


@dataclass
class RebootBudget:
    """Limits how often servos are rebooted: a servo that keeps tripping has another fault."""

    most: int = MOST_REBOOTS
    window: float = REBOOT_WINDOW
    """[s]"""
    _times: deque[float] = field(default_factory=deque)

    def spend(self, time: float) -> bool:
        """Count a reboot at a time [s]; return False if the budget is spent."""
        while self._times and self._times[0] <= time - self.window:
            self._times.popleft()
        if len(self._times) >= self.most:
            return False
        self._times.append(time)
        return True


@dataclass(frozen=True, kw_only=True)
class Cooling:
    """Rest of a robot before it tries again."""

    temperature: float = 55.0
    """Highest temperature of any servo [°C]: 10 °C below where the guard derates."""
    min_time: float = 3.0
    """[s]"""
    max_time: float = 900.0
    """[s]; from 75 °C the model's servo takes 270 s."""


class Recovery:
    """Lets servos cool and reboots them, on the backend's clock, with torque off throughout."""

    def __init__(
        self,
        guard: SafetyGuard,
        *,
        cooling: Cooling,
        services: RebootsServos | None = None,
        realtime: bool = False,
        report: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Prepare the recovery of a robot, whose guard is closed between the steps.

        Without ``services``, servos cannot be rebooted; ``report`` is called with a short
        description of each action.
        """
        self._guard, self._cooling, self._services = guard, cooling, services
        self._realtime, self._report = realtime, report
        self._budget = RebootBudget()

    def remedy(self, fault: Fault) -> None:
        """Clear a fault, with torque off.

        Raises:
            StoppedError: if the fault is the operator's stop.
            UnrecoveredError: if it cannot be cleared, or must not be.
        """
        match fault.kind:
            case FaultKind.STOPPED:
                raise StoppedError(fault.detail)
            case kind if kind in RESTED:
                self.cool_down()
            case FaultKind.SERVO_ERROR:
                self._recover_servos()
            case _:
                raise UnrecoveredError(str(fault))

    def cool_down(self) -> None:
        """Wait with torque off for the supply, for `Cooling.min_time`, and for cool servos.

        Raises:
            DriverError: if the robot cannot be connected to, as without a supply.
            StoppedError: if the operator stops the robot meanwhile.
            UnrecoveredError: if it takes too long, or another fault occurs meanwhile.
        """
        cooling, least = self._cooling, self._guard.limits.min_voltage
        self._report(
            f"torque off until the supply has {least:.1f} V or more, and every servo "
            f"{cooling.temperature:.0f} °C or less"
        )

        def is_supplied(state: State, _elapsed: float) -> bool:
            reported = bool(np.any(self._find_alerts(state) & VOLTAGE))
            return state.voltage >= least - VOLTAGE_ROUNDING and not reported

        def is_cool(state: State, elapsed: float) -> bool:
            cool = float(state.temperature.max()) <= cooling.temperature
            return cool and elapsed >= cooling.min_time

        self._connect()
        with self._guard:
            state, supplied = self._wait(is_supplied, CONNECT_TRIES * CONNECT_WAIT)
            if not supplied:
                low = np.flatnonzero(self._find_alerts(state) & VOLTAGE)
                raise UnrecoveredError(
                    f"{FaultKind.LOW_VOLTAGE.value}: {state.voltage:.1f} V at rest, expected "
                    f"{least:.1f} V or more; {self._describe(state, low)}".removesuffix("; ")
                )
            state, cool = self._wait(is_cool, cooling.max_time)
        if not cool:
            hottest = int(state.temperature.argmax())
            raise UnrecoveredError(
                f"joint '{self._guard.robot.joint_names[hottest]}' still has "
                f"{state.temperature[hottest]:.0f} °C after {cooling.max_time:.0f} s of rest, "
                f"expected at most {cooling.temperature:.0f} °C"
            )

    def _find_alerts(self, state: State) -> np.ndarray:
        """Find the errors of servos that are driven; those of limp joints stop no robot, (n,)."""
        return state.alert * (self._guard.robot.strength != 0.0)

    def _connect(self) -> None:
        """Connect; a driver refuses servos with too low a supply, or that restart after it."""
        for left in reversed(range(CONNECT_TRIES)):
            try:
                self._guard.connect()
                return
            except DriverError as error:
                self._guard.close()
                if not left:
                    raise
                self._report(f"waiting, torque off: {error}")
            if stop := self._guard.check_stop():
                self.remedy(stop)
            time.sleep(CONNECT_WAIT if self._realtime else 0.0)

    def _recover_servos(self) -> None:
        """Reboot servos that tripped by overload; let those that tripped by heat cool down."""
        self._connect()
        with self._guard:
            state, _ = self._wait(_is_named, ALERT_TIME)
            if np.any(self._find_alerts(state) & VOLTAGE):
                self.cool_down()
                return
            hot = self._check_errors(state)
            for joint in np.flatnonzero(state.alert & ~hot):
                self._reboot(int(joint), state)
            rebooted, _ = self._wait(lambda s, _: not np.any(s.alert & ~hot), REBOOT_TIME)
            left = np.flatnonzero(rebooted.alert & ~hot)
        if len(left):
            raise UnrecoveredError(f"rebooted, but {self._describe(rebooted, left)}")
        if hot:
            self.cool_down()
            with self._guard:
                cooled, _ = self._wait(lambda *_: True, ALERT_TIME)
            if cooled.alert.any():
                raise UnrecoveredError(
                    f"{self._describe(cooled, np.flatnonzero(cooled.alert))}, and has cooled "
                    "down: find out why it overheated, then switch its power off and on"
                )

    def _check_errors(self, state: State) -> int:
        """Raise for errors that a reboot must not clear; return the overheating bit if set."""
        other = np.flatnonzero(state.alert & ~(OVERLOAD | OVERHEATING))
        if len(other):
            raise UnrecoveredError(f"{self._describe(state, other)}: inspect the servo")
        hot = (state.alert & OVERHEATING) != 0
        both = hot & ((state.alert & OVERLOAD) != 0)
        if both.any():
            names = self._describe(state, np.flatnonzero(both))
            raise UnrecoveredError(f"{names}: let it cool down, then switch its power off and on")
        return OVERHEATING if hot.any() else 0

    def _reboot(self, joint: int, state: State) -> None:
        name = self._guard.robot.joint_names[joint]
        if self._services is None:
            raise UnrecoveredError(
                f"joint '{name}' tripped by overload: see that nothing blocks it, then switch "
                "its power off and on"
            )
        if not self._budget.spend(state.time):
            raise UnrecoveredError(
                f"joint '{name}' tripped by overload, and {MOST_REBOOTS} servos were rebooted "
                f"within {REBOOT_WINDOW / 60.0:.0f} min already: see what blocks it"
            )
        self._report(f"rebooting joint '{name}', which tripped by overload")
        self._services.reboot(name)

    def _wait(self, is_over: Callable[[State, float], bool], most: float) -> tuple[State, bool]:
        """Wait, torque off, until a condition holds, at most ``most`` seconds."""
        guard = self._guard
        pacer = Pacer(guard.period) if self._realtime else None
        with prioritized(guard, realtime=self._realtime):
            state = guard.read()
            begin = state.time
            for _ in range(SLACK * round(most / guard.period)):
                if is_over(state, state.time - begin):
                    return state, True
                if state.time - begin >= most:
                    break
                guard.write(Command.limp(guard.robot.n))
                fault = guard.fault
                if fault and fault.kind not in REMEDIED:
                    self.remedy(fault)
                if pacer:
                    pacer.wait()
                state = guard.read()
        return state, is_over(state, state.time - begin)

    def _describe(self, state: State, joints: np.ndarray) -> str:
        names = self._guard.robot.joint_names
        return ", ".join(
            f"joint '{names[j]}' reports {HardwareError(int(state.alert[j])).describe()}"
            for j in joints
        )


def _is_named(state: State, _elapsed: float) -> bool:
    """Return whether every servo in error has reported its error; some report later."""
    alert = state.alert[state.alert != 0]
    return bool(len(alert)) and bool(np.all(alert & 0b111101))
