"""Imported keyframes: keys of other programs, converted for a robot."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from humanoid_getup.experiments.falls import CLASSES, classify
from humanoid_getup.motions.action_file import PAGE_SIZE, PAGES, ActionFile, load_page
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.key_files import KeySequence, load_animation, load_key_table
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import find_out_of_range
from humanoid_getup.motions.keyframes_writer import SYMMETRIC
from humanoid_getup.motions.motion import NAME, STANDING, EndClass, StartClass
from humanoid_getup.motions.trial import Trial
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.sides import JointSides
from robots.quaternion import Array
from robots.storage.validation import shown

TRAVEL_SPEED = 1.5  # rad/s of the joint that moves farthest, where no time is given
LEAST_TRAVEL = 0.2  # s
TORQUE_SHARE = 0.5  # of the strongest servo's stall torque, the torque limit that keys begin with
IN_STANCE = 0.1  # rad; first keys closer to the stance are those of a robot that stands
FORMATS = "an action file (.bin), a JSON animation (.json) or a table (.csv)"
READERS = {".json": load_animation, ".csv": load_key_table}


def load_sequences(path: Path, pages: Sequence[int], robot: Robot) -> list[KeySequence]:
    """Load the keys of a file: pages of an action file, an animation, a table."""
    is_action_file = path.suffix == ".bin" or path.stat().st_size == PAGES * PAGE_SIZE
    if is_action_file:
        file = ActionFile(path)
        if not pages:
            listed = ", ".join(f"{page.number} {page.name}".strip() for page in file.list_pages())
            raise ValueError(f"{path}: --page is missing, expected one of {listed or 'none'}")
        return [load_page(file, page, robot) for page in pages]
    if pages:
        raise ValueError(f"{path}: --page is given, expected an action file with it")
    load = READERS.get(path.suffix)
    if load is None:
        raise ValueError(f"{path}: a file of another kind, expected {FORMATS}")
    return [load(path, robot)]


@dataclass(frozen=True, kw_only=True)
class ImportedKeyframes:
    """Keyframes made from imported keys, and messages about changes."""

    keyframes: Keyframes
    notes: tuple[str, ...]


def make_keyframes(
    sequence: KeySequence,
    robot: Robot,
    *,
    name: str = "",
    start_class: StartClass = "supine",
    end_class: EndClass = STANDING,
    clip: bool = False,
) -> ImportedKeyframes:
    """Make keyframes of a sequence; a rise ends in the stance, which follows its last key.

    Without a name they have the sequence's; with ``clip`` angles that are out of range are moved
    to its end, instead of refused.
    """
    name = name or re.sub(r"[^\w.-]+", "_", sequence.name).lstrip(".") or "imported"
    if not NAME.fullmatch(name):
        raise ValueError(f"name {shown(name)}: expected up to 100 letters, digits, '_', '-', '.'")
    beyond = find_out_of_range(sequence.keys, robot)
    if beyond and not clip:
        raise ValueError(f"{sequence.source}: {'; '.join(beyond)} (--clip takes the nearest)")
    keys, after = np.clip(sequence.keys, robot.lower, robot.upper), sequence.after
    if end_class == STANDING:
        keys, after = _end_in_stance(keys, after, robot)
    if len(keys) < 2:
        raise ValueError(f"{sequence.source} has one key and no time, expected two or more")
    free, mirrored = choose_free(keys, robot)
    keyframes = Keyframes(
        name=name,
        start_class=start_class,
        end_class=end_class,
        strategy=f"imported from {sequence.source}",
        duration=after,
        keys=keys,
        free=free,
        mirrored=mirrored,
        torque_limit=round(TORQUE_SHARE * float(robot.max_torque.max()), 3),
        time_cost=0.8,
        torque_cost=0.8,
    )
    clipped = tuple(f"{text}: the nearest is taken" for text in beyond)
    return ImportedKeyframes(keyframes=keyframes, notes=sequence.notes + clipped)


def find_travel_time(a: Array, b: Array) -> float:
    """Compute a time for the movement between two postures [s] where none is given."""
    return max(float(np.abs(b - a).max()) / TRAVEL_SPEED, LEAST_TRAVEL)


def _end_in_stance(keys: Array, after: Array, robot: Robot) -> tuple[Array, Array]:
    """Make the stance the last key: it replaces a last key close to it, or follows it."""
    stance = robot.standing.joint_pos
    if len(keys) > 1 and np.abs(keys[-1] - stance).max() <= SYMMETRIC:
        return np.vstack([keys[:-1], stance]), after
    return np.vstack([keys, stance]), np.append(after, find_travel_time(keys[-1], stance))


def choose_free(keys: Array, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Choose the joints that may be optimized: those that move or are not at 0, as in a file."""
    is_used = np.abs(keys).max(axis=0) > SYMMETRIC
    is_used |= is_used[robot.mirror_index]
    is_symmetric = bool(np.abs(keys - robot.mirror_joints(keys)).max() <= SYMMETRIC)
    is_paired = robot.mirror_index != np.arange(robot.n)
    if is_symmetric:
        is_left = np.isin(np.arange(robot.n), JointSides(robot).left)
        is_used &= is_left | ~is_paired
    free = np.flatnonzero(is_used)
    return free, is_paired[free] & is_symmetric


def guess_start(world: World, keyframes: Keyframes) -> Trial:
    """Find the start class of keyframes by playing them from every class.

    It settles in the first key in each. A robot that begins in its stance is taken to stand;
    otherwise takes the class whose rollout ends best.

    Returns:
        The trial from the best class; its keyframes have it.
    """
    stance = world.robot.standing.joint_pos
    if np.abs(keyframes.keys[0] - stance).max() <= IN_STANCE:
        return try_out(world, replace(keyframes, start_class=STANDING))
    trials = [try_out(world, replace(keyframes, start_class=side)) for side in CLASSES]
    root = world.robot.layout(world.model).root_orientation
    lying = [t for t in trials if classify(t.start[root]) == t.keyframes.start_class]
    squat = try_out(world, replace(keyframes, start_class="squat"))
    best = max(lying, key=lambda trial: (trial.succeeded, trial.progress), default=squat)
    # Upright, nearly any keys seem to rise: it counts only where lying down none does.
    return squat if squat.succeeded and not best.succeeded else best
