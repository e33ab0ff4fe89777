"""Builds the motion database: from hand-written keyframes to verified motions."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from humanoid_getup.evaluation.lying import LYING_TIME, measure_lying
from humanoid_getup.evaluation.preference import Preference, PreferenceName
from humanoid_getup.evaluation.standing import HOLD_TIME, is_upright, judge, measure_stance
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion import STANDING, Motion, hold_last, join
from humanoid_getup.motions.optimization import TrajectoryOptimizer
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.falls import settle_posture
from humanoid_getup.simulation.rollout import Rollout, Trace
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import place, read_posture
from robots.quaternion import Array

KEYFRAMES = "keyframes.toml"
ENTRY_STRIDE = 12  # frames between the entries that are tried
ENTRY_BATCH = 32

ATTITUDES = {
    "supine": ((0.0, 1.0, 0.0), -math.pi / 2),
    "prone": ((0.0, 1.0, 0.0), math.pi / 2),
    "left": ((1.0, 0.0, 0.0), -math.pi / 2),
    "right": ((1.0, 0.0, 0.0), math.pi / 2),
    "squat": ((1.0, 0.0, 0.0), 0.0),
    "standing": ((1.0, 0.0, 0.0), 0.0),
}
"""Axis and angle of the torso before it settles, by start class."""


def build_motion(
    robot: Robot,
    keyframes: Keyframes,
    *,
    generations: int,
    seed: int,
    prefer: PreferenceName | None = None,
    report: Callable[[int, float, float], None] = lambda *_: None,
) -> tuple[Motion, Keyframes]:
    """Optimize one set of keyframes and record it as a motion.

    Without a preference, time and torque cost what the keyframes say.

    Raises:
        RuntimeError: if the optimized motion does not end as it should.
    """
    world = World(robot)
    start = settle(world, keyframes)
    preference = None if prefer is None else Preference.of(prefer)
    optimizer = TrajectoryOptimizer(world, start, preference=preference)
    optimized, robust = optimizer.optimize(keyframes, generations, seed, report)
    provenance = {
        "program": "getup motions build",
        "seed": seed,
        "generations": generations,
        "disturbed_success": robust,
        "torque_limit": keyframes.torque_limit,
        "prefer": prefer or "keyframes",
    }
    return record(world, optimized, start, provenance), optimized


def settle(world: World, keyframes: Keyframes) -> Array:
    """Let the robot settle in the first key posture; return MuJoCo positions (nq,)."""
    axis, angle = ATTITUDES[keyframes.start_class]
    posture = Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=quaternion.from_axis_angle(np.array(axis), angle),
        joint_pos=keyframes.keys[0],
    )
    return settle_posture(world, posture)


def record(
    world: World, keyframes: Keyframes, start: Array, provenance: dict[str, str | float | int]
) -> Motion:
    """Roll keyframes out once, undisturbed at full torque, and record the motion.

    Raises:
        RuntimeError: if it does not end in a held stand, or lying as it should.
    """
    robot, period = world.robot, world.robot.control_period
    hold = HOLD_TIME if keyframes.end_class == STANDING else LYING_TIME
    targets = keyframes.targets(robot, hold + 1.0)
    trace = Rollout(world, 1).play(start[None], targets[None], DomainParameters.nominal(world, 1))
    figures = _judge_end(world, keyframes, trace)
    moving = len(targets) - round((hold + 0.5) / period)
    went = np.concatenate([start[None], trace.qpos[0, : moving - 1]])  # at the time of each target
    postures = [read_posture(robot, world.model, q) for q in went]
    motion = Motion.through(
        postures,
        period,
        name=keyframes.name,
        robot=robot.name,
        start_class=keyframes.start_class,
        end_class=keyframes.end_class,
        strategy=keyframes.strategy,
        joint_target=targets[:moving],
        provenance={**provenance, **figures},
    )
    return with_entries(world, motion) if motion.rises else motion


def _judge_end(world: World, keyframes: Keyframes, trace: Trace) -> dict[str, float]:
    """Return the figures of a single rollout that ends as its keyframes should."""
    if keyframes.end_class != STANDING:
        lying = measure_lying(world, trace, keyframes.end_class)
        if not lying.lies[0]:
            raise RuntimeError(
                f"motion '{keyframes.name}' does not end lying {keyframes.end_class}: {lying}"
            )
        return {"descent_m_s": float(lying.descent[0])}
    upright = is_upright(measure_stance(world, trace), world.robot)[0]
    stand = judge(upright, world.robot.control_period)
    if not stand.stood:
        raise RuntimeError(f"motion '{keyframes.name}' does not end in a held stand")
    return {"stand_time_s": stand.start_time}


def with_entries(world: World, motion: Motion) -> Motion:
    """Mark the frames from which the rest of a motion, entered at rest, ends standing."""
    frames = np.arange(0, len(motion.time), ENTRY_STRIDE)
    entry = np.zeros(len(motion.time), dtype=bool)
    for first in range(0, len(frames), ENTRY_BATCH):
        some = frames[first : first + ENTRY_BATCH]
        entry[some] = _stands_from(world, motion, some)
    if not entry.any():
        raise RuntimeError(f"motion '{motion.name}' does not end standing from rest at any frame")
    return replace(motion, entry=entry)


def _stands_from(world: World, motion: Motion, frames: np.ndarray) -> np.ndarray:
    robot, period = world.robot, world.robot.control_period
    plays = [join(motion, int(k), motion.joint_pos[k], period) for k in frames]
    length = max(map(len, plays)) + round(HOLD_TIME / period)
    targets = np.array([hold_last(play, length) for play in plays])
    starts = np.array([place(robot, world.model, motion.posture(int(f))) for f in frames])
    limits = DomainParameters.nominal(world, len(frames))
    trace: Trace = Rollout(world, len(frames)).play(starts, targets, limits)
    upright = is_upright(measure_stance(world, trace), robot)
    return np.array([judge(u, period).stood for u in upright])


def load_robot_keyframes(robot: Robot) -> list[Keyframes]:
    """Load the keyframes of a robot's folder."""
    return load_keyframes(robot.folder / KEYFRAMES, robot)


def motion_file(folder: Path, name: str) -> Path:
    """Return where a motion of a robot is kept."""
    return folder / "motions" / f"{name}.npz"
