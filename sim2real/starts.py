"""Where training episodes begin: settled falls, places along known motions, and standing."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.action import CYCLES
from humanoid_getup.database import MOTION_FOLDER
from humanoid_getup.ground import lowest_point
from humanoid_getup.lying import DROP_HEIGHT, SPAWN_OVERLAP
from humanoid_getup.motion import Motion
from humanoid_getup.stage import place
from robots import Posture, Robot, rotation
from robots.rotation import Array
from sim2real.conditions import Conditions
from sim2real.herd import Herd

SETTLE_STEPS = 50  # policy steps that a dropped robot lies limp
MEMORY = 0.3  # weight of the last episode in a start's share of success
LEAST = 0.15  # weight of a start that always ends standing, against one that never does
FRAMES_APART = 4
MOST_AT_ONCE = 512  # robots that are dropped together
WORST_SPEED = 0.5  # rad/s; a robot that still rolls is no settled fall


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

    def save(self, file: Path) -> None:
        """Write the starts to an .npz file."""
        partial = file.with_suffix(f".{os.getpid()}.part.npz")  # several processes may write
        np.savez_compressed(partial, qpos=self.qpos)
        partial.replace(file)

    @staticmethod
    def load(file: Path) -> StartPool:
        """Read starts from an .npz file.

        Raises:
            ValueError: if the file holds none.
        """
        try:
            with np.load(file) as stored:
                return StartPool.of(stored["qpos"])
        except (OSError, ValueError, KeyError, TypeError, EOFError, BadZipFile) as error:
            raise ValueError(
                f"{file} holds no starts, allowed an .npz of falls: {error}"
            ) from error


def make_pool(
    robot: Robot, model: mujoco.MjModel, count: int, rng: np.random.Generator
) -> StartPool:
    """Make a pool of ``count`` settled falls and their mirror images."""
    herd = Herd(model, robot, min(count, MOST_AT_ONCE), cycles=CYCLES)
    falls = drop_falls(herd, count, rng)
    return StartPool.of(np.concatenate([falls, mirror_starts(robot, model, falls)]))


def drop_falls(herd: Herd, count: int, rng: np.random.Generator) -> Array:
    """Drop limp robots in random postures until ``count`` lie still, (count, nq)."""
    robot, model = herd.robot, herd.model
    limp = Conditions.nominal(robot, model.nbody, herd.n, torque_limit=0.0)
    everyone = np.arange(herd.n)
    herd.set_conditions(everyone, limp)
    data = mujoco.MjData(model)
    found: list[Array] = []
    while sum(map(len, found)) < count:
        starts = np.array([_sample_drop(robot, model, data, rng) for _ in everyone])
        herd.place(everyone, starts)
        target = np.zeros((herd.n, robot.n))
        for _ in range(SETTLE_STEPS):
            herd.advance(target, target)
        still = np.abs(herd.qvel).max(axis=1) < WORST_SPEED
        found.append(herd.qpos[still])
    return np.concatenate(found)[:count]


def mirror_starts(robot: Robot, model: mujoco.MjModel, qpos: Array) -> Array:
    """Exchange left and right in MuJoCo positions (P, nq)."""
    layout = robot.layout(model)
    root = layout.root_qpos
    mirrored = qpos.copy()
    mirrored[:, root + 1] *= -1.0
    mirrored[:, root + 3 : root + 7] = rotation.mirror(qpos[:, root + 3 : root + 7])
    mirrored[:, layout.qpos] = robot.mirror_joints(qpos[:, layout.qpos])
    return mirrored


def list_motion_starts(robot: Robot, model: mujoco.MjModel) -> Array:
    """List the frames of the robot's known motions as MuJoCo positions (M, nq)."""
    files = sorted((robot.folder / MOTION_FOLDER).glob("*.npz"))
    frames = [
        place(robot, model, motion.posture(frame))
        for motion in map(Motion.load, files)
        for frame in range(0, len(motion.time), FRAMES_APART)
    ]
    return np.array(frames).reshape(-1, model.nq)


def _sample_drop(
    robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, rng: np.random.Generator
) -> Array:
    """Sample a robot in the air, free of self-collision."""
    while True:
        posture = Posture(
            position=np.array([0.0, 0.0, 1.0]),
            orientation=rotation.normalise(rng.normal(size=4)),
            joint_pos=rng.uniform(robot.lower, robot.upper),
        )
        data.qpos[:] = place(robot, model, posture)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        if all(contact.dist > -SPAWN_OVERLAP for contact in data.contact):
            qpos = data.qpos.copy()
            qpos[robot.layout(model).root_qpos + 2] += DROP_HEIGHT - lowest_point(model, qpos)
            return qpos
