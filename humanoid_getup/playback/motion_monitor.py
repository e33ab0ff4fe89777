"""Monitors whether a robot follows its motion: falls, tilt of the torso, stuck joints."""

from __future__ import annotations

import math

import numpy as np

from drivers import State
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.monitors import AbortKind, Finding, MonitorLimits, Persistence
from humanoid_getup.playback.motion_player import MotionPlayer
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import GravitySense
from robots.quaternion import Array

UPRIGHT = np.radians(25.0)  # tilt below which a robot counts as upright
UPRIGHT_TIME = 0.3  # s until it counts as having been upright
SLOW = 0.2  # rad/s, below which a joint may be stuck
DOWN = np.array([0.0, 0.0, -1.0])


class MotionMonitor:
    """Compares each measurement with the motion at that time."""

    def __init__(
        self,
        world: World,
        motion: Motion,
        player: MotionPlayer,
        limits: MonitorLimits,
        *,
        tracked: bool = True,
    ) -> None:
        """Monitor a motion and its player.

        Without ``tracked``, for a motion that was never rolled out, neither tilt nor stuck
        joints are a reason to abort.
        """
        self._robot, self._motion, self._player = world.robot, motion, player
        self._limits, self._tracked = limits, tracked
        self._sense_gravity = GravitySense(world.model.site(world.robot.imu_site).quat)
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
        """Check for a fall, a wrong tilt or a stuck joint."""
        expected, angles = self._expect(state.time - self._begin - self._player.approach_time)
        gravity_b = self._sense_gravity(state.orientation)
        findings = (  # all are updated, the first finding counts
            self._check_fall(gravity_b, expected, state.time),
            self._check_tilt(gravity_b, expected, state.time),
            self._check_progress(state, target, angles),
        )
        return next(filter(None, findings), None)

    def _expect(self, time: float) -> tuple[Array, Array]:
        """Interpolate gravity in the torso (3,) and joint angles (n,) of the motion [s]."""
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
        tilt, wanted = (
            vector_angle(gravity_b, DOWN),
            vector_angle(expected, DOWN),
        )
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
