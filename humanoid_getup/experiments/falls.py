"""Lying postures: their classes, and falls that lead to them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.drop import DROP_HEIGHT, LONGEST_FALL, Drops, FallError
from humanoid_getup.experiments.judging.lying import LyingSide
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.scenes.scene import Scene, StartRegion
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.arguments import expect, expect_seed
from robots.kinematics import lowest_point, place, read_posture
from robots.posture import MAX_DISTANCE
from robots.quaternion import Array
from robots.storage.arrays import load_arrays, save_arrays, to_numbers, to_text
from robots.storage.validation import outside, reading, shown

CLASSES: tuple[LyingSide, ...] = get_args(LyingSide)
UNCLASSED = "other"  # start class of a robot that lies on no side
BATCH = 24
MOST_BATCHES = 400
MOST_IN_VAIN = 20  # batches in a row without a robot on a requested side
MOST_MOVED_IN_VAIN = 100  # the same of robots that are put into the scene when they have settled
RESTING = 0.003  # m that a robot at rest sinks into what it lies on


# rad/s and m/s of a settled robot. Joints without torque creep at 0.025 rad/s (median) under the
# weight they carry, for minutes; of 96 OP3s, 91 are slower than 0.05 after 3 s, 94 after 6 s.
SETTLED_SPEED = 0.05


@dataclass(frozen=True, kw_only=True)
class Fall:
    """A robot that fell and lies still."""

    posture: Posture
    start_class: str

    def __repr__(self) -> str:
        return f"Fall({self.start_class}, torso at {self.posture.position.round(3).tolist()} m)"


def classify(orientation: Array) -> LyingSide | None:
    """Classify a torso orientation by gravity: supine, prone, left or right side down.

    Returns None where gravity points mostly along the torso: upright or head down.
    """
    x, y, z = quaternion.gravity_in_body(orientation)
    if abs(z) > max(abs(x), abs(y)):
        return None
    if abs(x) >= abs(y):
        return "supine" if x < 0.0 else "prone"
    return "left" if y > 0.0 else "right"


def find_side(posture: Posture) -> LyingSide:
    """Classify a robot by the side to which it leans; it need not lie."""
    return classify(posture.orientation) or ("prone" if posture.gravity_b[0] > 0.0 else "supine")


def sample_fall(world: World, start_class: str = "supine", seed: int = 0) -> Fall:
    """Drop limp robots with random joints until one comes to lie in a class.

    Raises:
        ValueError: if there is no such class, or an argument is of another type.
        FallError: if the class does not occur.
    """
    expect("world", world, World, "a World, e.g. World(robot)")
    if start_class not in CLASSES:
        raise ValueError(f"start class is '{start_class}', expected {', '.join(CLASSES)}")
    expect_seed(seed)
    return sample_falls(world, {start_class: 1}, np.random.default_rng(seed))[0]


def drop_from(world: World, posture: Posture) -> Fall:
    """Drop a limp robot from a posture, a little above what is under it; return how it lies."""
    raised = Clearance(world).rest_where(place(world.robot, world.model, posture), DROP_HEIGHT)
    qpos, settled = Drops(world, 1).settle(raised[np.newaxis], SETTLED_SPEED)
    if not settled[0]:
        raise FallError(
            f"robot '{world.robot.name}' still moves {LONGEST_FALL:g} s after it was dropped"
        )
    rest = read_posture(world.robot, world.model, qpos[0])
    return Fall(posture=rest, start_class=classify(rest.orientation) or UNCLASSED)


def sample_fall_set(
    world: World,
    counts: dict[str, int],
    seed: int,
    report: Callable[[float], None] = lambda _: None,
) -> FallSet:
    """Sample falls as :func:`sample_falls` does, and count the robots that did not settle."""
    falls, dropped, left_out = _sample(world, counts, np.random.default_rng(seed), report)
    return FallSet(
        robot=world.robot.name,
        scene=world.scene.name,
        seed=seed,
        falls=tuple(falls),
        dropped=dropped,
        left_out=left_out,
    )


def sample_falls(world: World, counts: dict[str, int], rng: np.random.Generator) -> list[Fall]:
    """Drop robots without torque until every class has its count.

    They start with random joint angles within the limits, in any orientation, and settle for up
    to 10 s; the few that still move are left out. Then they are classified, and rejected where
    the class is full or the robot does not lie. The class "lateral" is left or right.
    """
    return _sample(world, counts, rng)[0]


def _sample(
    world: World,
    counts: dict[str, int],
    rng: np.random.Generator,
    report: Callable[[float], None] = lambda _: None,
) -> tuple[list[Fall], int, int]:
    """Sample falls; return them with the numbers of dropped and left out robots."""
    bare = replace(world.scene, obstacles=(), starts=())
    is_settled = any(start.is_settled for start in world.scene.starts)
    drops = Drops(World(world.robot, bare) if is_settled else world, BATCH)
    clearance = Clearance(world)
    wanted = dict(counts)
    falls: list[Fall] = []
    left_out = in_vain = 0
    for batch in itertools.count():
        if not any(wanted.values()):
            break
        if batch == MOST_BATCHES or in_vain == (MOST_MOVED_IN_VAIN if is_settled else MOST_IN_VAIN):
            missing = ", ".join(f"{count} {name}" for name, count in wanted.items() if count)
            raise FallError(
                f"sampling falls of robot '{world.robot.name}' in scene '{world.scene.name}' "
                f"failed: {missing} missing after {batch * BATCH} falls, none in the last "
                f"{in_vain * BATCH} (expected: starts where a robot that falls comes to rest, "
                "with room to lie on that side)"
            )
        in_vain += 1
        before = len(falls)
        regions = _choose(world.scene, wanted)
        qpos, settled = drops.drop(SETTLED_SPEED, rng, regions=() if is_settled else regions)
        left_out += int(np.sum(~settled))
        for posture in (read_posture(world.robot, drops.world.model, q) for q in qpos[settled]):
            found = classify(posture.orientation)
            region = next((r for r in regions if r.start_class == found), None)
            if region is not None and is_settled:
                posture = region.move(posture, rng)
                if clearance.measure_overlap(place(world.robot, world.model, posture)) > RESTING:
                    continue
            starts = world.scene.starts
            if found is None or (starts and not any(s.accepts(posture, found) for s in starts)):
                continue
            key = _count_as(found, counts)
            if wanted.get(key, 0) > 0:
                wanted[key] -= 1
                in_vain = 0
                falls.append(Fall(posture=posture, start_class=found))
        report(len(falls) - before)
    order = list(counts)
    falls.sort(key=lambda fall: order.index(_count_as(fall.start_class, counts)))
    return falls, batch * BATCH, left_out


def _choose(scene: Scene, wanted: dict[str, int]) -> list[StartRegion]:
    """Choose the regions of a scene in which robots may fall into a requested class."""
    lacking = {name for name, count in wanted.items() if count}
    starts = [s for s in scene.starts if _count_as(str(s.start_class), wanted) in lacking]
    if scene.starts and not starts:
        classes = ", ".join(dict.fromkeys(str(start.start_class) for start in scene.starts))
        raise FallError(
            f"scene '{scene.name}' has no start {', '.join(sorted(lacking))}, expected {classes}"
        )
    return starts


def _count_as(start_class: str, counts: dict[str, int]) -> str:
    is_lateral = start_class in ("left", "right")
    return "lateral" if is_lateral and "lateral" in counts else start_class


FALL_KEYS = ("robot", "scene", "seed", "position", "orientation", "joint_pos", "start_class")
"""Keys of a file of falls."""
SLACK = 1e-9  # rad
COUNT_KEYS = ("dropped", "left_out")
"""Keys that older files of falls do not have."""


@dataclass(frozen=True, kw_only=True)
class FallSet:
    """Falls of one robot, and how they were sampled."""

    robot: str
    """Name of the robot."""
    scene: str
    """Name of the scene in which it fell."""
    seed: int
    """Seed of the samples."""
    falls: tuple[Fall, ...]
    dropped: int | None = None
    """Number of robots that were dropped for it; ``None`` if not counted."""
    left_out: int | None = None
    """Number of those that still moved after 10 s and were left out; ``None`` as above."""

    def choose(self, each: int) -> FallSet:
        """Choose the first ``each`` falls of every class."""
        kinds = {kind: [f for f in self.falls if f.start_class == kind] for kind in CLASSES}
        few = [f"{len(falls)} {kind}" for kind, falls in kinds.items() if len(falls) < each]
        if few:
            raise ValueError(f"the set of falls has {', '.join(few)}, expected {each} of each")
        return replace(self, falls=tuple(fall for falls in kinds.values() for fall in falls[:each]))

    def save(self, file: Path) -> None:
        """Write an .npz file with the keys of `FALL_KEYS`."""
        file.parent.mkdir(parents=True, exist_ok=True)
        postures = [fall.posture for fall in self.falls]
        arrays = {
            "robot": self.robot,
            "scene": self.scene,
            "seed": self.seed,
            "position": np.array([posture.position for posture in postures]),
            "orientation": np.array([posture.orientation for posture in postures]),
            "joint_pos": np.array([posture.joint_pos for posture in postures]),
            "start_class": np.array([fall.start_class for fall in self.falls]),
        }
        for key in COUNT_KEYS:
            if getattr(self, key) is not None:
                arrays[key] = getattr(self, key)
        save_arrays(file, arrays)

    @staticmethod
    def load(file: Path, robot: Robot, scene: str = "") -> FallSet:
        """Read a robot's falls, in a scene if its name is given."""
        advice = " (expected: an .npz that `getup eval` wrote with --falls)"
        with reading(f"falls {file}", advice=advice):
            falls = _read_falls(load_arrays(file, FALL_KEYS, optional=COUNT_KEYS), robot)
            if scene and falls.scene != scene:
                raise ValueError(f"they are of scene '{falls.scene}', not '{scene}'")
            return falls


