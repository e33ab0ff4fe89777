"""Builds the motion database: from hand-written keyframes to verified motions."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import classify, settle_posture
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.standing import HOLD_TIME
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions.course import join
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_writer import format_keyframes
from humanoid_getup.motions.motion import NO_END, Motion, hold_last
from humanoid_getup.motions.optimization import TrajectoryOptimizer
from humanoid_getup.motions.preference import Preference, PreferenceName
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Posture, Robot, TorqueLimit, quaternion
from robots.kinematics import place
from robots.quaternion import Array

UNFINISHED = "unfinished"
SOUND = 0.8  # share of disturbed worlds in which a motion should end as it should
ENTRY_STRIDE = 12  # frames between the entries that are tried
ENTRY_BATCH = 32
POSTURES = 60  # in which a robot is laid on its side, at most

ATTITUDES = {
    "supine": ((0.0, 1.0, 0.0), -math.pi / 2),
    "prone": ((0.0, 1.0, 0.0), math.pi / 2),
    "left": ((1.0, 0.0, 0.0), -math.pi / 2),
    "right": ((1.0, 0.0, 0.0), math.pi / 2),
    "squat": ((1.0, 0.0, 0.0), 0.0),
    "standing": ((1.0, 0.0, 0.0), 0.0),
}
"""Axis and angle of the torso before it settles, by start class."""


@dataclass(frozen=True, kw_only=True)
class Build:
    """Result of building keyframes."""

    motion: Motion
    """The best motion found; its end class is "other" if it does not end as it should."""
    keyframes: Keyframes
    """The optimized ones."""
    failure: str = ""
    """Reason not to store it; "" if it succeeded."""


def build_motion(
    robot: Robot,
    keyframes: Keyframes,
    *,
    generations: int,
    seed: int,
    prefer: PreferenceName | None = None,
    report: Callable[[int, float, float], None] = lambda *_: None,
    log: Ledger | None = None,
) -> Build:
    """Optimize one set of keyframes and record it as a motion.

    Without a preference, time and torque cost what the keyframes say. A search with a log continues
    where the log ends.
    """
    world = World(robot)
    start = settle(world, keyframes)
    preference = None if prefer is None else Preference.of(prefer)
    optimizer = TrajectoryOptimizer(world, start, preference=preference)
    optimized, robust = optimizer.optimize(keyframes, generations, seed, report, log)
    provenance = {
        "program": "getup motions build",
        "seed": seed,
        "generations": generations,
        "disturbed_success": robust,
        "torque_limit": keyframes.torque_limit,
        "prefer": prefer or "keyframes",
    }
    return _record(Trial.of(world, optimized, start), provenance)


def build_unimproved(robot: Robot, keyframes: Keyframes, seed: int) -> Build:
    """Record keyframes as they are, if they end as they should at full torque.

    In how many disturbed worlds they do is in the motion's provenance, whatever limit they wish
    for: planned rises along them are filtered.
    """
    world = World(robot)
    start = settle(world, keyframes)
    own = replace(keyframes, torque_limit=float(robot.max_torque.max()))
    trial = Trial.of(world, own, start)
    share = 0.0
    if trial.succeeded:
        share = float(TrajectoryOptimizer(world, start).judge(own, seed)[1].mean())
    provenance: dict[str, str | float | int] = {
        "program": "getup motions retarget",
        "seed": seed,
        "disturbed_success": share,
        "torque_limit": own.torque_limit,
    }
    return _record(trial, provenance)


def _record(trial: Trial, provenance: dict[str, str | float | int]) -> Build:
    """Record a trial as a motion, with its entry frames if it rises."""
    if not trial.succeeded:
        failure = f"motion '{trial.keyframes.name}' {trial.describe()}"
        motion = trial.record(provenance | {"failure": trial.describe()})
        return Build(motion=motion, keyframes=trial.keyframes, failure=failure)
    motion, failure = trial.record(provenance), ""
    if motion.rises:
        try:
            motion = with_entries(trial.world, motion)
        except NoEntryError as error:
            motion, failure = replace(motion, end_class=NO_END), str(error)
    return Build(motion=motion, keyframes=trial.keyframes, failure=failure)


def make_task(
    robot: Robot, keyframes: Keyframes, seed: int, prefer: PreferenceName | None
) -> dict[str, str | int]:
    """Describe the inputs of the search for a motion, with a checksum of its keyframes."""
    written = format_keyframes([keyframes], robot).encode()
    return {
        "robot": robot.name,
        "keyframes": hashlib.sha256(written).hexdigest(),
        "seed": seed,
        "prefer": prefer or "keyframes",
    }


def try_out(world: World, keyframes: Keyframes) -> Trial:
    """Play keyframes once, after the robot has settled in the first."""
    return Trial.of(world, keyframes, settle(world, keyframes))


def settle(world: World, keyframes: Keyframes) -> Array:
    """Let the robot settle in the first key posture; return MuJoCo positions (nq,)."""
    return lay_down(world, keyframes.start_class, keyframes.keys[0])


def lay_down(world: World, start_class: str, joint_pos: Array) -> Array:
    """Let a robot settle with held joints [rad], (n,); return MuJoCo positions (nq,)."""
    axis, angle = ATTITUDES[start_class]
    posture = Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=quaternion.from_axis_angle(np.array(axis), angle),
        joint_pos=joint_pos,
    )
    return settle_posture(world, posture)


def lay_down_at_random(world: World, start_class: str, rng: np.random.Generator) -> Array:
    """Lay a robot down in a random symmetric posture that its servos hold; return (nq,)."""
    robot = world.robot
    home, share = robot.standing.joint_pos, rng.uniform()
    anywhere = rng.uniform(robot.lower, robot.upper)
    angles = robot.symmetrize(home + share * (anywhere - home))
    return lay_down(world, start_class, np.clip(angles, robot.lower, robot.upper))


def lay_on_side(world: World, side: LyingSide, rng: np.random.Generator) -> Array | None:
    """Find a posture in which a robot stays on one side; return MuJoCo positions (nq,).

    The first that is tried has the joints of the stance; a robot may roll off its side in it.
    None if it does so in random postures, too.
    """
    layout = world.robot.layout(world.model)
    for tried in range(POSTURES):
        stance = world.robot.standing.joint_pos
        qpos = lay_down_at_random(world, side, rng) if tried else lay_down(world, side, stance)
        if classify(qpos[layout.root_orientation]) == side:
            return qpos
    return None


class NoEntryError(RuntimeError):
    """A motion has no entry frames: it stands only as recorded, not when started at rest."""


def with_entries(world: World, motion: Motion, limit: TorqueLimit = FULL_TORQUE) -> Motion:
    """Mark the entry frames of a motion: started there at rest, it still ends standing.

    That is so under a torque limit of every servo.
    """
    frames = np.arange(0, len(motion.time), ENTRY_STRIDE)
    entry = np.zeros(len(motion.time), dtype=bool)
    for first in range(0, len(frames), ENTRY_BATCH):
        some = frames[first : first + ENTRY_BATCH]
        entry[some] = _stands_from(world, motion, some, limit)
    if not entry.any():
        raise NoEntryError(f"motion '{motion.name}' does not end standing from rest at any frame")
    return replace(motion, entry=entry)


def _stands_from(
    world: World, motion: Motion, frames: np.ndarray, limit: TorqueLimit
) -> np.ndarray:
    robot, period = world.robot, world.robot.control_period
    plays = [join(motion, int(k), motion.joint_pos[k], period) for k in frames]
    length = max(map(len, plays)) + round(HOLD_TIME / period)
    targets = np.array([hold_last(play, length) for play in plays])
    starts = np.array([place(robot, world.model, motion.posture(int(f))) for f in frames])
    return Outcome(play(world, Scenarios.nominal(world, starts, limit), targets), robot).stood


def motion_file(folder: Path, name: str) -> Path:
    """Return the file of a robot's motion."""
    return folder / "motions" / f"{name}.npz"


def unfinished_file(folder: Path, name: str, suffix: str) -> Path:
    """Return a file of a motion that is not built yet, such as its search log."""
    return folder / UNFINISHED / f"{name}{suffix}"
