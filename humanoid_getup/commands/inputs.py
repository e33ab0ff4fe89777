"""Loads the robot, world, start, motion and ports that options name."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.options import (
    BodyOption,
    LoadOption,
    PlannerOptions,
    RobotOption,
    SceneOptions,
    TorqueOptions,
)
from humanoid_getup.experiments.falls import CLASSES, UNCLASSED, Fall, classify, sample_falls
from humanoid_getup.motions import motion_database
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import KeyPosture, load_key
from humanoid_getup.planning.collision import check_keys
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.estimation import check_start
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.placement import check_standing_place
from humanoid_getup.simulation.world import World
from robots import Body, Posture, Robot, TorqueLimit, list_robots, load_posture
from robots import load_robot as load_robot_by_name
from robots.bench import ServoBench
from robots.imu import IMU_PORT
from robots.individual import parse_load
from robots.storage.validation import name_unknown_joints

ZERO, STANDING = "zero", "standing"
FALL = "fall"
"""Key of a posture file of `getup fall`: the side on which the robot was to lie."""


def load_robot(options: RobotOption, *, takes_bench: bool = False) -> Robot:
    """Load the robot of a command, which may need no body (``takes_bench``)."""
    with refusing():
        body = options.body if isinstance(options, BodyOption) else ""
        load = parse_load(options.load if isinstance(options, LoadOption) else "")
        robot = load_robot_by_name(options.robot, Body.parse(body), load=load)
    if isinstance(robot, ServoBench) and not takes_bench:
        raise BadInputError(
            f"robot '{robot.name}' is servos on a bench, expected a robot with a model: its body "
            "is unknown"
        )
    return robot


def load_robot_of(options: RobotOption, robot: str, owner: str) -> Robot:
    """Load the robot of a command, by default the one for which a file was made."""
    if options.robot:
        return load_robot(options)
    if robot not in list_robots():
        raise BadInputError(f"{owner} is of robot '{robot}': give its folder with --robot")
    return load_robot(replace(options, robot=robot))


def load_world(options: SceneOptions) -> World:
    """Load the robot of a command into its scene."""
    with refusing():
        robot = load_robot(options)
        return World(robot, load_scene(options.scene, robot, options.seed))


def make_torque_limit(options: TorqueOptions, robot: Robot) -> TorqueLimit:
    """Make the torque limit of a command on its robot."""
    with refusing():
        return TorqueLimit(options.torque_limit, options.limit_by).on(robot)


def make_settings(options: PlannerOptions, robot: Robot, **others: Any) -> PlannerSettings:
    """Make the settings of a planner from the options of a command, and others."""
    limit = make_torque_limit(options, robot)
    names = {field.name for field in fields(PlannerSettings)} - {"torque_limit"}
    given = {name: getattr(options, name) for name in names if hasattr(options, name)}
    return PlannerSettings(torque_limit=limit, **given, **others)


def find_start(
    world: World,
    origin: str,
    rng: np.random.Generator,
    tell: Callable[[str], None],
) -> Fall:
    """Sample a settled fall of a class, or load a posture file.

    Joints that a file leaves out take the angles of the stance, and are named to ``tell``.
    """
    with refusing():
        if origin in CLASSES:
            fall = sample_falls(world, {origin: 1}, rng)[0]
            check_standing_place(world, fall.posture.position)
            return fall
        path = Path(origin)
        if not path.exists():
            if path.suffix or len(path.parts) > 1:
                raise ValueError(f"posture file {path} is missing")
            raise ValueError(
                f"unknown start '{origin}', expected {', '.join(CLASSES)} or a posture file"
            )
        posture = load_posture(path, world.robot, fill=tell)
        check_start(world, posture)
        check_standing_place(world, posture.position)
        return _find_sampled(world, path, posture, rng) or Fall(
            posture=posture, start_class=classify(posture.orientation) or UNCLASSED
        )


def _find_sampled(
    world: World, path: Path, posture: Posture, rng: np.random.Generator
) -> Fall | None:
    """Sample the fall that `getup fall` wrote to a file, if it is of this world and seed."""
    if (side := json.loads(path.read_text("utf-8")).get(FALL)) not in CLASSES:
        return None
    sampler = copy.deepcopy(rng)
    fall = sample_falls(world, {side: 1}, sampler)[0]
    same = (
        np.allclose(getattr(fall.posture, name), getattr(posture, name), rtol=0.0, atol=1e-12)
        for name in ("position", "orientation", "joint_pos")
    )
    if not all(same):
        return None
    rng.bit_generator.state = sampler.bit_generator.state
    return fall


def find_held_posture(robot: Robot, at: str) -> Posture:
    """Find the posture in which a person holds a robot: all angles 0, its stance, or a file's.

    At zero, where its orientation is not known, the robot is upright.
    """
    if at == ZERO:
        return replace(robot.standing, joint_pos=np.zeros(robot.n))
    if at == STANDING:
        return robot.standing
    if not Path(at).exists():
        raise BadInputError(f"unknown posture '{at}': expected zero, standing, or a file")
    with refusing():
        return load_posture(Path(at), robot)


def load_keys(world: World, names: Sequence[str]) -> list[KeyPosture]:
    """Load postures from files or motions, and check that they are possible for the robot."""
    with refusing():
        keys = [load_key(name, world.robot) for name in names]
        check_keys(world.robot, keys)
    return keys


def find_keyframes(robot: Robot, names: Sequence[str], path: Path | None = None) -> list[Keyframes]:
    """Load keyframes by name from a file, by default the robot's; without names, all of them."""
    if path is None and not (robot.folder / KEYFRAMES).exists():
        raise BadInputError(
            f"robot '{robot.name}' has no keyframes: {robot.folder / KEYFRAMES} is missing; "
            f"getup motions discover --robot {robot.folder} finds some"
        )
    with refusing():
        stored = {
            each.name: each for each in load_keyframes(path or robot.folder / KEYFRAMES, robot)
        }
        if unknown := [name for name in names if name not in stored]:
            listed = ", ".join(f"'{name}'" for name in unknown)
            raise ValueError(f"unknown motion {listed}, expected {', '.join(stored)}")
    return [stored[name] for name in dict.fromkeys(names or stored)]


