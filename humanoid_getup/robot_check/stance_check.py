"""Stance check: soles on the faces of the feet, balance, contacts, reserves of leg ranges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import mujoco
import numpy as np

from drivers.twin.device_models import AMBIENT_TEMPERATURE, Windings
from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.robot_check.model_check import CheckFinding
from humanoid_getup.simulation.world import World, find_touching_bodies
from robots import Robot
from robots.body.limbs import LEGS, Limbs
from robots.body.overlap import find_overlaps
from robots.body.soles import list_sole_points, measure_support_margin, measure_tilt
from robots.kinematics import place
from robots.quaternion import Array

NEAR = 0.002  # m; a site this near to the face is on it
LEVEL = np.radians(2.0)
LEAST_MARGIN = 0.01  # m from the center of mass to the edge of the soles
ROOM = np.radians(2.0)  # that a leg's joint needs on both sides to balance


def check_soles(robot: Robot) -> Iterator[CheckFinding]:
    """Find sole sites that are not on the lowest faces of the feet."""
    model = robot.spec().compile()
    found = [finding for site in robot.sole_sites for finding in _check_sole(model, site)]
    yield from found
    if not found:
        sites = " and ".join(f"'{site}'" for site in robot.sole_sites)
        yield CheckFinding.ok("soles", f"{sites} are on the faces of the feet")


def _check_sole(model: mujoco.MjModel, site: str) -> Iterator[CheckFinding]:
    subject, points = f"site '{site}'", list_sole_points(model, site)
    if not len(points):
        yield CheckFinding.fault(
            subject,
            "is on a foot without shapes, expected some to stand on",
            "give the foot a box or a capsule in the model",
        )
        return
    tilt, above = measure_tilt(points), -float(points[:, 2].min())
    if tilt > LEVEL:
        yield CheckFinding.fault(
            subject,
            f"is tilted by {np.degrees(tilt):.0f}° against the face of the foot",
            "turn it in the model until its z axis is normal to the face",
        )
    elif abs(above) > NEAR:
        where = "above" if above > 0.0 else "below"
        yield CheckFinding.warning(
            subject,
            f"is {1e3 * abs(above):.0f} mm {where} the lowest point of the foot",
            "put it on the face on which the foot stands",
        )


def check_stance(world: World, limbs: Limbs) -> Iterator[CheckFinding]:
    """Find problems of a robot's stance, without physics."""
    yield from _check_overlaps(limbs)
    yield from _check_ground(world)
    yield from _check_ranges(limbs)
    yield _check_balance(world)


def _check_overlaps(limbs: Limbs) -> Iterator[CheckFinding]:
    robot, model = limbs.robot, limbs.model
    for pair, depth in find_overlaps(model, place(robot, model, robot.standing)).items():
        a, b = (model.body(body).name or f"body {body}" for body in pair)
        yield CheckFinding.warning(
            "stance",
            f"{a} reaches {1e3 * depth:.0f} mm into {b}",
            "change [standing], make the shapes smaller, or exclude the pair in the model",
        )


def _check_ground(world: World) -> Iterator[CheckFinding]:
    robot = world.robot
    for body in find_touching_bodies(world, place(robot, world.model, robot.standing)):
        yield CheckFinding.fault(
            "stance",
            f"{body} touches the ground, expected the feet alone",
            "change [standing], or put the sole sites on the lowest faces",
        )


def _check_ranges(limbs: Limbs) -> Iterator[CheckFinding]:
    robot = limbs.robot
    angles = robot.standing.joint_pos
    room = np.minimum(angles - robot.lower, robot.upper - angles)
    for k in sorted(k for name in LEGS for k in limbs.all[name].joints if room[k] < ROOM):
        yield CheckFinding.warning(
            f"joint '{robot.joint_names[k]}'",
            f"stands {np.degrees(room[k]):.1f}° from the end of its range, expected at least "
            f"{np.degrees(ROOM):.0f}° to balance with",
            "bend it a little in [standing], or widen its range in the model",
        )


def _check_balance(world: World) -> CheckFinding:
    margin = measure_support_margin(world.robot, world.model)
    text = f"the center of mass is {1e3 * margin:.0f} mm inside the soles' edge"
    if margin >= LEAST_MARGIN:
        return CheckFinding.ok("stance", text)
    if margin < 0.0:
        text = f"the center of mass is {-1e3 * margin:.0f} mm outside the soles"
    if not np.isfinite(margin):
        text = "the soles have no area on the ground"
    return CheckFinding(
        level="fault" if margin < 0.0 else "warning",
        subject="stance",
        text=f"{text}, expected at least {1e3 * LEAST_MARGIN:.0f} mm inside",
        remedy="change hip and ankle pitch in [standing]",
    )


