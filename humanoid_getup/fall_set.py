"""A set of settled falls in a file: drawing a thousand takes minutes, reading them none."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from humanoid_getup.lying import CLASSES, Fall
from robots import Posture, Robot


@dataclass(frozen=True, kw_only=True)
class FallSet:
    """Falls of one robot, and where they come from."""

    robot: str
    """Name of the robot."""
    scene: str
    """Name of the scene in which it fell."""
    seed: int
    """From which they were drawn."""
    falls: tuple[Fall, ...]

    def choose(self, each: int) -> FallSet:
        """Choose the first falls of every class.

        Args:
            each: How many of each.

        Raises:
            ValueError: naming the classes that have fewer.
        """
        kinds = {kind: [f for f in self.falls if f.start_class == kind] for kind in CLASSES}
        few = [f"{len(falls)} {kind}" for kind, falls in kinds.items() if len(falls) < each]
        if few:
            raise ValueError(f"the set of falls has {', '.join(few)}, needed are {each} of each")
        return replace(self, falls=tuple(fall for falls in kinds.values() for fall in falls[:each]))

    def save(self, file: Path) -> None:
        """Write an .npz file: robot, scene, seed, position, orientation, joint_pos, start_class."""
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(".part.npz")
        np.savez_compressed(
            partial,
            robot=self.robot,
            scene=self.scene,
            seed=self.seed,
            position=np.array([fall.posture.position for fall in self.falls]),
            orientation=np.array([fall.posture.orientation for fall in self.falls]),
            joint_pos=np.array([fall.posture.joint_pos for fall in self.falls]),
            start_class=np.array([fall.start_class for fall in self.falls]),
        )
        partial.replace(file)

    @staticmethod
    def load(file: Path, robot: Robot) -> FallSet:
        """Read a robot's falls.

        Raises:
            OSError: if the file cannot be read.
            ValueError: if it holds no falls, or another robot's.
        """
        try:
            with np.load(file) as stored:
                values = dict(stored)
            rows = zip(
                values["position"],
                values["orientation"],
                values["joint_pos"],
                values["start_class"],
                strict=True,
            )
            name, width = str(values["robot"]), values["joint_pos"].shape[1]
            if name != robot.name or width != robot.n:
                raise ValueError(
                    f"robot '{name}' with {width} joints, allowed '{robot.name}' with {robot.n}"
                )
            falls = tuple(
                Fall(posture=Posture(position=p, orientation=q, joint_pos=v), start_class=str(kind))
                for p, q, v, kind in rows
            )
            scene, seed = str(values["scene"]), int(values["seed"])
        except (KeyError, IndexError, ValueError, EOFError) as error:
            raise ValueError(f"{file} is no set of falls of this robot: {error}") from error
        return FallSet(robot=name, scene=scene, seed=seed, falls=falls)
