"""The supervisor: plays a motion and gives up, limp, when the rise goes wrong."""

from __future__ import annotations

import math

import numpy as np

from drivers import Command, State
from humanoid_getup.evaluation.standing import HOLD
from humanoid_getup.execution.monitors import Abort, AbortKind, Lasting, MonitorLimits, ServoMonitor
from humanoid_getup.execution.motion_player import MotionPlayer
from humanoid_getup.motions.motion import Motion
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import GravitySense
from robots.quaternion import Array

UPRIGHT = np.radians(25.0)  # tilt under which a robot counts as up
UPRIGHT_TIME = 0.3  # s of it
SLOW = 0.2  # rad/s of a joint that is stuck
DOWN = np.array([0.0, 0.0, -1.0])


class Supervisor:
    """Plays a motion and watches, each cycle, what the sensors tell of the rise.

    It commands limp once and is done as soon as something has been wrong for too long.
    """

    def __init__(
        self,
        world: World,
        motion: Motion,
        *,
        hold: float = HOLD,
        torque_limit: float | None = None,
        supervision: MonitorLimits | None = None,
    ) -> None:
        """Prepare to play.

        Args:
            world: Robot and how its IMU sits in it.
            motion: What to play.
            hold: How long to hold the last targets [s].
            torque_limit: Cap on every servo [N·m].
            supervision: What is too much; ``None`` for the defaults.
        """
        self.robot, self._motion = world.robot, motion
        self._sense_gravity = GravitySense(world.model.site(world.robot.imu_site).quat)
        self._player = MotionPlayer(world.robot, motion, hold=hold, torque_limit=torque_limit)
        self._limits = supervision or MonitorLimits()
        self._gravity_b = quaternion.gravity_in_body(motion.orientation)  # (T, 3)
        self._servos = ServoMonitor(world.robot, self._limits)
        self.longest = motion.duration + hold
        """Time that motion and hold take [s]."""
        self.aborted: Abort | None = None

    @property
    def warnings(self) -> list[str]:
        """Return what was odd but no reason to stop."""
        return self._servos.warnings

    @property
    def done(self) -> bool:
        """Tell whether the motion and the hold are over, or were given up."""
        return self.aborted is not None or self._player.done

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._player.reset(state)
        self._begin = state.time
        self._target = state.joint_pos
        self._servos.reset(state)
        self.aborted = None
        self._tilted = Lasting(1, state.time)
        self._upright = Lasting(1, state.time)
        self._falling = Lasting(1, state.time)
        self._is_up = False
        self._stuck = Lasting(self.robot.n, state.time)
        self._was_up = False

    def step(self, state: State) -> Command:
        """Send the targets that are due, or release every joint."""
        self.aborted = self._find_abort(state)
        command = self._player.step(state)
        self._target = command.joint_pos
        return command if self.aborted is None else Command.limp(self.robot.n)

    def _find_abort(self, state: State) -> Abort | None:
        time = state.time - self._begin
        expected, angles = self._expect(time - self._player.approach_time)
        gravity_b = self._sense_gravity(state.orientation)
        faults = (
            self._judge_fall(gravity_b, expected, state.time),
            self._judge_tilt(gravity_b, expected, state.time),
            self._judge_progress(state, angles),
            self._servos.judge(state),
        )
        for kind, detail in filter(None, faults):
            return Abort(kind, detail, time)
        return None

    def _expect(self, time: float) -> tuple[Array, Array]:
        """Interpolate where the motion has gravity (3,) and the joints (n,) at a time [s]."""
        times = self._motion.time - self._motion.time[0]
        time = min(max(time, 0.0), float(times[-1]))
        after = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
        if len(times) == 1:
            return self._gravity_b[0], self._motion.joint_pos[0]
        share = (time - times[after - 1]) / (times[after] - times[after - 1])

        def between(rows: Array) -> Array:
            return rows[after - 1] + share * (rows[after] - rows[after - 1])

        return between(self._gravity_b), between(self._motion.joint_pos)

    def _judge_fall(
        self, gravity_b: Array, expected: Array, time: float
    ) -> tuple[AbortKind, str] | None:
        tilt, wanted = _tilt(gravity_b), _tilt(expected)
        self._is_up = up = tilt < UPRIGHT and wanted < UPRIGHT
        self._was_up |= self._upright.update(up, time).item() > UPRIGHT_TIME
        down = self._was_up and wanted < UPRIGHT and tilt > self._limits.fallen
        if self._falling.update(down, time).item() > self._limits.fallen_time:
            return AbortKind.FELL, f"tilt {math.degrees(tilt):.0f}°"
        return None

    def _judge_tilt(
        self, gravity_b: Array, expected: Array, time: float
    ) -> tuple[AbortKind, str] | None:
        limits, off = self._limits, angle(gravity_b, expected)
        wrong = limits.tracks_motion and off > limits.tilt
        if self._tilted.update(wrong, time).item() > limits.tilt_time:
            return AbortKind.TILT, (
                f"{math.degrees(off):.0f}° off, allowed {math.degrees(limits.tilt):.0f}° "
                f"for {limits.tilt_time:g} s"
            )
        return None

    def _judge_progress(self, state: State, expected: Array) -> tuple[AbortKind, str] | None:
        limits = self._limits
        # A servo's target lies beyond its angle to make torque, so both must be far.
        error = np.minimum(
            np.abs(self._target - state.joint_pos), np.abs(expected - state.joint_pos)
        )
        stuck = limits.tracks_motion & (error > limits.error) & (np.abs(state.joint_vel) < SLOW)
        # Upright at the end, with weak servos, the feet may stay further apart than asked for:
        # whether that is a stand is the judge's to say.
        stuck &= not self._is_up
        lasting = self._stuck.update(stuck, state.time)
        if lasting.max() > limits.error_time:
            worst = int(lasting.argmax())
            return AbortKind.STUCK, (
                f"joint '{self.robot.joint_names[worst]}' stands {error[worst]:.2f} rad from "
                f"where it should be, allowed {limits.error:g} rad for {limits.error_time:g} s"
            )
        return None


