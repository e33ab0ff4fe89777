"""Random postures on the ground, and random obstacles around them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import Scene, lying
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import place, read_posture
from robots.quaternion import Array

TRIES = 20  # obstacles drawn for each that is wanted; most others would touch the robot
REACH = 0.8  # of the standing neck height: how far from the root obstacles are, and how high
THICK = (0.03, 0.10)  # of it: radius of a capsule, half edges of a box
LONG = (0.05, 0.25)  # of it: half length of a capsule


def sample_lying(world: World, start_class: str, rng: np.random.Generator) -> Posture:
    """Draw a posture with any joint angles that lies on flat ground and does not collide."""
    robot, clearance = world.robot, Clearance(world)
    heading = quaternion.from_yaw(rng.uniform(-math.pi, math.pi))
    orientation = quaternion.multiply(heading, lying(start_class))
    while True:
        joint_pos = rng.uniform(robot.lower, robot.upper)
        posture = Posture(position=np.zeros(3), orientation=orientation, joint_pos=joint_pos)
        qpos = clearance.rest(place(robot, world.model, posture))
        if clearance.measure_self_overlap(qpos) == 0.0:
            return read_posture(robot, world.model, qpos)


def sample_obstacles(
    robot: Robot, free: Sequence[Posture], count: int, rng: np.random.Generator
) -> tuple[Obstacle, ...]:
    """Draw capsules and boxes that hang and stand around a robot and touch none of its postures.

    Args:
        robot: Robot.
        free: Postures that stay free; the obstacles are around the first.
        count: Number of obstacles.
        rng: Random numbers.

    Raises:
        ValueError: if there is no space for as many.
    """
    drawn = [
        _draw_obstacle(robot, free[0].position, f"obstacle {k}", rng) for k in range(TRIES * count)
    ]
    touched = _find_touched(robot, drawn, free)
    obstacles = [obstacle for obstacle in drawn if obstacle.name not in touched][:count]
    if len(obstacles) < count:
        raise ValueError(f"found space for {len(obstacles)} obstacles, expected {count}")
    return tuple(obstacles)


def _draw_obstacle(robot: Robot, center: Array, name: str, rng: np.random.Generator) -> Obstacle:
    height = robot.standing_neck_height
    low, high = np.array([-1.0, -1.0, 0.0]), np.ones(3)
    thick = height * rng.uniform(*THICK, size=3)
    is_box = rng.random() < 0.5
    return Obstacle(
        name=name,
        kind="box" if is_box else "capsule",
        half_size=thick if is_box else np.array([thick[0], height * rng.uniform(*LONG)]),
        position=np.array([*center[:2], 0.0]) + height * REACH * rng.uniform(low, high),
        orientation=quaternion.normalize(rng.normal(size=4)),
    )


def _find_touched(robot: Robot, drawn: Sequence[Obstacle], free: Sequence[Posture]) -> set[str]:
    """Find the names of the obstacles that one of the postures touches."""
    model = Scene(name="clutter", obstacles=tuple(drawn)).compile(robot)
    data = mujoco.MjData(model)
    touched: set[str] = set()
    for posture in free:
        data.qpos[:] = place(robot, model, posture)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        touched |= {model.geom(geom).name for geom in data.contact.geom.ravel()}
    return touched