SETTLE_TIME = 1.0  # s before the hold
STRAINED = 0.9  # share of the stall torque from which a servo does not hold for long
COOL = 15.0  # °C below its limit that a servo should stay


def check_hold(world: World) -> Iterator[CheckFinding]:
    """Let the robot hold its stance, and check that it stays up and cool."""
    record = _stand(world)
    if not record.upright.all():
        yield _describe_fall(world, record)
        return
    torque = record.torque[-1]
    share = np.abs(torque) / world.robot.max_torque
    worst = int(np.argmax(share))
    text = (
        f"holds on its servos; the most strained joint is '{world.robot.joint_names[worst]}' "
        f"with {share[worst]:.0%} of its stall torque"
    )
    if share[worst] > STRAINED:
        remedy = (
            "a servo near its stall torque trips: change [standing], or look for bodies that touch"
        )
        yield CheckFinding.warning("stance", text, remedy)
    else:
        yield CheckFinding.ok("stance", text)
    yield from _check_heat(world.robot, torque)


def _stand(world: World) -> Record:
    robot = world.robot
    count = round((HOLD_TIME + SETTLE_TIME) / robot.control_period)
    targets = np.tile(robot.standing.joint_pos, (1, count, 1))
    start = Scenarios.nominal(world, place(robot, world.model, robot.standing))
    return play(world, start, targets).take(0)


def _describe_fall(world: World, record: Record) -> CheckFinding:
    stance = record.stance
    bodies = ", ".join(find_touching_bodies(world, record.qpos[-1]))
    on = f", on the ground: {bodies}" if bodies else ""
    height = float(stance.neck_height[-1] / world.robot.standing_neck_height)
    tilt = float(np.degrees(stance.tilt[-1]))
    servos = ", ".join(dict.fromkeys(joint.servo.model.name for joint in world.robot.joints))
    is_weak = bool(_stand(World(_strengthen(world.robot))).upright.all())
    return CheckFinding(
        level="fault",
        subject="stance",
        text=f"does not hold for {HOLD_TIME:g} s on its servos ({servos}): neck at {height:.0%} of "
        f"its height, tilted by {tilt:.0f}°{on}",
        remedy="it holds with twice the torque: set stronger types in robot.toml, or import it "
        "with --servo TYPE"
        if is_weak
        else "change [standing]; getup hold shows the fall",
    )


def _strengthen(robot: Robot) -> Robot:
    """Return a robot whose servos have twice the torque, and so twice the stiffness."""
    joints = []
    for joint in robot.joints:
        model = joint.servo.model
        strong = replace(
            model, stall_torque=2.0 * model.stall_torque, stall_current=2.0 * model.stall_current
        )
        joints.append(replace(joint, servo=replace(joint.servo, model=strong)))
    return replace(robot, joints=tuple(joints))


def _check_heat(robot: Robot, torque: Array) -> Iterator[CheckFinding]:
    """Compare the final temperatures of servos that hold torques (n,) with their limits."""
    windings = Windings(robot)
    rise = windings.compute_warming(windings.compute_current(torque))
    limit = np.array([joint.servo.model.temperature_limit for joint in robot.joints])
    room = limit - AMBIENT_TEMPERATURE - rise
    for k in np.flatnonzero(room < COOL):
        yield CheckFinding(
            level="warning",
            subject=f"joint '{robot.joint_names[k]}'",
            text=f"its servo warms to {AMBIENT_TEMPERATURE + rise[k]:.0f} °C in the stance, "
            f"expected at most {limit[k] - COOL:.0f} °C"
            + _tell_time(windings, int(k), rise[k], room[k]),
            remedy="straighten the legs in [standing], or use a stronger servo",
        )
    hottest = int(np.argmin(room))
    if room[hottest] >= COOL:
        yield CheckFinding(
            level="ok",
            subject="stance",
            text=f"warms '{robot.joint_names[hottest]}' most, to "
            f"{AMBIENT_TEMPERATURE + rise[hottest]:.0f} °C of {limit[hottest]:.0f} °C",
        )


def _tell_time(windings: Windings, k: int, rise: float, room: float) -> str:
    """Describe when a servo switches itself off, if it does."""
    if room >= 0.0:
        return ""
    constant = windings.heat_capacity[k] * windings.heat_resistance[k]
    minutes = -constant * np.log1p(-(rise + room) / rise) / 60.0
    return f": it switches itself off after {minutes:.0f} min"
