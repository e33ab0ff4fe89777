"""Poses a robot: samples falls, mirrors it, turns its joints, puts it down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from humanoid_getup.commands.errors import BadInputError, refusing
from humanoid_getup.commands.inputs import load_world
from humanoid_getup.commands.options import SceneOptions
from humanoid_getup.experiments.falls import (
    CLASSES,
    Fall,
    sample_fall_set,
)
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.placement import check_standing_place
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.body.limbs import Limbs
from robots.body.squats import Squat, list_squats
from robots.body.statics import Statics
from robots.kinematics import mirror_positions, place, read_posture

FallsToSample = tuple[SceneOptions, str, int]
"""Robot, scene and seed; class of the falls; their number."""


def sample_starts(
    request: FallsToSample, report: Report | None = None, cancel: Cancel | None = None
) -> list[Fall]:
    """Sample settled falls of a class; of one seed, the first ones are the same for any count."""
    options, side, count = request
    if side not in CLASSES or count < 1:
        found = f"{count} of class '{side}'"
        raise BadInputError(f"falls: {found}, expected 1 or more of {', '.join(CLASSES)}")
    world, monitor = load_world(options), ProgressMonitor(report, cancel)
    advance = monitor.count(f"falls ({side})", count)
    with refusing():
        sampled = sample_fall_set(world, {side: count}, options.seed, report=advance)
        for fall in sampled.falls:
            check_standing_place(world, fall.posture.position)
    return list(sampled.falls)


def turn_joint(
    robot: Robot, posture: Posture, joint: int, angle: float, *, mirrored: bool
) -> Posture:
    """Turn a joint to an angle [rad] within its range; mirrored, its partner turns as well."""
    angles = posture.joint_pos.copy()
    angles[joint] = np.clip(angle, robot.lower[joint], robot.upper[joint])
    turned = replace(posture, joint_pos=angles)
    return mirror_turned(robot, turned, (joint,)) if mirrored else turned


def mirror_turned(robot: Robot, posture: Posture, joints: Sequence[int]) -> Posture:
    """Give the partners of joints their angles, mirrored; joints in the middle stay."""
    paired = np.array([k for k in joints if robot.mirror_index[k] != k], dtype=int)
    partners, angles = robot.mirror_index[paired], posture.joint_pos.copy()
    angles[partners] = robot.mirror_joints(angles)[partners]
    return replace(posture, joint_pos=np.clip(angles, robot.lower, robot.upper))


def mirror_pose(world: World, posture: Posture) -> Posture:
    """Exchange left and right of a posture."""
    qpos = place(world.robot, world.model, posture)
    return read_posture(world.robot, world.model, mirror_positions(world.robot, world.model, qpos))


def put_down(world: World, posture: Posture) -> Posture:
    """Move a posture up or down until it touches what is under it."""
    qpos = Clearance(world).rest_where(place(world.robot, world.model, posture))
    root = world.robot.layout(world.model).root_position
    return replace(posture, position=qpos[root].copy())


def stand(world: World) -> Posture:
    """Return the stance of the robot on the ground of a world."""
    standing = world.robot.standing
    return standing if world.scene.is_flat else put_down(world, standing)


class Squats:
    """Balanced squats of a robot on flat soles, from high to deep."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def find(self, neck_share: float) -> tuple[Squat, Posture]:
        """Find the squat whose neck is nearest to a share of its height in the stance."""
        with refusing():
            squats = self._squats
        if not squats:
            raise BadInputError(f"robot '{self._robot.name}' has no balanced squat on flat soles")
        nearest = min(squats, key=lambda squat: abs(squat.neck_share - neck_share))
        return nearest, self._statics.make_posture(nearest.joint_pos)

    @cached_property
    def _squats(self) -> list[Squat]:
        return list_squats(Limbs(self._robot), self._statics)

    @cached_property
    def _statics(self) -> Statics:
        return Statics(self._robot)
