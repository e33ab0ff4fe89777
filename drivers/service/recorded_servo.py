"""Records how one servo moves a mass on a lever, for identification: a flight log of each motion.

Angles are measured from where the mass hangs at rest. Between two motions the servo is without
torque until it is at rest and cool.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from drivers.control_loop import Controller, Cycle, Ending, engaged, run_engaged
from drivers.errors import DriverError, SetupError
from drivers.flight_log.writer import FlightLog
from drivers.safety_guard import SafetyGuard
from drivers.state import Command, State
from robots import Robot
from robots.bench import Load

GRAVITY = 9.81  # m/s²
LENGTH = 5.0  # s of a motion
P_GAINS = (0.25, 0.4, 0.65, 1.0)  # shares of the one as shipped
MOST_REACH, LEAST_REACH = 1.4, 0.7  # rad to each side of where the mass hangs
RANGE_MARGIN = 0.1  # rad that is left to the ends of the servo's range
LEAST_SHARE, MOST_SHARE = 0.2, 2.0 / 3.0  # of the stall torque, to hold the lever level
LONGEST_PERIOD = 0.02  # s
LEAST_PWM = 0.99  # of the supply that may drive the motor
STILL, REST_TIME, LONGEST_SWING = 0.02, 0.5, 20.0  # rad within which it is at rest for s; s
COOL_MARGIN = 8.0  # °C below the temperature from which on torque is derated
LONGEST_PAUSE = 900.0  # s to cool

STOPS = ((0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 0.85, 1.0), (0, 1, 1, 2, 2, 1, 1, -1, -1, 0))
"""Times and half reaches of the motion that stops under load."""
RAISED, RELEASED = 0.2, 0.35  # shares of the time of the motion that ends without torque


TRAJECTORIES: dict[str, Callable[[float], float | None]] = {
    "slow_sine": lambda u: math.sin(2.0 * math.pi * u),
    "fast_sine": lambda u: 0.7 * math.sin(25.0 * u**2),
    "stops": lambda u: 0.5 * float(np.interp(u, *STOPS)),
    "drop": lambda u: min(u / RAISED, 1.0) if u < RELEASED else None,
}
"""Goals as shares of the reach by shares of the time; None for torque off."""


def list_recordings(robot: Robot) -> dict[str, tuple[str, float]]:
    """List the trajectory and the share of the P gain of each log, by its file name."""
    gain = robot.joints[0].servo.p_gain
    return {
        f"{name}_{round(gain * share)}.mcap": (name, share)
        for share in P_GAINS
        for name in TRAJECTORIES
    }


def check_recordable(robot: Robot, load: Load) -> None:
    """Check what is known of a servo and its load before anything is written."""
    torque, period = GRAVITY * load.mass * load.arm, robot.control_period
    least, most = np.array([LEAST_SHARE, MOST_SHARE]) * robot.max_torque[0]
    if not least <= torque <= most:
        raise SetupError(
            f"--load is {load.mass:g}:{load.arm:g}, {torque:.3g} N·m, expected {least:.3g} to "
            f"{most:.3g} N·m for a {robot.joints[0].servo.model.name}"
        )
    if period > LONGEST_PERIOD:
        raise SetupError(
            f"a cycle takes {1e3 * period:.0f} ms, expected {1e3 * LONGEST_PERIOD:.0f} ms at most: "
            "getup servo baud 1000000, and a latency timer of 1 ms"
        )


@dataclass(frozen=True, kw_only=True)
class ServoRecorder:
    """Records the motions of a servo with a load, through the guard."""

    guard: SafetyGuard
    """Guards the driver of a bench of one servo, not connected yet."""
    load: Load
    realtime: bool
    """Whether cycles keep the deadlines of the wall clock."""
    tell: Callable[[str], None]
    """Shows a line to a person."""

    def record(self, folder: Path, advance: Callable[[float], None]) -> None:
        """Record all logs of `list_recordings` into a folder; report each that is finished.

        A `DriverError` says in one line why it ended before: guard, hardware, heat or range.
        """
        robot = self.guard.robot
        servo = robot.joints[0].servo
        about = {"servo": servo.model.name, "p_gain": servo.p_gain} | asdict(self.load)
        with engaged(self.guard, realtime=self.realtime):
            hang = self._find_hang()
            reach = self._find_reach(hang)
            for file, (name, share) in list_recordings(robot).items():
                self._rest()
                facts = about | {"hang": hang, "trajectory": name}
                with FlightLog(folder / file, robot, about=facts) as log:
                    self._run(Excitation(robot, name, share, hang, reach), log.log)
                if log.fault:
                    raise DriverError(log.fault)
                advance(1)

    def _rest(self) -> float:
        """Wait without torque until it hangs at rest and is cool; return the angle [rad]."""
        coolest = float(np.max(self.guard.limits.derate_temperature)) - COOL_MARGIN
        degrees = float(self.guard.read().temperature[0])
        if degrees > coolest:
            self.tell(f"pause: it has {degrees:.0f} °C, and goes on at {coolest:.0f} °C")
        self._run(controller := Rest(coolest))
        return controller.angle

    def _find_hang(self) -> float:
        """Find where the mass hangs, between where friction holds it from both sides [rad]."""
        first = self._rest()
        reach, sides = self._find_reach(first), []
        for side in (reach, -reach):
            self._run(Excitation(self.guard.robot, "drop", P_GAINS[-1], first, side))
            sides.append(self._rest())
        return float(np.mean(sides))

    def _find_reach(self, hang: float) -> float:
        """Find how far it may move to each side of where the mass hangs [rad]."""
        lower, upper = self.guard.robot.lower[0], self.guard.robot.upper[0]
        reach = min(MOST_REACH, hang - lower - RANGE_MARGIN, upper - hang - RANGE_MARGIN)
        if reach < LEAST_REACH:
            degrees = np.degrees([lower, upper, hang, LEAST_REACH + RANGE_MARGIN])
            raise SetupError(
                f"range is {degrees[0]:+.0f}° to {degrees[1]:+.0f}° and the mass hangs at "
                f"{degrees[2]:+.0f}°, expected {degrees[3]:.0f}° to each side: remount the lever"
            )
        return reach

    def _run(self, controller: Controller, log: Callable[[Cycle], None] | None = None) -> None:
        """Run a controller to its end, or raise why it did not get there."""

        def note(cycle: Cycle) -> None:
            share = cycle.sent.pwm_limit[0]
            if not cycle.sent.is_limp and share < LEAST_PWM:
                why = "expected 100%: the servo is hot, the supply low, or pwm_limit is"
                raise DriverError(f"PWM is limited to {share:.0%}, {why}")
            if log:
                log(cycle)

        report = run_engaged(
            controller, self.guard, max_time=math.inf, realtime=self.realtime, on_cycle=note
        )
        if report.ending is Ending.INTERRUPTED:
            raise KeyboardInterrupt
        if report.ending is not Ending.DONE:
            raise DriverError(f"{report.reason}; torque is off, nothing is recorded")


class Rest:
    """Leaves a servo without torque until it is at rest, and not warmer than it may begin."""

    def __init__(self, coolest: float) -> None:
        """Prepare to wait for a temperature [°C]."""
        self._coolest = coolest
        self.done, self.angle = False, 0.0

    def reset(self, state: State) -> None:
        """Start to wait."""
        self._began = self._since = state.time
        self._place = float(state.joint_pos[0])

    def step(self, state: State) -> Command:
        """Wait; raises `DriverError` once it takes too long."""
        self.angle, degrees = float(state.joint_pos[0]), float(state.temperature[0])
        if abs(self.angle - self._place) > STILL:
            self._place, self._since = self.angle, state.time
        is_cool, waited = degrees <= self._coolest, state.time - self._began
        self.done = is_cool and state.time - self._since >= REST_TIME
        if not self.done and waited > (LONGEST_SWING if is_cool else LONGEST_PAUSE):
            found = "still swings" if is_cool else f"still has {degrees:.0f} °C"
            raise DriverError(f"the servo {found} after {waited:.0f} s without torque")
        return Command.limp(1)


class Excitation:
    """Drives a servo along a trajectory about where its mass hangs."""

    def __init__(self, robot: Robot, name: str, share: float, hang: float, reach: float) -> None:
        """Prepare a trajectory by its name with a share of the P gain; angles in rad."""
        self._shape, self._torque, self._share = TRAJECTORIES[name], robot.max_torque, share
        self._hang, self._reach, self.done = hang, reach, False

    def reset(self, state: State) -> None:
        """Start now."""
        self._began = state.time

    def step(self, state: State) -> Command:
        """Compute the next goal."""
        passed = (state.time - self._began) / LENGTH
        self.done = passed >= 1.0
        shape = self._shape(min(passed, 1.0))
        return Command(
            joint_pos=np.array([self._hang + self._reach * (shape or 0.0)]),
            gain_scale=np.array([self._share]),
            torque_limit=self._torque * (shape is not None),
            pwm_limit=np.ones(1),
        )
