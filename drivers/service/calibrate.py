"""Calibration with a person at the robot: where each zero is, and which way each servo turns."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

import mujoco
import numpy as np

from drivers.dynamixel.bus import Request
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import REVERSED, DiagnosticsError, Finding, name_all, name_of
from drivers.errors import SetupError
from drivers.service.session import RobotBus
from robots import Joint, Robot
from robots.calibration import Calibration, JointCalibration
from robots.quaternion import Array
from robots.servo import RAD_PER_TICK, TICKS_PER_TURN

UPRIGHT_AXIS = 0.8  # share of an axis that points up from which a joint is told as a turn
WAYS = (("backward", "forward"), ("to its right", "to its left"), ("down", "up"))
"""Negative and positive of the robot's x, y and z when it stands."""


def describe_direction(robot: Robot, joint: Joint) -> str:
    """Tell which way the limb behind a joint goes when its angle grows, for a standing robot.

    x is taken to point forward and y to the left, as is the custom.
    """
    axis, lever = _find_axis(robot, joint)
    if abs(axis[2]) > UPRIGHT_AXIS:
        way = "counter-clockwise" if axis[2] > 0.0 else "clockwise"
        return f"seen from above, its limb turns {way}"
    motion = np.array(
        [
            axis[1] * lever[2] - axis[2] * lever[1],
            axis[2] * lever[0] - axis[0] * lever[2],
            axis[0] * lever[1] - axis[1] * lever[0],
        ]
    )
    largest = int(np.abs(motion).argmax())
    return f"the far end of its limb goes {WAYS[largest][int(motion[largest] > 0.0)]}"


def _find_axis(robot: Robot, joint: Joint) -> tuple[Array, Array]:
    """Return a joint's axis, (3,), and where its limb ends as seen from it [m], (3,)."""
    model = robot.spec().compile()
    data = mujoco.MjData(model)
    layout, standing = robot.layout(model), robot.standing
    data.qpos[layout.root_qpos : layout.root_qpos + 3] = standing.position
    data.qpos[layout.root_qpos + 3 : layout.root_qpos + 7] = standing.orientation
    data.qpos[layout.qpos] = standing.joint_pos
    mujoco.mj_kinematics(model, data)
    number = model.joint(joint.name).id
    anchor = data.xanchor[number]
    limb = _list_below(model, int(model.jnt_bodyid[number]))
    levers = [
        data.geom_xpos[geom] - anchor
        for geom in range(model.ngeom)
        if int(model.geom_bodyid[geom]) in limb
    ]
    lever = max(levers, key=lambda v: math.hypot(*v), default=np.array([0.0, 0.0, -1.0]))
    return data.xaxis[number].copy(), lever


def _list_below(model: mujoco.MjModel, body: int) -> set[int]:
    """Return a body and all that hang on it."""
    below = {body}
    for other in range(body + 1, model.nbody):  # parents come first
        if int(model.body_parentid[other]) in below:
            below.add(other)
    return below


READS = 20  # of every joint, of which the median counts
PAUSE = 0.02  # s between two of them: a hand that moves is seen in 0.4 s
STILL = 4  # ticks that they may differ by, 0.35 degrees
FAR = 10.0  # degrees of a zero's shift from which a person should look twice
TURN = 20  # degrees to turn a joint by
LEAST_TURN = 5.0  # degrees that tell a direction from a wobble
PATIENCE = 3  # measurements of a robot that is not held still
DEG_PER_TICK = 360.0 / TICKS_PER_TURN


class Prompt(Protocol):
    """Somebody at the robot who is told things and answers."""

    def tell(self, text: str) -> None:
        """Say something."""
        ...

    def ask(self, question: str) -> str:
        """Ask something and wait for the line of the answer."""
        ...


class MovingError(SetupError):
    """A robot was not held still while it was measured."""

    def __init__(self, joints: Sequence[tuple[Joint, int]]) -> None:
        told = ", ".join(f"joint '{j.name}' by {ticks * DEG_PER_TICK:.1f}°" for j, ticks in joints)
        super().__init__(
            f"the robot moves while it is measured: {told}, allowed {STILL * DEG_PER_TICK:.1f}°; "
            "hold or prop it still"
        )
        self.joints = tuple(joint.name for joint, _ in joints)


