"""The supervisor: plays a motion and gives up, limp, when the rise goes wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from drivers import Command, State
from humanoid_getup.motion import Motion
from humanoid_getup.player import MotionPlayer
from humanoid_getup.sensed import GravitySense
from humanoid_getup.stage import Stage
from humanoid_getup.standing import HOLD_TIME
from robots import rotation
from robots.rotation import Array

HOLD = HOLD_TIME + 1.5  # s after the motion; a robot may sway before its stand begins
UPRIGHT = np.radians(25.0)  # tilt under which a robot counts as up
UPRIGHT_TIME = 0.3  # s of it
SLOW = 0.2  # rad/s of a joint that is stuck
DOWN = np.array([0.0, 0.0, -1.0])


class AbortKind(Enum):
    """Why a rise was given up."""

    TILT = "the torso is not turned as the motion expects"
    FELL = "the robot was up and is falling"
    STUCK = "a joint does not follow"
    LOAD = "a servo has pushed near its stall torque for too long"
    HEAT = "a servo is too hot"


@dataclass(frozen=True)
class Abort:
    """Why and when a rise was given up."""

    kind: AbortKind
    detail: str
    time: float
    """Since the motion was started [s]."""

    def __str__(self) -> str:
        return f"{self.kind.value}: {self.detail}"


@dataclass(frozen=True, kw_only=True)
class Supervision:
    """How far, and for how long, a rise may differ from what its motion expects.

    Measured on the twin, through the sensors, on 24 planned rises (six seeds of each
    class): played undisturbed; with starts, friction 0.45 to 1.1, supply 11.0 to 12.6 V and
    sensor noise disturbed (72, of which 71 stood); and pushed, played from another fall,
    with weak servos, or on ice (friction 0.15). What is told beside each figure is the
    worst of the undisturbed / of the disturbed ones that stood, then of the falls.
    """

    tilt: float = np.radians(60.0)
    """Angle between measured and expected gravity in the torso [rad].

    21 deg / 59 deg; of 27 falls by push, disturbance or another start 26 were beyond it for
    more than 3.9 s. On ice 0.22 s beyond it still ended standing.
    """
    tilt_time: float = 0.5
    """[s]"""
    fallen: float = np.radians(40.0)
    """Tilt of a robot that was up and should be [rad]. 17 deg / 18 deg; falls 80 and more."""
    fallen_time: float = 0.02
    """[s]; a robot that tips is another 25 deg lower a tenth of a second later."""
    error: float = 0.4
    """Distance of a slow joint both from its target and from where it should be [rad].

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
    temperature: float = 72.0
    """[°C]; 27 °C from 25 °C, so a rise that begins cool never comes near. The guard's
    limit of 75 °C lies above it."""
    tracks_motion: bool = True
    """False for a motion that no rehearsal went through: its angles are only a wish, so
    tilt and stuck joints are not held against it."""


class Supervisor:
    """Plays a motion and watches, each cycle, what the sensors tell of the rise.

    It commands limp once and is done as soon as something has been wrong for too long.
    ``warnings`` tells what was odd but no reason to stop.
    """

    def __init__(
        self,
        stage: Stage,
        motion: Motion,
        *,
        hold: float = HOLD,
        torque_limit: float | None = None,
        supervision: Supervision | None = None,
    ) -> None:
        """Prepare to play.

        Args:
            stage: Robot and how its IMU sits in it.
            motion: What to play.
            hold: How long to hold the last targets [s].
            torque_limit: Cap on every servo [N·m].
            supervision: What is too much; ``None`` for the defaults.
        """
        self.robot, self._motion = stage.robot, motion
        self._sense_gravity = GravitySense(stage)
        self._player = MotionPlayer(stage.robot, motion, hold=hold, torque_limit=torque_limit)
        self._limits = supervision or Supervision()
        self._gravity_b = rotation.gravity_in_body(motion.orientation)  # (T, 3)
        models = [joint.servo.model for joint in stage.robot.joints]
        self._stall_per_volt = np.array([m.stall_current / m.nominal_voltage for m in models])
        self._min_voltage = max(m.min_voltage for m in models)
        self.aborted: Abort | None = None
        self.warnings: list[str] = []

    @property
    def done(self) -> bool:
        """Tell whether the motion and the hold are over, or were given up."""
        return self.aborted is not None or self._player.done

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._player.reset(state)
        self._begin = state.time
        self._target = state.joint_pos
        self.aborted, self.warnings = None, []
        self._tilted = _Lasting(1, state.time)
        self._upright = _Lasting(1, state.time)
        self._falling = _Lasting(1, state.time)
        self._is_up = False
        self._stuck = _Lasting(self.robot.n, state.time)
        self._loaded = _Lasting(self.robot.n, state.time)
        self._was_up = False

    def step(self, state: State) -> Command:
        """Send the targets that are due, or release every joint."""
        self.aborted = self._find_abort(state)
        self._warn(state)
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
            self._judge_load(state),
            self._judge_heat(state),
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

    def _judge_load(self, state: State) -> tuple[AbortKind, str] | None:
        limits = self._limits
        stall = self._stall_per_volt * max(state.voltage, 1.0)
        load = np.abs(state.joint_current) / stall
        lasting = self._loaded.update(load > limits.load, state.time)
        if lasting.max() > limits.load_time:
            worst = int(lasting.argmax())
            return AbortKind.LOAD, (
                f"joint '{self.robot.joint_names[worst]}' draws {load[worst]:.0%} of its stall "
                f"current, allowed {limits.load:.0%} for {limits.load_time:g} s"
            )
        return None

    def _judge_heat(self, state: State) -> tuple[AbortKind, str] | None:
        worst = int(state.temperature.argmax())
        if state.temperature[worst] > self._limits.temperature:
            return AbortKind.HEAT, (
                f"joint '{self.robot.joint_names[worst]}' has {state.temperature[worst]:.0f} °C, "
                f"allowed {self._limits.temperature:.0f} °C"
            )
        return None

    def _warn(self, state: State) -> None:
        if state.voltage < self._min_voltage and not self.warnings:
            self.warnings.append(
                f"the supply sagged to {state.voltage:.1f} V, the servos need "
                f"{self._min_voltage:.1f} V: charge the battery"
            )


class _Lasting:
    """For how long each of some conditions has held without a break."""

    def __init__(self, n: int, time: float) -> None:
        self._since = np.full(n, time)

    def update(self, holds: NDArray[np.bool_] | bool, time: float) -> Array:
        """Return how long each has held by now [s], shape (n,)."""
        self._since = np.where(holds, self._since, time)
        return time - self._since


def angle(a: Array, b: Array) -> float:
    """Compute the angle between two directions [rad], of any length."""
    cosine = float(a @ b) / math.sqrt(float(a @ a) * float(b @ b))
    return math.acos(min(max(cosine, -1.0), 1.0))


def _tilt(gravity_b: Array) -> float:
    return angle(gravity_b, DOWN)