def find_motion(robot: Robot, name: str) -> Motion:
    """Find a motion by name in the robot's database, or load an .npz file."""
    with refusing():
        return motion_database.find_motion(robot, name)


def choose_joints(robot: Robot, names: Sequence[str]) -> list[int]:
    """Find joints by name, all without any; return their numbers, in the robot's order."""
    unknown = [name for name in names if name not in robot.joint_names]
    if problems := name_unknown_joints(unknown, robot.joint_names):
        raise BadInputError(*problems)
    return [i for i, name in enumerate(robot.joint_names) if not names or name in names]


def name_ports(robot: Robot, ports: Sequence[str]) -> dict[str, str]:
    """Map the names of a robot's ports to their paths.

    That of an IMU with a serial port or an I2C bus of its own may be given too, as ``imu``.
    """
    wanted = list(robot.bus.ports) if robot.bus else []
    own = [IMU_PORT] if robot.imu is not None and robot.imu.has_own_line else []
    if len(wanted) == 1 and len(ports) == 1 and "=" not in ports[0]:
        return {wanted[0]: ports[0]}
    named = dict(port.split("=", 1) for port in ports if "=" in port)
    if len(named) != len(ports) or sorted(set(named) - set(own)) != sorted(wanted):
        expected = " ".join(f"--port {name}=PATH" for name in [*wanted, *own])
        expected = expected or "none, it has no servo bus"
        raise BadInputError(
            f"--port is {', '.join(ports)}, expected for robot '{robot.name}': {expected}"
        )
    return named
