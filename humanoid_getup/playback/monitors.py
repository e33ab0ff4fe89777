"""Monitors of a run, which abort it on falls, stuck joints, load or heat."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers import State
from drivers.safety_limits import find_max_temperature
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array
from robots.servo import VOLTAGE_ROUNDING

UPRIGHT = np.radians(25.0)  # tilt below which a robot counts as upright
UPRIGHT_TIME = 0.3  # s until it counts as having been upright
SLOW = 0.2  # rad/s, below which a joint may be stuck
DOWN = np.array([0.0, 0.0, -1.0])


class AbortKind(Enum):
    """Why a rise was aborted."""

    TILT = "the torso is not oriented as the motion expects"
    FELL = "the robot was up and is falling"
    STUCK = "a joint does not follow"
    LOAD = "a servo has been near its stall torque for too long"
    HEAT = "a servo is too hot"
    POLICY = "the policy returned no valid action"


@dataclass(frozen=True)
class Abort:
    """Why and when a rise was aborted."""

    kind: AbortKind
    detail: str
    time: float
    """Since the start of the rise [s]."""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.detail}"


@dataclass(frozen=True, kw_only=True)
class MonitorLimits:
    """How far, and for how long, a rise may deviate from its motion.

    The limits come from 24 planned rises on the twin, through the sensors (six seeds of each
    class): undisturbed; with randomized starts, friction 0.45 to 1.1, supply 11.0 to 12.6 V and
    sensor noise (72 rises, 71 stood); and pushed, played from another fall, with weak servos, or
    on ice (friction 0.15). Each limit is followed by the worst value of the undisturbed rises /
    of the disturbed ones that stood, then that of the falls.
    """

    tilt: float = np.radians(60.0)
    """Angle between measured and expected gravity in the torso [rad].

    21 deg / 59 deg; of 27 falls by push, disturbance or another start 26 were beyond it for
    more than 3.9 s. On ice 0.22 s beyond it still ended standing, and 0.8 s of a robot that
    rolled over later than in the rollout.
    """
    tilt_time: float = 1.0
    """[s]"""
    fallen: float = np.radians(40.0)
    """Tilt of a robot that was upright and should be [rad]. 17 deg / 18 deg; falls 80 and more."""
    fallen_time: float = 0.02
    """[s]; a robot that tips is another 25 deg lower a tenth of a second later."""
    error: float = 0.4
    """Distance of a slow joint both from its target and from its expected angle [rad].

    It lasted for 0.03 s / 0.07 s; with servos too weak for the motion up to 5 s.
    """
    error_time: float = 1.0
    """[s]"""
    load: float = 0.9
    """Current as a share of the stall current at the measured supply.

    It lasted for 0.53 s / 2.7 s; falls 2.3 s.
    """
    load_time: float = 4.0
    """[s]"""
    heat_margin: float = 3.0
    """Temperature below the guard's limit [°C]: 72 °C where that is 75 °C.

    27 °C from 25 °C: far below for a rise that begins cool.
    """


LIMITS = MonitorLimits()

Finding = tuple[AbortKind, str]
"""A reason to abort a run, and its details."""


class RunMonitor(Protocol):
    """Checks a run for one kind of reason to abort it."""

    warnings: list[str]
    """Warnings about events that do not abort the run."""

    def reset(self, state: State, /) -> None:
        """Begin a run at a measurement."""
        ...

    def check(self, state: State, target: Array, /) -> Finding | None:
        """Check the measurement of a cycle and the targets [rad] sent before it, (n,)."""
        ...


class Persistence:
    """Measures how long each of n conditions has held without a break."""

    def __init__(self, n: int, time: float) -> None:
        self._since = np.full(n, time)

    def update(self, holds: NDArray[np.bool_] | bool, time: float) -> Array:
        """Return how long each has held at a time [s], (n,)."""
        self._since = np.where(holds, self._since, time)
        return time - self._since


class ServoMonitor:
    """Checks load and temperature of the servos; warns of a low supply."""

    def __init__(self, robot: Robot, limits: MonitorLimits = LIMITS) -> None:
        self._robot, self._limits = robot, limits
        models = [joint.servo.model for joint in robot.joints]
        self._stall_per_volt = np.array([m.stall_current / m.nominal_voltage for m in models])
        self._max_temperature = find_max_temperature(robot) - limits.heat_margin
        self._min_voltage = robot.supply_range[0]
        self.warnings: list[str] = []

    def reset(self, state: State) -> None:
        """Begin a run at a measurement."""
        self.warnings = []
        self._loaded = Persistence(self._robot.n, state.time)

    def check(self, state: State, _target: Array) -> Finding | None:
        """Check for an overloaded or hot servo."""
        self._warn(state)
        return self._check_load(state) or self._check_heat(state)

    def _check_load(self, state: State) -> Finding | None:
        limits = self._limits
        stall = self._stall_per_volt * max(state.voltage, 1.0)
        load = np.abs(state.joint_current) / stall
        lasting = self._loaded.update(load > limits.load, state.time)
        if lasting.max() > limits.load_time:
            worst = int(lasting.argmax())
            return AbortKind.LOAD, (
                f"joint '{self._robot.joint_names[worst]}' draws {load[worst]:.0%} of its stall "
                f"current, expected at most {limits.load:.0%} for {limits.load_time:g} s"
            )
        return None

    def _check_heat(self, state: State) -> Finding | None:
        worst = int((state.temperature - self._max_temperature).argmax())
        if state.temperature[worst] > self._max_temperature[worst]:
            return AbortKind.HEAT, (
                f"joint '{self._robot.joint_names[worst]}' has {state.temperature[worst]:.0f} °C, "
                f"expected at most {self._max_temperature[worst]:.0f} °C"
            )
        return None

    def _warn(self, state: State) -> None:
        if state.voltage < self._min_voltage - VOLTAGE_ROUNDING and not self.warnings:
            self.warnings.append(
                f"the supply sagged to {state.voltage:.1f} V, the servos need "
                f"{self._min_voltage:.1f} V: charge the battery"
            )


class PolicyMonitor:
    """Checks whether the policy can compute its next action."""

    def __init__(self, policy: OnnxPolicy) -> None:
        self._policy = policy
        self.warnings: list[str] = []

    def reset(self, _state: State) -> None:
        """Begin a run; the supervisor resets the policy."""

    def check(self, _state: State, _target: Array) -> Finding | None:
        """Check whether the policy has failed."""
        failure = self._policy.failure
        return None if failure is None else (AbortKind.POLICY, failure)


class MotionMonitor:
    """Compares each measurement with the motion at that time."""

    def __init__(
        self,
        world: World,
        motion: Motion,
        player: MotionPlayer,
        *,
        limits: MonitorLimits = LIMITS,
        tracked: bool = True,
    ) -> None:
        """Monitor a motion and its player.

        Without ``tracked``, for a motion that was never rolled out, neither tilt nor stuck
        joints are a reason to abort.
        """
        self._robot, self._motion, self._player = world.robot, motion, player
        self._limits, self._tracked = limits, tracked
        has_imu = world.robot.imu_site is not None
        self._sense_gravity = (
            GravitySense(imu_in_torso(world.robot, world.model)) if has_imu else None
        )
        self._gravity_b = quaternion.gravity_in_body(motion.orientation)  # (T, 3)
        self.warnings: list[str] = []

    def reset(self, state: State) -> None:
        """Begin a run at a measurement."""
        self._begin = state.time
        self._tilted = Persistence(1, state.time)
        self._upright = Persistence(1, state.time)
        self._falling = Persistence(1, state.time)
        self._stuck = Persistence(self._robot.n, state.time)
        self._is_up = self._was_up = False

    def check(self, state: State, target: Array) -> Finding | None:
        """Check for a fall, a wrong tilt or a stuck joint; without an IMU for the last only."""
        expected, angles = self._expect(state.time - self._begin - self._player.approach_time)
        if self._sense_gravity is None or not state.has_imu:
            # Only whether a joint is stuck is known where the motion does not stand.
            self._is_up = vector_angle(expected, DOWN) < UPRIGHT
            return self._check_progress(state, target, angles)
        gravity_b = self._sense_gravity(state.orientation)
        findings = (  # all are updated, the first finding counts
            self._check_fall(gravity_b, expected, state.time),
            self._check_tilt(gravity_b, expected, state.time),
            self._check_progress(state, target, angles),
        )
        return next(filter(None, findings), None)

    def _expect(self, time: float) -> tuple[Array, Array]:
        """Interpolate gravity in the torso (3,) and joint angles (n,) of the motion at a time."""
        times = self._motion.time - self._motion.time[0]
        if len(times) == 1:
            return self._gravity_b[0], self._motion.joint_pos[0]
        time = min(max(time, 0.0), float(times[-1]))
        after = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
        share = (time - times[after - 1]) / (times[after] - times[after - 1])

        def between(rows: Array) -> Array:
            return rows[after - 1] + share * (rows[after] - rows[after - 1])

        return between(self._gravity_b), between(self._motion.joint_pos)

    def _check_fall(self, gravity_b: Array, expected: Array, time: float) -> Finding | None:
        tilt, wanted = vector_angle(gravity_b, DOWN), vector_angle(expected, DOWN)
        self._is_up = up = tilt < UPRIGHT and wanted < UPRIGHT
        self._was_up |= self._upright.update(up, time).item() > UPRIGHT_TIME
        down = self._was_up and wanted < UPRIGHT and tilt > self._limits.fallen
        if self._falling.update(down, time).item() > self._limits.fallen_time:
            return AbortKind.FELL, f"tilt {math.degrees(tilt):.0f}°"
        return None

    def _check_tilt(self, gravity_b: Array, expected: Array, time: float) -> Finding | None:
        limits, off = self._limits, vector_angle(gravity_b, expected)
        wrong = self._tracked and off > limits.tilt
        if self._tilted.update(wrong, time).item() > limits.tilt_time:
            return AbortKind.TILT, (
                f"{math.degrees(off):.0f}° off, expected at most "
                f"{math.degrees(limits.tilt):.0f}° for {limits.tilt_time:g} s"
            )
        return None

    def _check_progress(self, state: State, target: Array, expected: Array) -> Finding | None:
        limits = self._limits
        # A servo's target leads its angle to make torque, so both must be far.
        error = np.minimum(np.abs(target - state.joint_pos), np.abs(expected - state.joint_pos))
        stuck = self._tracked & (error > limits.error) & (np.abs(state.joint_vel) < SLOW)
        # With weak servos the feet of an upright robot may stay further apart than planned:
        # whether that is a stand is up to the judge.
        stuck &= not self._is_up
        lasting = self._stuck.update(stuck, state.time)
        if lasting.max() > limits.error_time:
            worst = int(lasting.argmax())
            return AbortKind.STUCK, (
                f"joint '{self._robot.joint_names[worst]}' is {error[worst]:.2f} rad from where "
                f"it should be, expected at most {limits.error:g} rad for {limits.error_time:g} s"
            )
        return None


def vector_angle(a: Array, b: Array) -> float:
    """Compute the angle between two directions [rad], of any length."""
    cosine = float(a @ b) / math.sqrt(float(a @ a) * float(b @ b))
    return math.acos(min(max(cosine, -1.0), 1.0))
