"""Hold check: whether the stance holds in simulation, and its servos stay cool."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from drivers.twin.servo_model import AMBIENT_TEMPERATURE, Windings
from humanoid_getup.experiments.disturbances.disturbance import Scenarios
from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts.play import play
from humanoid_getup.robot_check.finding import CheckFinding
from humanoid_getup.simulation.touch import find_touching_bodies
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place
from robots.quaternion import Array

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
