"""Soles turn with the ground under them and come to its height; nothing else moves much."""

import mujoco
import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.simulation.ground_fit import GroundFit
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import place_postures
from robots.quaternion import Array

HEADINGS = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)


def stand(robot: Robot, headings: Array) -> tuple[Array, Array, Array]:
    """Let a robot stand upright in each heading, where the ground is at height 0."""
    count, stance = len(headings), robot.standing
    turned = [quaternion.multiply(quaternion.from_yaw(h), stance.orientation) for h in headings]
    return (
        np.tile(stance.position, (count, 1)),
        np.array(turned),
        np.tile(stance.joint_pos, (count, 1)),
    )


def soles(world: World, position: Array, orientation: Array, joint_pos: Array):
    """Compute the normals and places of the soles, (T, 2, 3) each."""
    data, normals, places = mujoco.MjData(world.model), [], []
    for qpos in place_postures(world.robot, world.model, position, orientation, joint_pos):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(world.model, data)
        sites = [world.model.site(name).id for name in world.robot.sole_sites]
        normals.append(data.site_xmat[sites][:, [2, 5, 8]])
        places.append(data.site_xpos[sites].copy())
    return np.array(normals), np.array(places)


@pytest.mark.parametrize("degrees", [5.0, 15.0])
def test_the_soles_of_an_upright_robot_turn_with_the_slope(op3: Robot, degrees: float):
    world = World(op3, f"slope:{degrees:g}")
    # One posture for each call: a motion is fitted at every few frames only.
    for heading in nonempty(HEADINGS):
        position, orientation, joint_pos = stand(op3, np.array([heading]))
        shift = GroundFit(world).shift(position, orientation, joint_pos)
        before, at = soles(world, position, orientation, joint_pos)
        after, to = soles(world, position, orientation, joint_pos + shift)
        slope = np.radians(degrees)
        wanted = np.array([-np.sin(slope), 0.0, np.cos(slope)])
        off = np.degrees(np.arccos(np.clip(after @ wanted, -1.0, 1.0)))
        already = np.degrees(np.arccos(np.clip(before @ np.array([0, 0, 1]), -1.0, 1.0)))
        assert np.all(off < already + 0.12 * degrees)
        assert np.linalg.norm((to - at)[..., :2], axis=-1).max() < 0.01


@pytest.mark.parametrize("scene", ["slope:15", "rough:medium"])
def test_both_soles_are_as_high_over_their_ground_as_on_level_ground(op3: Robot, scene: str):
    world, apart, level, off = World(op3, scene), [], [], []
    for heading in HEADINGS:
        position, orientation, joint_pos = stand(op3, np.array([heading]))
        shift = GroundFit(world).shift(position, orientation, joint_pos)
        for places, heights in (
            (soles(world, position, orientation, joint_pos)[1], level),
            (soles(world, position, orientation, joint_pos + shift)[1], apart),
        ):
            ground = world.scene.ground.height(places[0, :, 0], places[0, :, 1])
            over = places[0, :, 2] - ground
            heights.append(abs(over[0] - over[1]))
        (qpos,) = place_postures(op3, world.model, position, orientation, joint_pos)
        stands = GroundFit(world).measure_level(qpos)
        assert ground.min() - 0.0005 < stands < ground.mean() + 0.0005
        off.append(over.mean() + stands)
    # On a slope of 15° the soles, 0.11 m apart, are on ground that differs by up to 29 mm.
    assert max(level) > 0.008
    assert max(apart) < 0.15 * max(level)
    assert np.abs(off).max() < 0.0005  # m


def test_level_ground_and_soles_in_the_air_need_nothing(op3: Robot):
    position, orientation, joint_pos = stand(op3, HEADINGS)
    assert not GroundFit(World(op3)).shift(position, orientation, joint_pos).any()
    lying = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.pi / 2)
    lying = np.tile(lying, (len(HEADINGS), 1))
    assert not GroundFit(World(op3, "slope:10")).shift(position, lying, joint_pos).any()
