"""Initial states of training episodes: robots that stand, or have nearly risen."""

from __future__ import annotations

import mujoco
import numpy as np

from humanoid_getup.filtering.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.body.parts import find_arm_joints
from robots.kinematics import place
from robots.quaternion import Array
from sim2real.environment.starts.start_pool import StartPool
from sim2real.environment.starts.terrain import Terrain

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
    return place_on_terrain(world, terrain, np.concatenate(states), rng)


def place_on_terrain(
    world: World, terrain: Terrain, states: Array, rng: np.random.Generator
) -> StartPool:
    """Place robots that stand on level ground, (S, nq), anywhere on a terrain, the world's scene.

    The torso stays as upright as it is; legs fit the ground.
    """
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
