"""Moves servos from one waypoint to the next, slowly, and notes where they arrive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.control_loop import Ending, RunReport, engaged, run_engaged
from drivers.safety_guard import SafetyGuard
from drivers.service.servos.guarded_motion import check_target
from drivers.state import Command, State
from robots import Robot
from robots.quaternion import Array
from robots.smooth_step import smooth_step

PEAK_OF_SMOOTH_STEP = 1.5  # its largest slope
SETTLE_TIME = 0.4  # s at each waypoint before the servos are measured there
TIMEOUT_MARGIN = 5.0  # s


@dataclass(frozen=True)
class Arrival:
    """Where the servos are after a waypoint."""

    wanted: Array
    """Target angles [rad], (n,)."""
    reached: Array
    """Measured angles [rad], (n,)."""
    current: Array
    """Largest motor currents on the way [A], (n,)."""


class WaypointController:
    """Moves joints through waypoints, each with a smooth step, and waits at each of them."""

    def __init__(
        self,
        robot: Robot,
        waypoints: Array,
        *,
        speed: float,
        torque_limit: Array,
        dwell: float = SETTLE_TIME,
    ) -> None:
        """Prepare to move.

        Args:
            robot: Robot or bench that moves.
            waypoints: Target angles [rad], (k, n); NaN for a joint that stays limp.
            speed: Highest speed of a joint [rad/s].
            torque_limit: Torque limit of each servo [N·m], (n,).
            dwell: Time at each waypoint [s].
        """
        self._robot, self._waypoints = robot, waypoints
        self._speed, self._dwell = speed, dwell
        self._driven = ~np.isnan(waypoints).any(axis=0)
        self._torque = np.where(self._driven, torque_limit, 0.0)
        self.arrivals: list[Arrival] = []
        """Arrivals at the waypoints so far."""

    @property
    def done(self) -> bool:
        """Return whether the last waypoint is behind it."""
        return len(self.arrivals) == len(self._waypoints)

    def reset(self, state: State) -> None:
        """Start where the servos are."""
        self._begin(state.joint_pos, state.time)

    def step(self, state: State) -> Command:
        """Move towards the present waypoint."""
        passed = state.time - self._began
        self._current = np.maximum(self._current, np.abs(state.joint_current))
        if passed >= self._duration + self._dwell:
            self.arrivals.append(Arrival(self._goal, state.joint_pos, self._current))
            if not self.done:
                self._begin(self._goal, state.time)
                passed = 0.0
        share = smooth_step(np.array(passed / self._duration if self._duration else 1.0))
        target = self._start + share * (self._goal - self._start)
        return Command.position(self._robot, target, self._torque)

    def _begin(self, start: Array, time: float) -> None:
        goal = self._waypoints[len(self.arrivals)]
        self._start, self._began = start, time
        self._goal = np.where(self._driven, goal, start)
        farthest = float(np.abs(self._goal - self._start).max())
        self._duration = PEAK_OF_SMOOTH_STEP * farthest / self._speed
        self._current = np.zeros(self._robot.n)

    def estimate_duration(self, start: Array) -> float:
        """Estimate the time that all waypoints take from angles (n,) [s]."""
        path = np.vstack([start, np.where(self._driven, self._waypoints, start)])
        longest = np.abs(np.diff(path, axis=0)).max(axis=1)
        return float((PEAK_OF_SMOOTH_STEP * longest / self._speed + self._dwell).sum())


@dataclass(frozen=True)
class WaypointRun:
    """A run through waypoints."""

    start: Array
    """Angles before it [rad], (n,)."""
    arrivals: tuple[Arrival, ...]
    """One for each waypoint that was reached in time."""
    report: RunReport

    @property
    def is_whole(self) -> bool:
        """Return whether it went through all waypoints."""
        return self.report.ending is Ending.DONE


def move_through(
    guard: SafetyGuard, make: Callable[[Array], WaypointController], *, realtime: bool
) -> WaypointRun:
    """Connect, move through waypoints, and switch torque off.

    Args:
        guard: Guard of the servos.
        make: Makes the controller from the measured angles [rad], (n,); it may refuse.
        realtime: Keep the deadlines of the wall clock.

    Raises:
        DriverError: if the servos cannot be connected to.
    """
    with engaged(guard, realtime=realtime):
        start = guard.read().joint_pos
        controller = make(start)
        longest = controller.estimate_duration(start) + TIMEOUT_MARGIN
        report = run_engaged(controller, guard, max_time=longest, realtime=realtime)
    return WaypointRun(start, tuple(controller.arrivals), report)


def make_move(joint: int, target: float, robot: Robot) -> Array:
    """Make the waypoint that moves one joint to a target [rad], others limp, (1, n).

    Raises:
        SetupError: if the target is out of the joint's range.
    """
    check_target(robot, joint, target)
    waypoints = np.full((1, robot.n), np.nan)
    waypoints[0, joint] = target
    return waypoints


def make_wiggle(joint_pos: Array, joint: int, swing: float, robot: Robot) -> Array:
    """Make the waypoints that swing one joint to both sides and back, others limp, (3, n).

    A side that leaves the joint's range is left out: then there are two of the other side.

    Args:
        joint_pos: Present angles [rad], (n,).
        joint: Number of the joint.
        swing: Angle to each side [rad].
        robot: Robot or bench.
    """
    here, lower, upper = joint_pos[joint], robot.lower[joint], robot.upper[joint]
    sides = [here + swing, here - swing]
    inside = [side for side in sides if lower <= side <= upper] or [
        float(np.clip(here, lower, upper))
    ]
    waypoints = np.full((3, robot.n), np.nan)
    waypoints[:, joint] = [inside[0], inside[-1], np.clip(here, lower, upper)]
    return waypoints
