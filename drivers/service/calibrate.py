"""Measures servo zeros and directions while a person holds and turns the robot."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from pathlib import Path
from typing import Protocol

import numpy as np

from drivers.dynamixel.board import Board
from drivers.dynamixel.control_table import DriveMode, table_named
from drivers.dynamixel.diagnostics import DiagnosticsError, name_all, name_of
from drivers.dynamixel.protocol2 import is_confirmed
from drivers.errors import DriverError, SetupError
from drivers.imu.source import ImuSource
from drivers.service.session import RobotBus
from drivers.servo_units import fits_one_turn, tick_range
from robots import Joint, Robot, quaternion
from robots.description.calibration import Calibration, JointCalibration
from robots.imu import AxesSetting, SensorAxes, find_axes_problems
from robots.kinematics import find_directions, imu_in_torso
from robots.quaternion import Array
from robots.servo import TICKS_PER_TURN
from robots.storage.validation import Sign

READS = 20  # per joint; the median counts
PAUSE = 0.02  # s between two reads: a moving hand shows within 0.4 s
STILL = 4  # ticks that the reads may differ by, 0.35 degrees
LARGE_SHIFT = 10.0  # degrees by which a zero may move without a warning
TURN = 20  # degrees to turn a joint by
LEAST_TURN = 5.0  # degrees; less may be a wobble
MOST_TILT = 20.0  # degrees; a person holds a robot straighter, and axes differ by 90
SIGNED = ("x", "y", "z", "-x", "-y", "-z")
AXES = [axes for axes in permutations(SIGNED, 3) if not find_axes_problems("axes", axes)]
TRIES = 3  # measurements of a robot that is not held still; reads of a silent servo
DEG_PER_TICK = 360.0 / TICKS_PER_TURN


class Prompt(Protocol):
    """A person at the robot."""

    def tell(self, text: str) -> None:
        """Show a line of text."""
        ...

    def ask(self, question: str) -> str:
        """Show a question and wait for a line of input."""
        ...


@dataclass(frozen=True)
class JointMeasurement:
    """Zero and direction of one joint, as measured."""

    joint: Joint
    """As known before."""
    zero_ticks: int
    sign: Sign

    @property
    def shift(self) -> float:
        """Return how far the zero of the joint moves [degrees]."""
        turn = (self.zero_ticks - self.joint.servo.zero_ticks) * DEG_PER_TICK
        return turn / self.joint.servo.gear

    @property
    def is_reversed(self) -> bool:
        """Return whether the servo turns the other way than known before."""
        return self.sign != self.joint.servo.sign

    @property
    def ticks(self) -> tuple[int, int]:
        """Return the lowest and highest ticks of the joint's range."""
        servo = replace(self.joint.servo, zero_ticks=self.zero_ticks, sign=self.sign)
        return tick_range(replace(self.joint, servo=servo))

    @property
    def is_out_of_reach(self) -> bool:
        """Return whether its servo can be sent to its whole range with another zero alone."""
        counts = table_named(self.joint.servo.model.name).counts_turns
        first, last = self.ticks
        is_wider_than_a_turn = last - first > TICKS_PER_TURN - 1  # with any zero
        return not (counts or fits_one_turn(self.ticks) or is_wider_than_a_turn)

    @property
    def warnings(self) -> list[str]:
        """List what a person should check before this is saved."""
        warnings = []
        if abs(self.shift) > LARGE_SHIFT:
            warnings.append(
                f"its zero moves by {self.shift:+.1f}°, more than {LARGE_SHIFT:.0f}°: is the robot "
                "in that posture, and the horn mounted correctly?"
            )
        if self.is_reversed:
            warnings.append(f"it turns the other way than known before: sign {self.sign:+d}")
        if not fits_one_turn(self.ticks):
            first, last = self.ticks
            warnings.append(
                f"its range needs ticks {first} to {last}, beyond one turn of its servo: programs "
                f"that do not count turns reach 0 to {TICKS_PER_TURN - 1}"
            )
        return warnings


