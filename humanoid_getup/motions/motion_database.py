"""The motion database: a robot's motions, retargeted to its body, and postures by name."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.motions.motion import FOUND, STANDING, Motion
from humanoid_getup.motions.posture_metric import PostureMetric
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import ORIGINAL, Posture, Robot, load_posture, reshape
from robots.body.half_kneel import HALF_KNEEL, fit_half_kneels
from robots.kinematics import lowest_points, place, place_postures
from robots.quaternion import Array
from robots.robot import ROBOTS_FOLDER

BODY = "body"
"""Key of a motion's provenance for the body that it was made for; none for the original."""
MOST_OVERLAP = 0.006  # m by which an entry posture may reach into itself; a goal of the planner


class Retargeting:
    """Retargets motions of a robot's original body to its present body, on flat ground.

    The joint angles and targets stay, as in [Lin12], section 5.3; what they do to the new body is
    up to the dynamics filter. The root is raised or lowered until the lowest point is as high as
    it was. Entry postures in which the new body reaches deep into itself are left out, unless the
    motion has no others.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._old, self._new = World(reshape(robot, ORIGINAL)), World(robot)
        self._clearance = Clearance(self._new)

    def retarget(self, motion: Motion) -> Motion:
        """Retarget a motion of the original body."""
        lifted = motion.position.copy()
        lifted[:, 2] += self._lowest(self._old, motion) - self._lowest(self._new, motion)
        free = motion.entry.copy()
        free[motion.entry_frames] = [self._is_free(motion, k) for k in motion.entry_frames]
        return replace(
            motion,
            position=lifted,
            entry=free if np.any(free) else motion.entry,
            provenance=motion.provenance | name_body(self._robot),
        )

    def _lowest(self, world: World, motion: Motion) -> Array:
        qpos = place_postures(
            world.robot, world.model, motion.position, motion.orientation, motion.joint_pos
        )
        return lowest_points(world.model, qpos)

    def _is_free(self, motion: Motion, frame: int) -> bool:
        qpos = place(self._robot, self._new.model, motion.posture(frame))
        return self._clearance.measure_self_overlap(qpos) <= MOST_OVERLAP


def adapt(motion: Motion, robot: Robot, retargeting: Retargeting | None = None) -> Motion:
    """Return a motion for the body that a robot has: its own, or retargeted from the original.

    Where many motions are adapted, they share a retargeting.
    """
    made_for, body = str(motion.provenance.get(BODY, "")), str(robot.body)
    if made_for == body:
        return motion
    if made_for:
        raise ValueError(
            f"motion '{motion.name}' was made for the body '{made_for}', expected "
            + (f"'{body}' or the original" if body else "the original")
        )
    return (retargeting or Retargeting(robot)).retarget(motion)


def name_body(robot: Robot) -> dict[str, str | float | int]:
    """Return the entry of a motion's provenance that names the robot's body, if it has another."""
    return {} if robot.body.is_original else {BODY: str(robot.body)}


MOTION_FOLDER = "motions"
FOUND_SIDES: tuple[LyingSide, ...] = ("supine", "prone", "left", "right")
"""Sides from which motions are found."""
SAME_TARGET = 0.001  # rad; a motion whose targets are closer to their mirror image is symmetric


@dataclass(frozen=True)
class Connection:
    """A frame of a motion at which a rise can join it."""

    motion: Motion
    frame: int
    distance: float
    """Distance from the posture of the query, in the posture metric."""

    @property
    def posture(self) -> Posture:
        """Return the connecting posture."""
        return self.motion.posture(self.frame)


class MotionDatabase:
    """Motions, and the entry postures of those that rise.

    Departure from [Lin12], section 4.1, whose postures are grouped in a tree by k-means: a
    query compares all of them, which finds the same and is as quick for a few thousand.
    """

    def __init__(self, motions: list[Motion], metric: PostureMetric) -> None:
        if not motions:
            raise ValueError("a motion database needs at least one motion")
        self.motions = tuple(motions)
        self.rising = rising = tuple(motion for motion in motions if motion.rises)
        """Motions that end standing; only these can be joined."""
        if not rising:
            raise ValueError("a motion database needs at least one motion that ends standing")
        self.metric = metric
        self._motion = np.repeat(np.arange(len(rising)), [len(m.entry_frames) for m in rising])
        self._frame = np.concatenate([m.entry_frames for m in rising])
        self._orientation = np.concatenate([m.orientation[m.entry_frames] for m in rising])
        self._joint_pos = np.concatenate([m.joint_pos[m.entry_frames] for m in rising])

    def __len__(self) -> int:
        return len(self._frame)

    def select(self, posture: Posture, count: int = 1, per_motion: int = 1) -> list[Connection]:
        """Find the entry postures nearest to a posture, at most ``per_motion`` of any rise."""
        distance = self.metric.distance(
            posture.orientation, posture.joint_pos, self._orientation, self._joint_pos
        )
        taken = np.zeros(len(self.rising), dtype=int)
        best: list[Connection] = []
        for row in np.argsort(distance, kind="stable"):
            motion = self._motion[row]
            if taken[motion] < per_motion:
                taken[motion] += 1
                frame = int(self._frame[row])
                best.append(Connection(self.rising[motion], frame, float(distance[row])))
            if len(best) == count:
                break
        return best


def load_database(robot: Robot) -> MotionDatabase:
    """Load a robot's motions, and the mirror image of each that is not symmetric.

    They are those of its original body, retargeted if it has another one.
    """
    folder = robot.folder / MOTION_FOLDER
    motions: list[Motion] = []
    retargeting = None if robot.body.is_original else Retargeting(robot)
    for path in sorted(folder.glob("*.npz")):
        motion = adapt(_load_own(path, robot), robot, retargeting)
        motions.append(motion)
        mirrored = motion.mirrored(robot)
        if not _is_same(motion, mirrored):
            motions.append(mirrored)
    if not motions:
        raise ValueError(f"robot '{robot.name}' has no motions: expected .npz files in {folder}")
    return MotionDatabase(motions, PostureMetric.of(robot))


def list_motions(robot: Robot) -> list[str]:
    """List the names of a robot's stored motions, which `find_motion` takes."""
    return sorted(file.stem for file in (robot.folder / MOTION_FOLDER).glob("*.npz"))


