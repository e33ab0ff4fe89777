"""Initial states of training episodes: frames of motions, settled falls, robots that stand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.drop import Drops, FallError
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.scenes.scene import StartRegion
from humanoid_getup.simulation.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.body.parts import find_arm_joints
from robots.kinematics import mirror_positions, place
from robots.quaternion import Array
from robots.storage.arrays import check_robot, load_arrays, save_arrays, to_numbers
from robots.storage.validation import reading
from sim2real.environment.terrain import Terrain

# Weight of the last episode in the success rate of an initial state: the last three episodes
# dominate, since older ones are of an earlier policy.
MEMORY = 0.3
# Weight of an initial state that always ends standing, relative to one that never does: low
# enough to leave time for hard ones, high enough that it is not forgotten.
LEAST = 0.15


@dataclass(eq=False)
class StartPool:
    """Initial states with their success rates; those that fail are drawn more often."""

    qpos: Array
    """MuJoCo positions, (P, nq)."""
    success: Array
    """Running fraction of episodes that ended standing, (P,)."""
    level: NDArray[np.int_]
    """How difficult each state is, 0 for the easiest, such as flat ground, (P,)."""
    fallen: NDArray[np.bool_]
    """Whether each state is a settled fall; the others are frames of motions, (P,)."""

    @staticmethod
    def of(
        qpos: Array, level: NDArray[np.int_] | None = None, fallen: NDArray[np.bool_] | None = None
    ) -> StartPool:
        """Make a pool whose success rates are 0; by default all states are falls of level 0."""
        count = len(qpos)
        return StartPool(
            qpos,
            np.zeros(count),
            np.zeros(count, dtype=int) if level is None else level,
            np.ones(count, dtype=bool) if fallen is None else fallen,
        )

    def draw(self, count: int, rng: np.random.Generator, highest: int = 0) -> NDArray[np.int_]:
        """Draw rows of the pool, as often from each level up to the highest, hard ones more often.

        Otherwise most episodes would begin on the level where no robot rises yet.
        """
        weight = LEAST + (1.0 - LEAST) * (1.0 - self.success)
        if self.level.any():
            weight = weight / np.bincount(self.level, weight)[self.level]
        weight = np.where(self.level <= highest, weight, 0.0)
        total = np.cumsum(weight)
        return np.searchsorted(total, rng.uniform(0.0, total[-1], count))

    def note(self, starts: NDArray[np.int_], stood: NDArray[np.bool_]) -> None:
        """Update the success rates by some episodes."""
        self.success[starts] += MEMORY * (stood - self.success[starts])

    def save(self, file: Path, robot: Robot) -> None:
        """Write the initial states and the robot's name to an .npz file."""
        arrays = {"qpos": self.qpos, "robot": robot.name}
        arrays |= {"level": self.level} if self.level.any() else {}
        arrays |= {} if self.fallen.all() else {"fallen": self.fallen}
        save_arrays(file, arrays)

    @staticmethod
    def load(file: Path, robot: Robot, width: int) -> StartPool:
        """Read a robot's initial states, of ``width`` MuJoCo positions, from an .npz file."""
        with reading(f"{file} holds no starts, expected an .npz of falls"):
            arrays = load_arrays(file, ("qpos", "robot"), optional=("level", "fallen"))
            check_robot(arrays["robot"], robot.name)
            qpos = to_numbers(arrays["qpos"], "qpos", (None, width))
            level, fallen = arrays.get("level"), arrays.get("fallen")
            if level is not None:
                level = to_numbers(level, "level", (len(qpos),)).astype(int)
            if fallen is not None:
                fallen = to_numbers(fallen, "fallen", (len(qpos),)).astype(bool)
        return StartPool.of(qpos, level, fallen)


# Every fourth frame of a motion, 32 ms apart on the OP3: between two, joints move 0.17 rad at
# most, so that more frames would hardly differ.
FRAMES_APART = 4
LEVELS = 6  # of the ways that are left to the stand