def _check_falls(robot: Robot, position: Array, joint_pos: Array) -> None:
    """Raise ValueError if falls are not postures of the robot."""
    beyond = (joint_pos < robot.lower - SLACK) | (joint_pos > robot.upper + SLACK)
    for row, joint in np.argwhere(beyond)[:1]:
        limits = float(robot.lower[joint]), float(robot.upper[joint])
        angle = outside(float(joint_pos[row, joint]), *limits, "rad")
        raise ValueError(f"fall {row}: joint '{robot.joint_names[joint]}' is {angle}")
    for row in np.flatnonzero(np.abs(position).max(axis=1) > MAX_DISTANCE):
        raise ValueError(f"fall {row}: position is more than {MAX_DISTANCE:g} m from the origin")


def _read_falls(arrays: dict[str, NDArray[Any]], robot: Robot) -> FallSet:
    name, scene = (to_text(arrays[key], key) for key in ("robot", "scene"))
    if name != robot.name:
        raise ValueError(f"it is of robot {shown(name)}, expected '{robot.name}'")
    for key in ("seed", *COUNT_KEYS):
        if key in arrays and (arrays[key].shape != () or arrays[key].dtype.kind not in "iu"):
            raise ValueError(f"{key} is not an integer")
    classes = arrays["start_class"]
    if classes.ndim != 1 or classes.dtype.kind != "U" or not np.isin(classes, CLASSES).all():
        raise ValueError(f"start_class is not a list of {', '.join(CLASSES)}")
    widths = {"position": 3, "orientation": 4, "joint_pos": robot.n}
    rows = [to_numbers(arrays[key], key, (len(classes), n)) for key, n in widths.items()]
    _check_falls(robot, rows[0], rows[2])
    falls = tuple(
        Fall(posture=Posture(position=p, orientation=q, joint_pos=v), start_class=str(kind))
        for p, q, v, kind in zip(*rows, classes, strict=True)
    )
    counts = {key: int(arrays[key]) for key in COUNT_KEYS if key in arrays}
    return FallSet(robot=name, scene=scene, seed=int(arrays["seed"]), falls=falls, **counts)


HELD_TIME = 1.5  # s in which a held posture comes to rest


def settle_posture(world: World, posture: Posture) -> Array:
    """Let a posture with held joints settle on the ground; return MuJoCo positions (nq,)."""
    robot, model = world.robot, world.model
    raised = replace(posture, position=np.array([*posture.position[:2], 1.0]))
    qpos = place(robot, model, raised)
    qpos[robot.layout(model).root_qpos + 2] = 0.005 + 1.0 - lowest_point(model, qpos)
    cycles = round(HELD_TIME / robot.control_period)
    targets = np.tile(posture.joint_pos, (1, cycles, 1))
    return play(world, Scenarios.nominal(world, qpos), targets).qpos[0, -1]


def find_rest(world: World, posture: Posture) -> Posture:
    """Let a posture with held joints settle on the ground; return the posture at rest."""
    return read_posture(world.robot, world.model, settle_posture(world, posture))