def suggest_motions(robot: Robot) -> str:
    """Suggest a command for a robot that has no motion from a side."""
    sides = list_sides(robot)
    missing = [side for side in sides if not list_found(robot, side)]
    option = f" --sides {','.join(missing)}" if 0 < len(missing) < len(sides) else ""
    return f"getup motions discover {name_robot(robot)}{option}"


def list_sides(robot: Robot) -> tuple[LyingSide, ...]:
    """List the sides from which motions of a robot are searched.

    Those from the right mirror those from the left, unless a limp joint has a partner that is not.
    """
    is_symmetric = np.array_equal(robot.strength, robot.strength[robot.mirror_index])
    return FOUND_SIDES[:-1] if is_symmetric else FOUND_SIDES


def list_found(robot: Robot, side: LyingSide, label: str = FOUND) -> list[str]:
    """List the names of stored motions that a search has found from a side, by their label."""
    files = (robot.folder / MOTION_FOLDER).glob(f"{side}_{label}_[0-9]*.npz")
    return sorted(file.stem for file in files)


def name_robot(robot: Robot) -> str:
    """Write the option that names a robot to a command."""
    is_ours = robot.folder.parent == ROBOTS_FOLDER
    return f"--robot {robot.name if is_ours else robot.folder}"


def find_lying_down(robot: Robot) -> Motion:
    """Find a robot's own motion that lies down from a stand."""
    if found := list_lying_down(robot):
        return found[0]
    raise ValueError(
        f"robot '{robot.name}' has no motion from a stand to lying, expected one in "
        f"{robot.folder / MOTION_FOLDER}"
    )


