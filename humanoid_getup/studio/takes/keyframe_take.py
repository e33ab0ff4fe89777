"""Keyframe take: a rollout of keys for the timeline, the targets as its ghost."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from humanoid_getup.motions.trial import Trial
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.takes.rise_take import describe_loads, plot_attitude, plot_loads
from humanoid_getup.studio.takes.take import Mark, Take
from robots import Posture
from robots.kinematics import place_postures, read_posture


def make_take(trial: Trial, world: World) -> Take:
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