def angle(a: Array, b: Array) -> float:
    """Compute the angle between two directions [rad], of any length."""
    cosine = float(a @ b) / math.sqrt(float(a @ a) * float(b @ b))
    return math.acos(min(max(cosine, -1.0), 1.0))


def _tilt(gravity_b: Array) -> float:
    return angle(gravity_b, DOWN)


class PolicySupervisor:
    """Runs a policy and watches, each cycle, load and heat of the servos.

    Nobody knows how a policy will move, and one that falls may get up by itself, so neither
    tilt nor progress is held against it; its own time limit is.
    """

    def __init__(self, policy: OnnxPolicy, supervision: MonitorLimits | None = None) -> None:
        """Prepare to run a policy; ``None`` for the default limits."""
        self._policy = policy
        self._servos = ServoMonitor(policy.robot, supervision or MonitorLimits())
        self.longest = policy.longest
        """Time after which it is done [s]."""
        self.aborted: Abort | None = None

    @property
    def warnings(self) -> list[str]:
        """Return what was odd but no reason to stop."""
        return self._servos.warnings

    @property
    def done(self) -> bool:
        """Tell whether the policy is done or was given up."""
        return self.aborted is not None or self._policy.done

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._policy.reset(state)
        self._servos.reset(state)
        self._begin = state.time
        self.aborted = None

    def step(self, state: State) -> Command:
        """Let the policy move the robot, or release every joint."""
        command = self._policy.step(state)
        found = self._servos.judge(state)
        if found is None and self._policy.fault is not None:
            found = AbortKind.POLICY, self._policy.fault
        if found is None:
            return command
        self.aborted = Abort(*found, state.time - self._begin)
        return Command.limp(command.n)
