"""Take of a rise: the robot as it moved, the plan as its ghost, loads and contacts over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.judging.standing import MAX_TILT, MIN_NECK_SHARE
from humanoid_getup.experiments.judging.torque import find_available
from humanoid_getup.playback.motion_player import find_approach_time
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.strategies.plan import MotionPlan
from humanoid_getup.studio.takes.take import Mark, Plot, Take
from robots import Robot, quaternion
from robots.kinematics import place_postures, read_posture
from robots.quaternion import Array

if TYPE_CHECKING:
    from humanoid_getup.execution.result import RiseResult
    from humanoid_getup.experiments.judging.outcome import Outcome
    from humanoid_getup.experiments.judging.record import Record
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.simulation.world import World

WORST = 4
"""Number of joints whose load is plotted."""
LEAST_LINE = 1e-6  # N·m; a servo at its no-load speed has no torque left


def make_rise_take(world: World, result: RiseResult, name: str) -> Take | None:
    """Make the take of the last run of a rise; None if nothing was played."""
    outcome = result.outcome
    if outcome is None or not len(outcome.qpos):
        return None
    record, plan = outcome.record, result.plan
    time = np.arange(1.0, len(record.qpos) + 1.0) * record.period
    ghost = None
    if isinstance(plan, MotionPlan):
        ghost = _place_plan(world, plan.motion, record, time)
    return Take(
        name=name,
        time=time,
        qpos=record.qpos,
        ghost=ghost,
        joint_torque=world.robot.transmission.torque_at_joint(record.torque),
        plots=(*plot_attitude(record, world.robot), *plot_loads(record, world.robot)),
        marks=_find_marks(outcome, result),
        facts=_list_facts(outcome, result),
    )


def _place_plan(world: World, motion: Motion, record: Record, time: Array) -> Array:
    """Place the plan of a run where it was when the player sent it, after its approach."""
    begin = read_posture(world.robot, world.model, record.qpos[0])
    approach = find_approach_time(world.robot, motion, begin.joint_pos)
    return place_motion(world, motion, time - approach, record.qpos[0])


def place_motion(world: World, motion: Motion, time: Array, start: Array) -> Array:
    """Compute MuJoCo positions of a motion at times since its begin [s], (T,).

    Each is that of the last frame before; before it begins, that of the first. On ground that is
    the same everywhere a plan does not know where the robot lies: it is moved to where the run
    begins, the positions ``start``, (nq,).
    """
    frame = np.searchsorted(motion.time, time + motion.time[0], side="right") - 1
    frame = np.clip(frame, 0, len(motion.time) - 1)
    position, orientation = motion.position, motion.orientation
    if world.scene.is_flat:
        here = Placement.of(read_posture(world.robot, world.model, start))
        there = Placement.of(motion.posture(0))
        turn = quaternion.from_yaw(here.heading - there.heading)
        position = quaternion.rotate(turn, position - np.array([there.x, there.y, 0.0]))
        position = position + np.array([here.x, here.y, 0.0])
        orientation = quaternion.multiply(turn, orientation)
    return place_postures(
        world.robot, world.model, position[frame], orientation[frame], motion.joint_pos[frame]
    )


def plot_attitude(record: Record, robot: Robot) -> tuple[Plot, ...]:
    """Plot neck height, tilt and contacts over time."""
    stance = record.stance
    touches = {"not the feet": stance.non_foot_contact}
    touches |= {} if record.torso_touch is None else {"torso": record.torso_touch}
    touches |= {} if record.head_touch is None else {"head": record.head_touch}
    height = stance.neck_height / robot.standing_neck_height
    return (
        Plot(title="Neck height, share of standing", curves={"neck": height}, limit=MIN_NECK_SHARE),
        Plot(
            title="Tilt of the torso [deg]",
            curves={"tilt": np.degrees(stance.tilt)},
            limit=float(np.degrees(MAX_TILT)),
        ),
        Plot(
            title="Contact with the world",
            curves={name: touch.astype(float) for name, touch in touches.items()},
        ),
    )


def plot_loads(record: Record, robot: Robot) -> tuple[Plot, ...]:
    """Plot the torques of the most loaded joints as shares of what their servos have, and speeds.

    What a servo has is less the faster it turns: its torque-speed line, at the robot's supply.
    """
    line = find_available(robot, record.torque, record.actuator_vel, record.voltage)
    share = np.abs(record.torque) / np.maximum(line, LEAST_LINE)
    drives = record.torque * record.actuator_vel >= 0.0
    share = np.where(drives, np.minimum(share, 1.0), np.nan)
    worst = np.argsort(-np.nan_to_num(share).mean(axis=0), kind="stable")[:WORST]
    names = [robot.joint_names[joint] for joint in worst]
    return (
        Plot(
            title="Torque, share of the servo's line",
            curves={name: share[:, joint] for name, joint in zip(names, worst, strict=True)},
            limit=1.0,
        ),
        Plot(
            title="Torque [N·m]",
            curves={n: record.torque[:, joint] for n, joint in zip(names, worst, strict=True)},
        ),
        Plot(
            title="Speed [rad/s]",
            curves={n: record.joint_vel[:, joint] for n, joint in zip(names, worst, strict=True)},
        ),
    )


def describe_loads(outcome: Outcome) -> str:
    """Describe the torques of a run in one line."""
    return (
        f"peak torque {float(outcome.peak_torque):.2f} N·m "
        f"({float(outcome.torque_use):.0%} of its limit), RMS {float(outcome.rms_torque):.2f} N·m"
    )


def _find_marks(outcome: Outcome, result: RiseResult) -> tuple[Mark, ...]:
    marks = []
    if outcome.stood:
        marks.append(Mark(time=float(outcome.stand_time), text="stands"))
    abort = result.attempts[-1].abort
    if abort is not None:
        marks.append(Mark(time=abort.time, text=f"stopped: {abort}"))
    return tuple(marks)


def _list_facts(outcome: Outcome, result: RiseResult) -> tuple[str, ...]:
    """Say how it ended, how it was planned, what the preflight found, and its loads."""
    verdict = result.attempts[-1].verdict
    facts = [f"{'Stands' if result.stood else 'Does not stand'}: {result.reason}"]
    facts += [str(result.plan), *([str(verdict)] if verdict else []), describe_loads(outcome)]
    return tuple(facts)