class Calibrator:
    """Measures a robot without torque that a person holds and turns."""

    def __init__(self, bus: RobotBus, joints: Sequence[Joint]) -> None:
        """Prepare to calibrate some joints of a robot."""
        self._bus, self._robot = bus, bus.robot
        self._measured = {
            j.name: JointMeasurement(j, j.servo.zero_ticks, j.servo.sign) for j in joints
        }

    @property
    def measured(self) -> tuple[JointMeasurement, ...]:
        """Return the measurements so far, in the order of the joints."""
        return tuple(self._measured.values())

    def check(self) -> None:
        """Check that the chosen joints' servos reply and can be calibrated."""
        for joint in (measured.joint for measured in self.measured):
            if joint.servo.model.ticks_per_turn != TICKS_PER_TURN:
                raise SetupError(
                    f"{name_of(joint)} is a {joint.servo.model.name}, expected a servo of "
                    f"{TICKS_PER_TURN} counts a turn: write zero_ticks and sign into robot.toml"
                )
        found = self._bus.diagnose(tuple(m.joint for m in self.measured))
        usable = {
            s.name for s in found.servos if not s.registers.get("drive_mode", 0) & DriveMode.REVERSE
        }
        blocking = [
            finding
            for finding in found.errors
            if finding.device not in usable and finding not in self._bus.findings
        ]
        if blocking:
            raise DiagnosticsError(blocking)

    def measure_zeros(self, joint_pos: Array, orientation: Array | None = None) -> None:
        """Compute zeros from the present positions at known angles [rad], (n,)."""
        ticks = measure_ticks(self._bus, [m.joint for m in self.measured])
        if orientation is not None and self._bus.imu is not None:
            check_tilt(self._robot, self._bus.imu, orientation)
        turned = self._robot.transmission.to_actuator(joint_pos)
        for name, measured in self._measured.items():
            angle = float(turned[self._robot.joint_names.index(name)])
            zero = ticks[name] - round(measured.sign * angle / measured.joint.servo.rad_per_tick)
            self._measured[name] = replace(measured, zero_ticks=zero)

    def check_signs(self, prompt: Prompt) -> None:
        """Find each servo's direction while a person turns the joints one by one."""
        for name, measured in self._measured.items():
            sign = self._find_sign(measured.joint, prompt)
            if sign is not None:
                self._measured[name] = replace(measured, sign=sign)

    def _find_sign(self, joint: Joint, prompt: Prompt) -> Sign | None:
        way = find_directions(self._robot)[joint.name]
        alone = np.eye(self._robot.n)[self._robot.joint_names.index(joint.name)]
        while True:
            prompt.tell(f"{joint.name}: hold everything still, then turn it as described")
            before = read_ticks(self._bus, self._robot.actuators)
            answer = prompt.ask(
                f"turn {joint.name} in its positive direction ({way}) by about {TURN} degrees, "
                "then Enter (s skips it):"
            )
            if answer.strip().lower() == "s":
                return None
            after = read_ticks(self._bus, self._robot.actuators)
            turns = {name: _unwrap(after[name] - before[name]) * DEG_PER_TICK for name in before}
            turn = turns[joint.name]
            if abs(turn) < LEAST_TURN:
                prompt.tell(_describe_small_turn(joint, turns))
                continue
            own = float(self._robot.transmission.to_actuator(alone) @ alone)
            sign = 1 if turn * own > 0.0 else -1
            prompt.tell(f"{joint.name}: {turn:+.1f}° by its encoder, so its sign is {sign:+d}")
            if sign == joint.servo.sign:
                return sign
            answer = prompt.ask(
                f"{joint.name}: sign {sign:+d} contradicts the known {joint.servo.sign:+d}; "
                "yes accepts it, anything else repeats the turn:"
            )
            if is_yes(answer):
                return sign


def check_tilt(robot: Robot, imu: ImuSource, orientation: Array) -> None:
    """Check that an IMU, if it replies, measures gravity as in a torso of an orientation (4,)."""
    if (sample := imu.measure()) is None:
        return
    key, setting = "imu.axes", robot.imu.axes if robot.imu else AXES[0]
    if isinstance(imu, Board):
        key, setting = "bus.board.imu_axes", imu.settings.imu_axes
    mounting = imu_in_torso(robot, robot.read_model().compile())
    up = -quaternion.gravity_in_body(quaternion.multiply(orientation, mounting))
    force = SensorAxes.of(setting).to_sensor(sample.accelerometer)

    def find_tilt(axes: AxesSetting) -> float:
        cosine = SensorAxes.of(axes).to_site(force) @ up / np.linalg.norm(force)
        return math.degrees(math.acos(np.clip(cosine, -1.0, 1.0)))

    if find_tilt(setting) <= MOST_TILT:
        return
    fitting = " or ".join(json.dumps(axes) for axes in AXES if find_tilt(axes) <= MOST_TILT)
    raise SetupError(
        f"{imu.name}: gravity is {find_tilt(setting):.0f}° from that of the posture, expected at "
        f"most {MOST_TILT:.0f}°: hold the torso as in the posture"
        f"{f', or set {key} in robot.toml to {fitting}' if fitting else ''}; nothing is saved"
    )


