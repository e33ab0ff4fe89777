"""What commands are told: the options that they share, checked and loaded."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import arg

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.outputs import find_folder_faults, find_json_faults
from humanoid_getup.lying import CLASSES, Fall, classify, sample_falls
from humanoid_getup.rise import check_start
from humanoid_getup.scene import load_scene
from humanoid_getup.stage import Stage
from robots import Robot, load_posture, load_robot

BACKENDS = ("twin",)
UNCLASSED = "other"  # start class of a posture that lies on no side


@dataclass(frozen=True, kw_only=True)
class RobotOption:
    """Which robot."""

    robot: str = "op3"
    """Robot by name, or a folder that holds a robot.toml."""

    def load_robot(self) -> Robot:
        """Load the robot."""
        with refusing():
            return load_robot(self.robot)


@dataclass(frozen=True, kw_only=True)
class StageOptions(RobotOption):
    """Which robot in which scene, by which seed, and where the figures go."""

    scene: str = "flat"
    """Scene by name."""
    seed: int = 0
    """Seed of all that is left to chance, 0 or more."""
    json: Annotated[str | None, arg(metavar="FILE|-")] = None
    """Write the figures to a file; - prints them alone on standard output."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = find_json_faults(self.json)
        if self.seed < 0:
            faults.append(f"seed is {self.seed}, allowed 0 or more")
        return faults

    def load_stage(self) -> Stage:
        """Check the options, then load the robot into its scene."""
        if faults := self.find_faults():
            raise BadInputError("; ".join(faults))
        with refusing():
            scene = load_scene(self.scene)
            return Stage.build(load_robot(self.robot), scene)


@dataclass(frozen=True, kw_only=True)
class TrialOptions(StageOptions):
    """What every command that moves a robot is told."""

    backend: str = "twin"
    """The robot's body: twin."""
    torque_limit: Annotated[float | None, arg(metavar="N·m")] = None
    """Cap on every servo [N·m]; without it, what the servos can."""
    realtime: bool = False
    """Play at the speed of life."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for report.json, motion.npz, strip.png and torque.png."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        if self.backend not in BACKENDS:
            faults.append(f"unknown backend '{self.backend}': allowed {', '.join(BACKENDS)}")
        faults += find_torque_faults(self.torque_limit)
        if self.out is not None:
            faults += find_folder_faults(self.out)
        return faults


def find_torque_faults(limit: float | None) -> list[str]:
    """Tell what is wrong with a torque limit [N·m]."""
    if limit is None or (math.isfinite(limit) and limit > 0.0):
        return []
    return [f"torque limit is {limit:g} N·m, allowed a finite number above 0 N·m"]


def find_start(stage: Stage, origin: str, rng: np.random.Generator) -> Fall:
    """Sample a settled fall of a class, or load a posture file."""
    if origin in CLASSES:
        return sample_falls(stage, {origin: 1}, rng)[0]
    path = Path(origin)
    with refusing():
        if not path.exists():
            raise ValueError(
                f"unknown start '{origin}': allowed {', '.join(CLASSES)}, or a posture file"
            )
        posture = load_posture(path, stage.robot)
        check_start(stage, posture)
    return Fall(posture=posture, start_class=classify(posture.orientation) or UNCLASSED)