def list_lying_down(robot: Robot) -> list[Motion]:
    """List a robot's own motions that lie down from a stand."""
    motions = load_database(robot).motions
    return [motion for motion in motions if motion.start_class == STANDING and not motion.rises]


def find_motion(robot: Robot, name: str) -> Motion:
    """Find a motion by name in a robot's database, or load an .npz file."""
    if not name.endswith(".npz"):
        motions = {motion.name: motion for motion in load_database(robot).motions}
        if name not in motions:
            known = ", ".join(motions)
            raise ValueError(f"unknown motion '{name}', expected {known} or an .npz file")
        return motions[name]
    return adapt(_load_own(Path(name), robot), robot)


def _load_own(path: Path, robot: Robot) -> Motion:
    """Load a motion file of this robot."""
    motion = Motion.load(path)
    joints = motion.joint_pos.shape[1]
    if motion.robot != robot.name or joints != robot.n:
        raise ValueError(
            f"motion file {path}: made for '{motion.robot}' with {joints} joints, "
            f"expected '{robot.name}' with {robot.n}"
        )
    return motion


def _is_same(a: Motion, b: Motion) -> bool:
    """Return whether two motions have the same times, start class and targets."""
    targets_differ = float(np.abs(a.joint_target - b.joint_target).max())
    return a.start_class == b.start_class and targets_differ < SAME_TARGET


MOTIONS = "motions:"
EXAMPLE = "motions:supine_sit_up_gentle@1.2"


@dataclass(frozen=True, kw_only=True, eq=False)
class KeyPosture:
    """A posture with the name by which it was requested."""

    name: str
    posture: Posture
    others: tuple[Posture, ...] = ()
    """Which may take its place where the robot does not rest in it."""


def label_key(name: str) -> str:
    """Write the name of a posture as that of a motion may contain it."""
    return re.sub(r"\W+", "_", Path(name).stem)


def name_keys(keys: Sequence[Posture | KeyPosture]) -> tuple[KeyPosture, ...]:
    """Give each posture without a name its number, from 1."""
    return tuple(
        key if isinstance(key, KeyPosture) else KeyPosture(name=f"key {number}", posture=key)
        for number, key in enumerate(keys, start=1)
    )


def load_key(text: str, robot: Robot) -> KeyPosture:
    """Load a posture file, the frame of a motion that ``motions:NAME@TIME`` names, or a half-kneel.

    NAME is that of a motion in the robot's database or of an .npz file, TIME is counted from its
    first frame [s]; the nearest frame is taken.
    """
    if text.startswith(MOTIONS):
        return KeyPosture(name=text, posture=_pick_frame(text, robot))
    if text == HALF_KNEEL:
        first, *others = fit_half_kneels(robot)
        return KeyPosture(name=text, posture=first, others=tuple(others))
    path = Path(text)
    if not path.exists():
        raise ValueError(
            f"posture '{text}': no such file, expected a posture file, {HALF_KNEEL} or "
            "motions:NAME@TIME"
        )
    return KeyPosture(name=text, posture=load_posture(path, robot))


def _pick_frame(text: str, robot: Robot) -> Posture:
    name, _, at = text.removeprefix(MOTIONS).rpartition("@")
    try:
        time = float(at)
    except ValueError:
        time = math.nan
    if not name or not math.isfinite(time):
        raise ValueError(f"posture '{text}': expected motions:NAME@TIME, such as {EXAMPLE}")
    motion = find_motion(robot, name)
    if not 0.0 <= time <= motion.duration:
        raise ValueError(
            f"posture '{text}': its time is {time:g} s, expected 0 to {motion.duration:.2f} s"
        )
    return motion.posture(int(np.argmin(np.abs(motion.time - motion.time[0] - time))))