def measure_ticks(bus: RobotBus, joints: Sequence[Joint]) -> dict[str, int]:
    """Measure the positions [ticks] of joints that are held still."""
    reads: list[dict[str, int]] = []
    for i in range(READS):
        if i:
            time.sleep(PAUSE)
        reads.append(read_ticks(bus, joints))
    ticks = {j.name: np.array([read[j.name] for read in reads]) for j in joints}
    moving = [(j, int(np.ptp(ticks[j.name]))) for j in joints if np.ptp(ticks[j.name]) > STILL]
    if moving:
        moved = ", ".join(f"joint '{j.name}' by {n * DEG_PER_TICK:.1f}°" for j, n in moving)
        raise SetupError(
            f"the robot moves while it is measured: {moved}, "
            f"expected at most {STILL * DEG_PER_TICK:.1f}°; hold or prop it still"
        )
    return {name: round(float(np.median(values))) for name, values in ticks.items()}


def read_ticks(bus: RobotBus, joints: Sequence[Joint]) -> dict[str, int]:
    """Read the positions of joints once [ticks]."""
    ticks: dict[str, int] = {}
    for _ in range(TRIES):
        for port in bus.ports:
            missing = {j.servo.id: j for j in port.joints if j in joints and j.name not in ticks}
            if not missing:
                continue
            items = {
                i: table_named(j.servo.model.name)["present_position"] for i, j in missing.items()
            }
            replies = port.bus.request(port.bus.group({i: item.span for i, item in items.items()}))
            for device, status in replies.items():
                if is_confirmed(status):
                    ticks[missing[device].name] = items[device].decode(status.data)
        if len(ticks) == len(joints):
            return ticks
    silent = name_all([joint for joint in joints if joint.name not in ticks])
    raise SetupError(f"{silent}: silent; check cable and power (getup doctor)")


def check_ranges(measured: Sequence[JointMeasurement]) -> None:
    """Check that every joint can reach its range within one turn of its servo, if any zero can."""
    ranges = ", ".join(
        f"{name_of(m.joint)}: zero {m.zero_ticks} needs ticks {m.ticks[0]} to {m.ticks[1]}"
        for m in measured
        if m.is_out_of_reach
    )
    if ranges:
        raise DriverError(
            f"{ranges}, expected 0 to {TICKS_PER_TURN - 1}: bring the robot into the posture, or "
            "remount the horn; nothing is saved"
        )


def save(robot: Robot, measured: Sequence[JointMeasurement], path: Path) -> Calibration:
    """Write measurements into a calibration file; its other joints stay as they are."""
    old = Calibration.load(path, robot).joints if path.exists() else {}
    new = {m.joint.name: JointCalibration(zero_ticks=m.zero_ticks, sign=m.sign) for m in measured}
    joints = {name: (old | new)[name] for name in robot.joint_names if name in old or name in new}
    calibration = Calibration(robot=robot.name, joints=joints)
    calibration.save(path)
    return calibration


def is_yes(answer: str) -> bool:
    """Return whether an answer agrees."""
    return answer.strip().lower() in ("y", "yes")


def _describe_small_turn(joint: Joint, turns: dict[str, float]) -> str:
    """Report that a joint was not turned, and which was instead."""
    text = f"{joint.name} turned by {turns[joint.name]:+.1f}° only, expected {LEAST_TURN:.0f}°"
    most = max(turns, key=lambda name: abs(turns[name]))
    if abs(turns[most]) < 2.0 * LEAST_TURN:
        return text
    return (
        f"{text}; {most} turned by {turns[most]:+.1f}°: are their ids swapped ({name_of(joint)})?"
    )


def _unwrap(ticks: int) -> int:
    """Return a difference of ticks the short way round."""
    half = TICKS_PER_TURN // 2
    return (ticks + half) % TICKS_PER_TURN - half