def list_motion_starts(robot: Robot, model: mujoco.MjModel) -> Array:
    """List frames of the robot's stored motions as MuJoCo positions, (M, nq)."""
    files = sorted((robot.folder / MOTION_FOLDER).glob("*.npz"))
    frames = [
        place(robot, model, motion.posture(frame))
        for motion in map(Motion.load, files)
        for frame in range(0, len(motion.time), FRAMES_APART)
    ]
    return np.array(frames).reshape(-1, model.nq)


def list_rises(robot: Robot) -> list[Motion]:
    """List the robot's stored motions that rise, of which one is expected."""
    folder = robot.folder / MOTION_FOLDER
    rises = [motion for file in sorted(folder.glob("*.npz")) if (motion := Motion.load(file)).rises]
    if not rises:
        raise ValueError(
            f"robot '{robot.name}' has no rising motion in {folder} to start along, expected one "
            f"(getup motions discover --robot {robot.name})"
        )
    return rises


def list_backward_starts(robot: Robot, model: mujoco.MjModel) -> tuple[Array, NDArray[np.int_]]:
    """List frames of the robot's rises as MuJoCo positions (M, nq), and their levels (M,).

    Level 0 are frames of the last sixth of a rise, up to `LEVELS` - 1 for those of the first. Each
    comes with its mirror image.
    """
    frames, levels = list[Array](), list[int]()
    for motion in list_rises(robot):
        left = 1.0 - (motion.time - motion.time[0]) / (motion.time[-1] - motion.time[0])
        for frame in range(0, len(motion.time), FRAMES_APART):
            frames.append(place(robot, model, motion.posture(frame)))
            levels.append(min(int(left[frame] * LEVELS), LEVELS - 1))
    states = np.array(frames)
    both = np.concatenate([states, mirror_positions(robot, model, states)])
    return both, np.tile(levels, 2)


# rad/s and m/s; with coarse physics steps a robot at rest moves at up to 0.03; rolling and
# sliding are faster.
SETTLED_SPEED = 0.5
MOST_ROUNDS = 50  # batches to drop for each that would do if every robot settled
POOL_SEED = 7_001  # makes the falls of training differ from those of evaluation
BATCH = 512  # robots that are dropped together


def make_pool(world: World, count: int, rng: np.random.Generator) -> StartPool:
    """Make a pool of ``count`` settled falls and their mirror images."""
    drops = Drops(world, min(count, BATCH))
    falls = drop_falls(drops, count, rng)
    return StartPool.of(np.concatenate([falls, mirror_positions(world.robot, world.model, falls)]))


def make_backward_pool(world: World, count: int, rng: np.random.Generator) -> StartPool:
    """Make a pool of frames of the robot's rises, the last ones easiest, and of settled falls."""
    frames, levels = list_backward_starts(world.robot, world.model)
    falls = make_pool(world, count, rng).qpos
    fallen = np.repeat([False, True], [len(frames), len(falls)])
    level = np.concatenate([levels, np.full(len(falls), LEVELS)])
    return StartPool.of(np.concatenate([frames, falls]), level, fallen)