class SilentError(SetupError):
    """Servos did not tell where they are."""

    def __init__(self, joints: Sequence[Joint]) -> None:
        super().__init__(f"{name_all(joints)}: silent; check cable and power (getup doctor)")


@dataclass(frozen=True)
class Found:
    """What was found of one joint."""

    joint: Joint
    """As it was known before."""
    zero_ticks: int
    sign: int

    @property
    def shift(self) -> float:
        """Return how far the zero has moved from where it was thought [degrees]."""
        return (self.zero_ticks - self.joint.servo.zero_ticks) * DEG_PER_TICK

    @property
    def is_far(self) -> bool:
        """Tell whether the zero is so far off that something else may be wrong."""
        return abs(self.shift) > FAR

    @property
    def is_turned(self) -> bool:
        """Tell whether the servo turns the other way than was thought."""
        return self.sign != self.joint.servo.sign

    @property
    def reach(self) -> tuple[int, int]:
        """Return the ticks that the joint's range needs."""
        servo = replace(self.joint.servo, zero_ticks=self.zero_ticks, sign=self.sign)
        first, last = sorted(
            servo.to_ticks(limit) for limit in (self.joint.lower, self.joint.upper)
        )
        return first, last

    @property
    def warnings(self) -> list[str]:
        """Tell what a person should look at before this is kept."""
        warnings = []
        if self.is_far:
            warnings.append(
                f"its zero moves by {self.shift:+.1f}°, more than {FAR:.0f}°: is the robot in "
                "that posture, and the horn mounted right?"
            )
        if self.is_turned:
            warnings.append(f"it turns the other way than was thought: sign {self.sign:+d}")
        first, last = self.reach
        if first < 0 or last >= TICKS_PER_TURN:
            warnings.append(
                f"its range needs ticks {first} to {last}, allowed 0 to {TICKS_PER_TURN - 1}: "
                "mount its horn anew"
            )
        return warnings


class Calibrator:
    """Measures a limp robot that a person holds and turns."""

    def __init__(self, bus: RobotBus, joints: Sequence[Joint]) -> None:
        """Prepare to calibrate some joints of a robot."""
        self._bus, self._robot = bus, bus.robot
        self._found = {j.name: Found(j, j.servo.zero_ticks, j.servo.sign) for j in joints}

    @property
    def found(self) -> tuple[Found, ...]:
        """Return what was found so far, in the order of the joints."""
        return tuple(self._found.values())

    def check(self) -> None:
        """Look whether the chosen joints' servos are there and can be calibrated.

        Raises:
            AuditError: telling of all that cannot.
        """
        joints = tuple(found.joint for found in self.found)
        told = self._bus.look(joints)
        usable = {s.name for s in told.servos if not s.registers["drive_mode"] & REVERSED}
        blocking: list[Finding] = [
            finding
            for finding in told.errors
            if finding.device not in usable and finding not in self._bus.findings
        ]
        if blocking:
            raise DiagnosticsError(blocking)

    def release(self) -> None:
        """Make every joint of the robot limp that has torque.

        Raises:
            AuditError: naming those that do not confirm it.
        """
        self._bus.release(self._bus.find_torque())

    def measure_zeros(self, joint_pos: Array) -> None:
        """Take where the joints are now for known angles [rad], (n,) in the robot's joint order.

        Raises:
            MovingError: when the robot is not still.
        """
        joints = [found.joint for found in self.found]
        ticks = measure(self._bus, joints)
        for name, found in self._found.items():
            angle = float(joint_pos[self._robot.joint_names.index(name)])
            zero = ticks[name] - round(found.sign * angle / RAD_PER_TICK)
            self._found[name] = replace(found, zero_ticks=zero)

    def check_signs(self, prompt: Prompt) -> None:
        """Let a person turn each joint, and see which way its servo counts."""
        for name in self._found:
            sign = self._ask_sign(self._found[name].joint, prompt)
            if sign is not None:
                self._found[name] = replace(self._found[name], sign=sign)

    def _ask_sign(self, joint: Joint, prompt: Prompt) -> int | None:
        """Find the sign of one joint; ``None`` when the person leaves it as it is."""
        way = describe_direction(self._robot, joint)
        while True:
            prompt.tell(f"{joint.name}: hold everything still, then turn it as told")
            before = locate(self._bus, self._robot.joints)
            answer = prompt.ask(
                f"turn {joint.name} in its positive direction ({way}) by about {TURN} degrees, "
                "then Enter (s leaves it as it is):"
            )
            if answer.strip().lower() == "s":
                return None
            after = locate(self._bus, self._robot.joints)
            turns = {name: _unwrap(after[name] - before[name]) * DEG_PER_TICK for name in before}
            turn = turns[joint.name]
            if abs(turn) < LEAST_TURN:
                prompt.tell(_describe_idle(joint, turn, turns))
                continue
            sign = 1 if turn > 0.0 else -1
            prompt.tell(f"{joint.name}: {turn:+.1f}° by its encoder, so its sign is {sign:+d}")
            if sign == joint.servo.sign:
                return sign
            answer = prompt.ask(
                f"{joint.name}: sign {sign:+d} contradicts the known {joint.servo.sign:+d}; "
                "yes takes it, anything else turns the joint again:"
            )
            if is_yes(answer):
                return sign


