"""Where training episodes begin: settled falls, places along known motions, and standing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import MOTION_FOLDER
from humanoid_getup.policy.action import CYCLES
from humanoid_getup.simulation.falls import FallError, sample_drop
from robots import Robot, quaternion
from robots.arrays import ArchiveError, load_arrays, save_arrays, to_numbers, to_text
from robots.kinematics import place
from robots.quaternion import Array
from sim2real.environment.conditions import Conditions
from sim2real.environment.vectorized_simulation import Herd

# Policy steps that a dropped robot lies limp: after these 2.4 s, 98 of 100 OP3 lie still.
SETTLE_STEPS = 50
# rad/s and m/s; what still rolls or slides is faster, a still robot's contacts creep at 0.03.
WORST_SPEED = 0.5
MOST_ROUNDS = 50  # drops of the whole herd for each that is needed if everyone lies still
# Weight of the last episode in a start's share of success: three episodes tell most of it,
# since a training that learns makes older ones worthless.
MEMORY = 0.3
# Weight of a start that always ends standing, against one that never does: seldom enough to
# leave time for the hard ones, often enough not to be unlearnt.
LEAST = 0.15
POOL_SEED = 7_001  # sets the falls of trainings apart from those that seeds alone give
# Of a motion's frames, one each 32 ms at the OP3's 8 ms: between two, joints move 0.17 rad at
# most, so that more frames would hardly differ.
FRAMES_APART = 4
MOST_AT_ONCE = 512  # robots that are dropped together


@dataclass(eq=False)
class StartPool:
    """Starts, and how often each has ended standing: what fails is tried more often."""

    qpos: Array
    """MuJoCo positions, (P, nq)."""
    success: Array
    """Running share of episodes that ended standing, (P,)."""

    @staticmethod
    def of(qpos: Array) -> StartPool:
        """Make a pool of which nothing is known yet."""
        return StartPool(qpos, np.zeros(len(qpos)))

    def draw(self, count: int, rng: np.random.Generator) -> NDArray[np.int_]:
        """Draw starts, hard ones more often."""
        weight = LEAST + (1.0 - LEAST) * (1.0 - self.success)
        total = np.cumsum(weight)
        return np.searchsorted(total, rng.uniform(0.0, total[-1], count))

    def note(self, starts: NDArray[np.int_], stood: NDArray[np.bool_]) -> None:
        """Remember how some episodes ended."""
        self.success[starts] += MEMORY * (stood - self.success[starts])

    def save(self, file: Path, robot: Robot) -> None:
        """Write the starts to an .npz file, and whose they are."""
        save_arrays(file, {"qpos": self.qpos, "robot": robot.name})

    @staticmethod
    def load(file: Path, robot: Robot, width: int) -> StartPool:
        """Read starts from an .npz file.

        Args:
            file: Where they lie.
            robot: Robot that shall start there.
            width: Numbers of its MuJoCo positions, nq.

        Raises:
            ValueError: if the file holds none, or those of another robot.
        """
        try:
            arrays = load_arrays(file, ("qpos", "robot"))
            name = to_text(arrays["robot"], "robot")
            qpos = to_numbers(arrays["qpos"], "qpos", (None, width))
            if name != robot.name:
                raise ArchiveError(f"it is of robot '{name}', expected '{robot.name}'")
        except (OSError, ArchiveError) as error:
            raise ValueError(
                f"{file} holds no starts, expected an .npz of falls: {error}"
            ) from error
        return StartPool.of(qpos)


def make_pool(
    robot: Robot, model: mujoco.MjModel, count: int, rng: np.random.Generator
) -> StartPool:
    """Make a pool of ``count`` settled falls and their mirror images."""
    herd = Herd(model, robot, min(count, MOST_AT_ONCE), cycles=CYCLES)
    falls = drop_falls(herd, count, rng)
    return StartPool.of(np.concatenate([falls, mirror_starts(robot, model, falls)]))


def pool_rng(seed: int) -> np.random.Generator:
    """Make the source of a training's falls: another one than evaluations draw theirs from."""
    return np.random.default_rng([seed, POOL_SEED])


def drop_falls(herd: Herd, count: int, rng: np.random.Generator) -> Array:
    """Drop limp robots in random postures until ``count`` lie still, (count, nq).

    Raises:
        FallError: if too few come to lie still.
    """
    robot, model = herd.robot, herd.model
    limp = Conditions.nominal(robot, model.nbody, herd.n, torque_limit=0.0)
    everyone = np.arange(herd.n)
    herd.set_conditions(everyone, limp)
    data = mujoco.MjData(model)
    target = np.zeros((herd.n, robot.n))
    found: list[Array] = []
    rounds = MOST_ROUNDS * math.ceil(count / herd.n)
    for _ in range(rounds):
        starts = np.array([sample_drop(robot, model, data, rng) for _ in everyone])
        herd.place(everyone, starts)
        for _ in range(SETTLE_STEPS):
            herd.advance(target, target)
        still = np.abs(herd.qvel).max(axis=1) < WORST_SPEED
        found.append(herd.qpos[still])
        if sum(map(len, found)) >= count:
            return np.concatenate(found)[:count]
    raise FallError(
        f"robot '{robot.name}' does not come to lie still: {sum(map(len, found))} of "
        f"{rounds * herd.n} falls did, {count} are needed"
    )


def mirror_starts(robot: Robot, model: mujoco.MjModel, qpos: Array) -> Array:
    """Exchange left and right in MuJoCo positions (P, nq)."""
    layout = robot.layout(model)
    root = layout.root_qpos
    mirrored = qpos.copy()
    mirrored[:, root + 1] *= -1.0
    mirrored[:, root + 3 : root + 7] = quaternion.mirror(qpos[:, root + 3 : root + 7])
    mirrored[:, layout.qpos] = robot.mirror_joints(qpos[:, layout.qpos])
    return mirrored


def sample_stands(
    robot: Robot, model: mujoco.MjModel, count: int, rng: np.random.Generator
) -> Array:
    """Sample standing robots whose arms are anywhere on their way home, (count, nq).

    A rise ends with the arms where they were thrown, at a stop as a rule, where small trials
    change nothing: that they belong home is learned from where it is near.
    """
    layout, data = robot.layout(model), mujoco.MjData(model)
    standing = place(robot, model, robot.standing)
    home = robot.standing.joint_pos
    arms = find_arms(robot, model)
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


def find_arms(robot: Robot, model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Find the joints that a rise moves, and that no foot hangs on, (n,)."""
    rising = np.array([robot.joint_names.index(name) for name in robot.rising_joints], dtype=int)
    arms = np.zeros(robot.n, dtype=bool)
    arms[rising] = arms[robot.mirror_index[rising]] = True
    joint_bodies = model.jnt_bodyid[[model.joint(name).id for name in robot.joint_names]]
    for site in robot.sole_sites:
        body = int(model.site_bodyid[model.site(site).id])
        while body:
            arms &= joint_bodies != body
            body = int(model.body_parentid[body])
    return arms


def list_motion_starts(robot: Robot, model: mujoco.MjModel) -> Array:
    """List the frames of the robot's known motions as MuJoCo positions (M, nq)."""
    files = sorted((robot.folder / MOTION_FOLDER).glob("*.npz"))
    frames = [
        place(robot, model, motion.posture(frame))
        for motion in map(Motion.load, files)
        for frame in range(0, len(motion.time), FRAMES_APART)
    ]
    return np.array(frames).reshape(-1, model.nq)
