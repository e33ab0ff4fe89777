"""Takes: what the timeline can scrub through, and how results become one."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.judging.standing import MAX_TILT, MIN_NECK_SHARE
from humanoid_getup.experiments.judging.torque import find_available
from humanoid_getup.motions.trial import Trial
from humanoid_getup.playback.play import find_approach_time
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import place_postures, read_posture
from robots.quaternion import Array

if TYPE_CHECKING:
    from humanoid_getup.execution.rise import Rise
    from humanoid_getup.experiments.judging.outcome import Outcome
    from humanoid_getup.experiments.judging.record import Record
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.studio.follow_style import StyledRollout


@dataclass(frozen=True, kw_only=True)
class Mark:
    """An event on the timeline."""

    time: float
    """[s]"""
    text: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Plot:
    """Curves over the time of a take."""

    title: str
    curves: dict[str, Array]
    """Values by name, (T,) each, NaN where unknown."""
    limit: float | None = None
    """Value at which a line is drawn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Take:
    """A motion of the robot, and of its ghost, that can be scrubbed."""

    name: str
    time: Array
    """Times from the start [s], (T,)."""
    qpos: Array
    """MuJoCo positions of the robot in its world, (T, nq)."""
    ghost: Array | None = None
    """The same of the ghost: a reference, a target or a twin."""
    joint_torque: Array | None = None
    """Torques at the joints [N·m], (T, n), by which contact forces are computed."""
    plots: tuple[Plot, ...] = ()
    marks: tuple[Mark, ...] = ()
    facts: tuple[str, ...] = ()
    """Lines of plain text about its result, first the headline."""

    def __post_init__(self) -> None:
        if not len(self.time) or np.any(np.diff(self.time) < 0.0):
            raise ValueError("time is empty or not increasing, expected rising times")
        for name in ("qpos", "ghost", "joint_torque"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.time):
                raise ValueError(f"{name} has {len(values)} rows for {len(self.time)} times")

    @property
    def duration(self) -> float:
        """Return the time from the first sample to the last one [s]."""
        return float(self.time[-1] - self.time[0])

    def find(self, time: float) -> int:
        """Find the last sample at or before a time from the first one [s]."""
        last = int(np.searchsorted(self.time, self.time[0] + time + 1e-9, side="right")) - 1
        return min(max(last, 0), len(self.time) - 1)


WORST = 4
"""Number of joints whose load is plotted."""
LEAST_LINE = 1e-6  # N·m; a servo at its no-load speed has no torque left
IN_DEGREES = np.array([1.0, 180.0 / np.pi, 180.0 / np.pi])
"""Factors of the features of styles: a share of standing, and two angles [rad]."""
TITLES = ("Neck height [share of standing]", "Side angle [deg]", "Front angle [deg]")


def make_rise_take(world: World, result: Rise, name: str) -> Take | None:
    """Make the take of the last run of a rise; None if nothing was played."""
    outcome = result.outcome
    if outcome is None or not len(outcome.qpos):
        return None
    record, plan = outcome.record, result.plan
    time = np.arange(1.0, len(record.qpos) + 1.0) * record.period
    ghost = None
    if plan.motion is not None:
        # The player sends the motion after its approach.
        begin = read_posture(world.robot, world.model, record.qpos[0])
        approach = find_approach_time(world.robot, plan.motion, begin.joint_pos)
        ghost = place_motion(world, plan.motion, time - approach, record.qpos[0])
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


def _find_marks(outcome: Outcome, result: Rise) -> tuple[Mark, ...]:
    marks = []
    if outcome.stood:
        marks.append(Mark(time=float(outcome.stand_time), text="stands"))
    abort = result.attempts[-1].abort
    if abort is not None:
        marks.append(Mark(time=abort.time, text=f"stopped: {abort}"))
    return tuple(marks)


def _list_facts(outcome: Outcome, result: Rise) -> tuple[str, ...]:
    """Say how it ended, how it was planned, what the preflight found, and its loads."""
    verdict = result.attempts[-1].verdict
    facts = [f"{'Stands' if result.stood else 'Does not stand'}: {result.reason}"]
    facts += [str(result.plan), *([str(verdict)] if verdict else []), describe_loads(outcome)]
    return tuple(facts)


def make_key_take(trial: Trial, world: World) -> Take:
    """Make a take of a rollout; the ghost has the joints of the targets."""
    robot, record = world.robot, trial.outcome.record
    count, layout = len(record.qpos), record.layout
    roots = record.qpos[:, layout.root_position], record.orientation
    return Take(
        name=trial.keyframes.name,
        time=np.arange(1.0, count + 1.0) * record.period,
        qpos=place_postures(robot, world.model, *roots, record.joint_pos),
        ghost=place_postures(robot, world.model, *roots, trial.targets[:count]),
        joint_torque=robot.transmission.torque_at_joint(record.torque),
        plots=(*plot_attitude(record, robot), *plot_loads(record, robot)),
        marks=tuple(
            Mark(time=float(time), text=f"key {number}")
            for number, time in enumerate(trial.keyframes.times(robot), start=1)
        ),
        facts=list_facts(trial),
    )


def locate_key(trial: Trial, number: int) -> Posture:
    """Return the posture of a key, counted from 0, where the robot was at its time."""
    record, robot, key = trial.outcome.record, trial.world.robot, trial.keyframes.keys[number]
    sample = round(float(trial.keyframes.times(robot)[number]) / record.period)
    states = np.vstack([trial.start, record.qpos])
    at = read_posture(robot, trial.world.model, states[min(sample, len(states) - 1)])
    return replace(at, joint_pos=key)


def list_facts(trial: Trial) -> tuple[str, ...]:
    """List how a rollout ended, and its figures, a line each."""
    outcome = trial.outcome
    speed = math.degrees(float(outcome.peak_velocity))
    lines = [
        f"{'As it should' if trial.succeeded else 'Not as it should'}: {trial.describe()}.",
        "On level ground, undisturbed, at full torque.",
        f"{describe_loads(outcome)}, speed up to {speed:.0f} deg/s",
    ]
    if outcome.self_collisions:
        lines.append(f"The robot hit itself {_count(int(outcome.self_collisions))}.")
    if outcome.limit_violations:
        lines.append(f"A joint left its range {_count(int(outcome.limit_violations))}.")
    return tuple(lines)


def _count(times: int) -> str:
    return "once" if times == 1 else f"{times} times"


def make_rollout_take(rollout: StyledRollout) -> Take:
    """Make the take of a rollout."""
    wanted, followed = (
        np.append(features, features[-1:], axis=0) * IN_DEGREES
        for features in (rollout.wanted, rollout.measured)
    )
    plots = [
        Plot(title=title, curves={"wanted": wanted[:, k], "followed": followed[:, k]})
        for k, title in enumerate(TITLES)
    ]
    stand = rollout.stand_time
    ended = f"Does not stand within {rollout.time[-1]:.1f} s: {rollout.reason}"
    ended = ended if stand is None else f"Stands at {stand:.2f} s"
    return Take(
        name=f"{rollout.request.style.name}, {rollout.request.policy}",
        time=np.concatenate([[0.0], rollout.time]),
        qpos=_prepend(rollout.begin, rollout.outcome.record.qpos),
        joint_torque=_prepend(np.zeros(rollout.outcome.robot.n), rollout.joint_torque),
        plots=tuple(plots),
        marks=() if stand is None else (Mark(time=stand, text="stands"),),
        facts=(ended, str(rollout.followed)),
    )


def _prepend(first: Array, rows: Array) -> Array:
    return np.concatenate([first[np.newaxis], rows])