def measure(bus: RobotBus, joints: Sequence[Joint]) -> dict[str, int]:
    """Measure the ticks of joints that are held still.

    Raises:
        MovingError: naming those that are not.
        SilentError: naming those that do not answer.
    """
    looks: list[dict[str, int]] = []
    for i in range(READS):
        if i:
            time.sleep(PAUSE)
        looks.append(locate(bus, joints))
    ticks = {j.name: np.array([look[j.name] for look in looks]) for j in joints}
    moving = [(j, int(np.ptp(ticks[j.name]))) for j in joints if np.ptp(ticks[j.name]) > STILL]
    if moving:
        raise MovingError(moving)
    return {name: round(float(np.median(values))) for name, values in ticks.items()}


def locate(bus: RobotBus, joints: Sequence[Joint], tries: int = PATIENCE) -> dict[str, int]:
    """Read the ticks of joints once.

    Raises:
        SilentError: naming those that do not answer, asked several times.
    """
    ticks: dict[str, int] = {}
    for _ in range(tries):
        for line in bus.lines:
            asked = {j.servo.id: j for j in line.joints if j in joints and j.name not in ticks}
            if not asked:
                continue
            items = {
                i: table_named(j.servo.model.name)["present_position"] for i, j in asked.items()
            }
            told = line.bus.put(Request.group({i: item.span for i, item in items.items()}))
            for device, status in told.items():
                if not status.number and len(status.data) == items[device].size:
                    ticks[asked[device].name] = items[device].decode(status.data)
        if len(ticks) == len(joints):
            return ticks
    raise SilentError([joint for joint in joints if joint.name not in ticks])


def save(robot: Robot, found: Sequence[Found], path: Path) -> Calibration:
    """Write what was found into a robot's calibration; joints not found anew stay as they are.

    Raises:
        OSError: when the file cannot be written.
        CalibrationError: when there is a file that is damaged or another robot's.
    """
    old = Calibration.load(path, robot).joints if path.exists() else {}
    new = {f.joint.name: JointCalibration(zero_ticks=f.zero_ticks, sign=f.sign) for f in found}
    joints = {name: (old | new)[name] for name in robot.joint_names if name in old or name in new}
    calibration = Calibration(robot=robot.name, joints=joints)
    calibration.save(path)
    return calibration


def is_yes(answer: str) -> bool:
    """Tell whether an answer agrees."""
    return answer.strip().lower() in ("y", "yes")


def _describe_idle(joint: Joint, turn: float, turns: dict[str, float]) -> str:
    """Tell that a joint was not turned, and which was instead."""
    told = f"{joint.name} turned by {turn:+.1f}° only, at least {LEAST_TURN:.0f}° are needed"
    most = max(turns, key=lambda name: abs(turns[name]))
    if abs(turns[most]) < 2.0 * LEAST_TURN:
        return told
    return (
        f"{told}; {most} turned by {turns[most]:+.1f}°: are their ids exchanged ({name_of(joint)})?"
    )


def _unwrap(ticks: int) -> int:
    """Return a difference of ticks the short way round."""
    half = TICKS_PER_TURN // 2
    return (ticks + half) % TICKS_PER_TURN - half
