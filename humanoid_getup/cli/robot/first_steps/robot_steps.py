"""Steps of the first connection of a robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivers.service.calibrate import TURN
from humanoid_getup.cli.robot.first_steps.step import FirstStep
from humanoid_getup.motions.motion_database import (
    list_lying_down,
    list_motions,
    load_database,
)
from robots import Robot
from robots.imu import IMU_PORT

LITTLE, GENTLE = 0.3, 0.6  # shares of the strongest servo's stall torque: in the air, and to rise
SIDE = "supine"  # on which the robot lies for its first rise


@dataclass(frozen=True, kw_only=True)
class RobotAtPort:
    """A robot on its ports, and what is known of it."""

    robot: Robot
    chosen: str
    """Robot as the command line names it."""
    port: tuple[str, ...]
    """Ports as the command line names them."""
    out: Path
    """Folder of flight logs and reports."""
    torque_limit: float | None = None
    """Torque limit of the first rise [N·m]; None for a share of the stall torque."""
    voltage: float | None = None
    """Supply that was measured [V]; None if it is not known yet."""


def list_robot_steps(known: RobotAtPort) -> Iterator[FirstStep]:
    """List the steps in their order."""
    yield from _list_checks(known)
    yield from _list_limp(known)
    yield from _list_in_the_air(known)
    yield from _list_on_the_ground(known)


def _on_robot(known: RobotAtPort) -> tuple[str, ...]:
    return ("--robot", known.chosen, "--port", ",".join(known.port))


def _list_checks(known: RobotAtPort) -> Iterator[FirstStep]:
    """List the steps that look and set up."""
    first, *_ = [word for word in known.port if not word.startswith(f"{IMU_PORT}=")]
    yield FirstStep(
        name="scan",
        aim="Find the devices on the port: one line for each servo.",
        words=("scan", "--port", first.rpartition("=")[2]),
        before="Supply the servos; close other programs on the port.",
        is_optional=True,
    )
    yield FirstStep(
        name="ids",
        aim="Give each servo its id and baud rate, one at a time.",
        words=("servo", "setup", *_on_robot(known)),
        before="Skip it unless the scan lacks an id, or shows one twice.",
        is_optional=True,
    )
    yield FirstStep(
        name="doctor",
        aim="Check every servo, the IMU and the timing; nothing moves.",
        words=("doctor", *_on_robot(known), "--json", str(known.out / DOCTOR_FILE)),
    )


def _list_limp(known: RobotAtPort) -> Iterator[FirstStep]:
    """List the steps with a limp robot in a person's hands."""
    yield FirstStep(
        name="signs",
        aim="Measure which way each servo turns.",
        words=("calibrate", *_on_robot(known), "--signs"),
        before="Hang the robot up, or lay it down; then turn one joint after the other.",
        at_bus=f"hang {_find_room(known.robot)}, and what is asked for, such as turn l_knee:20",
        is_optional=True,
    )
    is_zero_possible = bool(((known.robot.lower <= 0.0) & (known.robot.upper >= 0.0)).all())
    posture = "zero" if is_zero_possible else "standing"
    yield FirstStep(
        name="zeros",
        aim="Measure the zeros of the servos.",
        words=("calibrate", *_on_robot(known), "--at", posture),
        before="Hold the robot with "
        + ("all joints at 0." if is_zero_possible else "its joints as it stands."),
        at_bus=f"hold {posture}",
        is_optional=True,
    )
    yield FirstStep(
        name="watch",
        aim="Compare angles and IMU with the robot; torque is off.",
        words=("watch", "--backend", "dynamixel", *_on_robot(known)),
        before="Turn joints by hand and lay the robot on each side; q ends it.",
        at_bus="turn JOINT:DEG, or lay left",
    )


def _list_in_the_air(known: RobotAtPort) -> Iterator[FirstStep]:
    """List the steps with torque of a robot that is held."""
    little = _round(LITTLE * float(known.robot.max_torque.max()))
    yield FirstStep(
        name="wiggle",
        aim="Swing one joint after the other by 5°: the first torque, and little of it.",
        words=("servo", "wiggle", *_on_robot(known), "--torque-limit", little),
        before="Hang the robot up with its limbs free; any key stops it.",
        at_bus=f"hang {_find_room(known.robot)}",
    )
    yield FirstStep(
        name="squat",
        aim="Bend and stretch the legs a little, all joints together.",
        words=("servo", "squat", *_on_robot(known), "--torque-limit", little),
        before="Leave it hanging upright, its feet in the air.",
        at_bus="hold standing",
    )


def _list_on_the_ground(known: RobotAtPort) -> Iterator[FirstStep]:
    """List the steps to the first rise."""
    robot, motion = known.robot, _find_motion(known.robot)
    gentle = _round(GENTLE * float(robot.max_torque.max()))
    limit = ("--torque-limit", f"{known.torque_limit:g}" if known.torque_limit else gentle)
    if motion is None:
        yield FirstStep(
            name="motions",
            aim="Find motions for this body in physics; it takes a while.",
            words=("motions", "discover", "--robot", known.chosen),
        )
        return
    supply = () if known.voltage is None else ("--voltage", f"{known.voltage:.1f}")
    yield FirstStep(
        name="preflight",
        aim=f"Check in simulation that {motion} works with little torque.",
        words=("preflight", motion, "--robot", known.chosen, *supply, *limit),
        before="Where it does not stand, leave, and begin again with more --torque-limit.",
    )
    on_robot = ("--backend", "dynamixel", *_on_robot(known), *limit)
    out = ("--out", str(known.out / "rise"))
    lie = "Lay the robot on its back, a meter free on all sides, a line above it"
    if robot.imu_kind is None:
        yield FirstStep(
            name="rise",
            aim="Play the motion once; without an IMU, only you see whether it stands.",
            words=("play", motion, *on_robot, "--without-imu", *out),
            before=f"{lie}, as the motion begins; any key stops it.",
            at_bus=f"lay {SIDE}",
        )
        return
    sits = bool(list_lying_down(robot))
    yield FirstStep(
        name="rise",
        aim="Get up once, gently; then "
        + ("a key lets the robot sit and lie down." if sits else "torque goes off: it falls."),
        words=("rise", *on_robot, "--attempts", "1", *(() if sits else ("--then", "limp")), *out),
        before=f"{lie}; any key stops it."
        + ("" if sits else " Hold it once it stands: it has no motion to lie down."),
        at_bus=f"lay {SIDE}",
    )


DOCTOR_FILE = "doctor.json"


def _find_room(robot: Robot) -> str:
    """Find a posture from which each joint can turn: zero, unless one is at its end there."""
    return "zero" if (robot.upper >= np.radians(TURN)).all() else "standing"


def _find_motion(robot: Robot) -> str | None:
    """Find a motion that rises from the robot's back; None if it has none."""
    if not list_motions(robot):
        return None
    rising = [m for m in load_database(robot).motions if m.start_class == SIDE and m.rises]
    return rising[0].name if rising else None


def _round(torque: float) -> str:
    return f"{torque:.2g}"