def make_terrain_pool(
    world: World, terrain: Terrain, count: int, rng: np.random.Generator
) -> StartPool:
    """Make a pool of settled falls on each patch of a terrain, the world's scene.

    There are ``count`` on each of two patches of a level, and twice as many if it has only one.
    """
    falls, levels = [], []
    drops = Drops(world, min(count, BATCH))
    for patch in terrain.patches:
        beside = sum(other.level == patch.level for other in terrain.patches)
        falls.append(drop_falls(drops, 2 * count // beside, rng, (patch.region,)))
        levels.append(np.full(len(falls[-1]), patch.level))
    return StartPool.of(np.concatenate(falls), np.concatenate(levels))


def pool_rng(seed: int) -> np.random.Generator:
    """Make the random source of a training's falls, which differs from every evaluation's.

    Evaluations draw from ``default_rng(seed)``, which differs for every seed below 2**32.
    """
    return np.random.default_rng([seed, POOL_SEED])


def drop_falls(
    drops: Drops, count: int, rng: np.random.Generator, regions: Sequence[StartRegion] = ()
) -> Array:
    """Drop robots with torque off in random postures until ``count`` have settled, (count, nq).

    They fall in some regions of the scene; what rolls out of all of them is left out.
    """
    found: list[Array] = []
    rounds = MOST_ROUNDS * math.ceil(count / drops.count)
    for _ in range(rounds):
        qpos, settled = drops.drop(SETTLED_SPEED, rng, regions=regions)
        if regions:
            root = drops.world.robot.layout(drops.world.model).root_position
            inside = [any(region.spans(row[root]) for region in regions) for row in qpos]
            settled &= np.array(inside)
        found.append(qpos[settled])
        if sum(map(len, found)) >= count:
            return np.concatenate(found)[:count]
    raise FallError(
        f"robot '{drops.world.robot.name}' does not come to rest: {sum(map(len, found))} of "
        f"{rounds * drops.count} falls settled, expected {count}"
    )


TERRAIN_STANDS = 2048
RAISES = 3  # by what a robot is in a slope, which is less than what it must come up
NEARLY_RISEN = 0.85  # of the height of a standing torso


def sample_stands(
    robot: Robot, model: mujoco.MjModel, count: int, rng: np.random.Generator
) -> Array:
    """Sample standing robots with arms between a random posture and home, (count, nq).

    A rise leaves the arms wherever they were swung, usually at a joint limit, where exploration
    changes nothing. A policy learns to bring them home from states in which home is near.
    """
    layout, data = robot.layout(model), mujoco.MjData(model)
    standing = place(robot, model, robot.standing)
    home = robot.standing.joint_pos
    arms = find_arm_joints(robot, model)
    stands = np.tile(standing, (count, 1))
    for qpos in stands:
        anywhere = rng.uniform(robot.lower, robot.upper)
        share = rng.uniform() * arms
        data.qpos[:] = qpos
        data.qpos[layout.qpos] = home + share * (anywhere - home)
        mujoco.mj_forward(model, data)
        bodies = model.geom_bodyid[data.contact.geom]  # (contacts, 2)
        if (bodies == 0).any(axis=1).all():
            qpos[:] = data.qpos
    return stands


def sample_terrain_stands(
    world: World, terrain: Terrain, rises: Array, rng: np.random.Generator
) -> StartPool:
    """Sample robots that stand, or have nearly risen, on a terrain, the world's scene.

    The latter are states of rises on level ground, (S, nq), in which the torso is high.
    """
    robot, model = world.robot, world.model
    upward = robot.layout(model).root_position.start + 2
    high = rises[rises[:, upward] >= NEARLY_RISEN * robot.standing.position[2]]
    count = TERRAIN_STANDS // 2 if len(high) else 0
    states = [sample_stands(robot, model, TERRAIN_STANDS - count, rng)]
    if count:
        states.append(high[rng.integers(0, len(high), count)])
    return _place_on_terrain(world, terrain, np.concatenate(states), rng)


def _place_on_terrain(
    world: World, terrain: Terrain, states: Array, rng: np.random.Generator
) -> StartPool:
    """Place robots that stand on level ground, (S, nq), anywhere; the torso stays upright."""
    robot, model = world.robot, world.model
    layout, fit, data = robot.layout(model), GroundFit(world), mujoco.MjData(model)
    upward = layout.root_position.start + 2
    patches = rng.integers(0, len(terrain.patches), len(states))
    placed = states.copy()
    for qpos, patch in zip(placed, patches, strict=True):
        region = terrain.patches[patch].region
        turn = quaternion.from_yaw(rng.uniform(-np.pi, np.pi))
        at = np.array([rng.uniform(*region.x), rng.uniform(*region.y), qpos[upward]])
        qpos[layout.root_position] = at
        qpos[layout.root_orientation] = quaternion.multiply(turn, qpos[layout.root_orientation])
        qpos[upward] += fit.measure_level(qpos)
        qpos[layout.qpos] += fit.shift_legs(qpos)
        for _ in range(RAISES):
            data.qpos[:] = qpos
            mujoco.mj_forward(model, data)
            qpos[upward] -= min(0.0, float(np.min(data.contact.dist, initial=0.0)))
    levels = np.array([patch.level for patch in terrain.patches])
    return StartPool.of(placed, levels[patches])
