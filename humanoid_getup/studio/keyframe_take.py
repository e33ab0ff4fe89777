"""Keyframe take: a rollout of keys for the timeline, the targets as its ghost."""

from __future__ import annotations

import math

import numpy as np

from humanoid_getup.experiments.judging.standing import MIN_NECK_SHARE
from humanoid_getup.jobs.play_keys import PlayedKeys
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.take import Mark, Plot, Take
from robots import quaternion
from robots.kinematics import place_postures


def make_take(played: PlayedKeys, world: World) -> Take:
    """Make a take of a rollout; the ghost has the joints of the targets."""
    robot, model, way = world.robot, world.model, played.rollout
    roots = way.position, way.orientation
    return Take(
        name=played.keyframes.name,
        time=way.time,
        qpos=place_postures(robot, model, *roots, way.joint_pos),
        ghost=place_postures(robot, model, *roots, played.target),
        joint_torque=played.joint_torque,
        plots=(
            Plot(
                title="Neck, of standing",
                curves={"height": played.neck_share},
                limit=MIN_NECK_SHARE,
            ),
            Plot(
                title="Tilt [deg]",
                curves={"torso": np.degrees(quaternion.tilt(way.orientation))},
            ),
            Plot(
                title="Torque, of the servo's",
                curves={"strongest": played.torque_use},
                limit=1.0,
            ),
        ),
        marks=tuple(
            Mark(time=float(time), text=f"key {number}")
            for number, time in enumerate(played.key_time, start=1)
        ),
        facts=list_facts(played),
    )


def list_facts(played: PlayedKeys) -> tuple[str, ...]:
    """List how a rollout ended, and its figures, a line each."""
    figures = played.figures
    lines = [
        f"{'As it should' if played.succeeded else 'Not as it should'}: {played.description}.",
        "On level ground, undisturbed, at full torque.",
        f"Torque: up to {figures.torque_use:.0%} of a servo's; "
        f"RMS of all joints {figures.rms_torque_nm:.2f} N·m.",
        f"Speed of a joint: up to {math.degrees(figures.peak_velocity_rad_s):.0f} deg/s.",
    ]
    if figures.self_collisions:
        lines.append(f"The robot hit itself {_count(figures.self_collisions)}.")
    if figures.limit_violations:
        lines.append(f"A joint left its range {_count(figures.limit_violations)}.")
    return tuple(lines)


def _count(times: int) -> str:
    return "once" if times == 1 else f"{times} times"
