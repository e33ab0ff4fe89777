"""Start states of a body by others: as their file has them, and as falls of the robot."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from humanoid_getup.benchmarks.bodies.start_pickle import read_start_pickle
from humanoid_getup.experiments.starts.falls import UNCLASSED, Fall, classify, find_rest
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.quaternion import Array
from robots.storage.arrays import load_arrays, save_arrays, to_numbers, to_text

KEYS = ("body", "source_sha256", "joints", "position", "orientation", "joint_pos")
"""Keys of a file of converted starts."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyStarts:
    """N start states of a body with n joints."""

    body: str
    source_sha256: str
    """Checksum of the file that they are from."""
    joints: tuple[str, ...]
    position: Array
    """Of the torso [m], (N, 3)."""
    orientation: Array
    """Of the torso, w x y z, (N, 4)."""
    joint_pos: Array
    """Joint angles [rad], (N, n), in the order of `joints`."""

    def __len__(self) -> int:
        return len(self.position)

    @classmethod
    def convert(cls, body: str, pickled: Path, model: mujoco.MjModel) -> BodyStarts:
        """Read the pickled positions of a model.

        Raises:
            ValueError: if the file cannot be read safely, or is of another model.
        """
        rows = [position for position, _ in read_start_pickle(pickled)]
        for number, row in enumerate(rows):
            if len(row) != model.nq:
                raise ValueError(
                    f"{pickled}: start {number} has {len(row)} positions, expected {model.nq} as "
                    "the model"
                )
        qpos = np.array(rows)
        hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        (root,) = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
        at = int(model.jnt_qposadr[root])
        orientation = qpos[:, at + 3 : at + 7]
        if not np.linalg.norm(orientation, axis=1).min() > 0.0:
            raise ValueError(f"{pickled}: a start has no orientation, expected a quaternion")
        return cls(
            body=body,
            source_sha256=hash_file(pickled),
            joints=tuple(model.joint(j).name for j in hinges),
            position=qpos[:, at : at + 3],
            orientation=quaternion.normalize(orientation),
            joint_pos=qpos[:, model.jnt_qposadr[hinges]],
        )

    def save(self, path: Path) -> None:
        """Write them as an .npz file with the keys of `KEYS`."""
        save_arrays(path, {key: np.array(getattr(self, key)) for key in KEYS})

    @classmethod
    def load(cls, path: Path) -> BodyStarts:
        """Read converted starts.

        Raises:
            OSError: if the file cannot be read.
            ValueError: if it is damaged.
        """
        arrays = load_arrays(path, KEYS)
        joints, count = arrays["joints"], len(arrays["position"])
        return cls(
            body=to_text(arrays["body"], "body"),
            source_sha256=to_text(arrays["source_sha256"], "source_sha256"),
            joints=tuple(map(str, joints)),
            position=to_numbers(arrays["position"], "position", (count, 3)),
            orientation=to_numbers(arrays["orientation"], "orientation", (count, 4)),
            joint_pos=to_numbers(arrays["joint_pos"], "joint_pos", (count, len(joints))),
        )

    def sample(self, world: World, count: int, seed: int) -> list[Fall]:
        """Draw starts without repetition; each is settled with held joints, which its file had.

        Angles beyond the robot's ranges are clipped to them. With fewer starts than ``count``, all
        are taken.
        """
        order = np.random.default_rng(seed).permutation(len(self))[:count]
        columns = find_columns(self.joints, world.robot)
        return [self._settle(world, int(row), columns) for row in order]

    def _settle(self, world: World, row: int, columns: list[int]) -> Fall:
        robot = world.robot
        posture = Posture(
            position=self.position[row],
            orientation=self.orientation[row],
            joint_pos=np.clip(self.joint_pos[row, columns], robot.lower, robot.upper),
        )
        rest = find_rest(world, posture)
        return Fall(posture=rest, start_class=classify(rest.orientation) or UNCLASSED)


def find_columns(joints: Sequence[str], robot: Robot) -> list[int]:
    """Find the columns of a robot's joints.

    Raises:
        ValueError: if there is none for a joint.
    """
    if missing := [name for name in robot.joint_names if name not in joints]:
        others = f", and {len(missing) - 1} others" if missing[1:] else ""
        raise ValueError(
            f"the start states of robot '{robot.name}' have no joint {missing[0]}{others}, "
            "expected all of the robot's: import it from the model of the starts"
        )
    return [joints.index(name) for name in robot.joint_names]


def hash_file(path: Path) -> str:
    """Return the checksum of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()
