"""What commands are told: the options that they share, checked and loaded."""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import arg

from humanoid_getup.cli.backends import (
    BACKENDS,
    RELEASES,
    TWIN,
    BackendChoice,
    find_port_faults,
    open_body,
)
from humanoid_getup.cli.errors import BadInputError, refusing
from humanoid_getup.cli.output import find_folder_faults, find_json_faults
from humanoid_getup.playback.estimation import check_start
from humanoid_getup.policy.onnx_policy import LONGEST, OnnxPolicy
from humanoid_getup.simulation.falls import CLASSES, Fall, classify, sample_falls
from humanoid_getup.simulation.scene import load_scene
from humanoid_getup.simulation.world import World
from robots import Robot, load_posture, load_robot

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
class WorldOptions(RobotOption):
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

    def load_stage(self) -> World:
        """Check the options, then load the robot into its scene."""
        if faults := self.find_faults():
            raise BadInputError("; ".join(faults))
        with refusing():
            scene = load_scene(self.scene)
            return World.build(load_robot(self.robot), scene)


@dataclass(frozen=True, kw_only=True)
class RunOptions(WorldOptions):
    """What every command that moves a robot is told."""

    backend: str = TWIN
    """The robot's body: twin, virtual (servos on a virtual bus) or dynamixel."""
    port: Annotated[tuple[str, ...], arg(metavar="PATH|NAME=PATH")] = ()
    """Serial port; of a robot with several, one NAME=PATH each. A virtual robot without it
    comes into being with the command."""
    release: str = "limp"
    """What a bus is left with at the end: limp, or hold for a robot that shall stay up."""
    torque_limit: Annotated[float | None, arg(metavar="N·m")] = None
    """Cap on every servo [N·m]; without it, what the servos can."""
    realtime: bool = False
    """Play at the speed of life."""
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    """Folder for report.json, motion.npz, flight.mcap, strip.png and torque.png."""

    def find_faults(self) -> list[str]:
        """Tell all that is wrong with the options' values."""
        faults = super().find_faults()
        if self.backend not in BACKENDS:
            faults.append(f"unknown backend '{self.backend}': allowed {', '.join(BACKENDS)}")
        faults += find_port_faults(self.backend, self.port)
        if self.release not in RELEASES:
            faults.append(f"release is '{self.release}', allowed {', '.join(RELEASES)}")
        faults += find_torque_faults(self.torque_limit)
        if self.out is not None:
            faults += find_folder_faults(self.out)
        return faults

    @property
    def is_real(self) -> bool:
        """Tell whether the robot may be a real one."""
        return bool(self.port)

    def open_body(self, world: World) -> AbstractContextManager[BackendChoice]:
        """Make the robot that is to be moved."""
        return open_body(
            world,
            self.backend,
            ports=self.port,
            realtime=self.realtime,
            release=self.release,
            seed=self.seed,
        )


def find_start_faults(origin: str | None, *, is_real: bool, needs_one: bool) -> list[str]:
    """Tell what is wrong with the choice of a start: only a simulated robot can be placed."""
    if is_real and origin is not None:
        return [f"from is '{origin}', allowed only for a simulated robot: a real one lies as it is"]
    if needs_one and not is_real and origin is None:
        return [f"from is missing, allowed {', '.join(CLASSES)}, or a posture file"]
    return []


def find_torque_faults(limit: float | None) -> list[str]:
    """Tell what is wrong with a torque limit [N·m]."""
    if limit is None or (math.isfinite(limit) and limit > 0.0):
        return []
    return [f"torque limit is {limit:g} N·m, allowed a finite number above 0 N·m"]


def find_start(world: World, origin: str, rng: np.random.Generator) -> Fall:
    """Sample a settled fall of a class, or load a posture file."""
    if origin in CLASSES:
        return sample_falls(world, {origin: 1}, rng)[0]
    path = Path(origin)
    with refusing():
        if not path.exists():
            raise ValueError(
                f"unknown start '{origin}': allowed {', '.join(CLASSES)}, or a posture file"
            )
        posture = load_posture(path, world.robot)
        check_start(world, posture)
    return Fall(posture=posture, start_class=classify(posture.orientation) or UNCLASSED)


SUFFIX = ".onnx"


def load_policy(
    robot: Robot, name: str, torque_limit: float | None, longest: float = LONGEST
) -> OnnxPolicy:
    """Load a policy of a robot by name, or an .onnx file.

    Raises:
        BadInputError: if there is none, or it does not fit.
    """
    with refusing():
        file = find_policy(robot, name)
        period = robot.control_period
        return OnnxPolicy.load(file, robot, period, torque_limit, longest=longest)


def find_policy(robot: Robot, name: str) -> Path:
    """Find the file of a policy.

    Raises:
        ValueError: naming the policies that the robot has.
    """
    if name.endswith(SUFFIX):
        return Path(name)
    folder = robot.folder / "policies"
    known = sorted(file.stem for file in folder.glob(f"*{SUFFIX}"))
    if name not in known:
        told = ", ".join([*known, f"an {SUFFIX} file"])
        raise ValueError(f"unknown policy '{name}': allowed {told}")
    return folder / f"{name}{SUFFIX}"
