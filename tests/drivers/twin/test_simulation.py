"""A simulated robot: what is true of it in postures where the answer is known, and its grip."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from drivers import Command, Twin
from drivers.twin.simulation import Simulation
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.torque_limit import Drive


def place(twin, z, orientation=quaternion.IDENTITY, joint_pos=None):
    n = twin.robot.n
    twin.place(
        Posture(
            position=np.array([0.0, 0.0, z]),
            orientation=orientation,
            joint_pos=np.zeros(n) if joint_pos is None else joint_pos,
        )
    )
    return twin.truth


def names(truth):
    return [truth.model.body(body).name for body in truth.touching_bodies]


def test_a_standing_op3_stands(op3):
    twin = Twin(op3)
    command = Command.position(op3, op3.standing.joint_pos)
    with twin:
        for _ in range(125):
            twin.read()
            twin.write(command)
            assert set(names(twin.truth)) == {"l_ank_roll_link", "r_ank_roll_link"}
    assert math.degrees(quaternion.tilt(twin.truth.posture.orientation)) < 5.0
    # The facts' own simulation of this stance settles with the hips at 0.256 m.
    assert twin.truth.posture.position[2] == pytest.approx(0.256, abs=2e-3)
    assert twin.truth.self_penetration == 0.0
    assert twin.truth.ground_penetration < 1e-3


def test_self_contact_is_measured_and_is_no_contact_with_the_world(op3):
    folded = op3.standing.joint_pos.copy()
    for joint, angle in (("l_sho_roll", 1.6), ("l_el", -2.4), ("l_sho_pitch", 0.0)):
        folded[op3.joint_names.index(joint)] = angle
    folded[op3.joint_names.index("l_hip_roll")] = 0.6  # the left leg swings into the right
    truth = place(Twin(op3), 1.0, joint_pos=folded)
    assert truth.self_penetration > 0.0
    assert truth.ground_penetration == 0.0
    assert names(truth) == []


def test_penetration_is_measured_and_an_obstacle_is_part_of_the_world(tiny):
    truth = place(Twin(tiny), 0.1 - 0.004)
    assert truth.ground_penetration == pytest.approx(0.004)
    # Four corners of each foot.
    assert sorted(names(truth)) == ["l_leg"] * 4 + ["r_leg"] * 4
    spec = tiny.spec()
    step = spec.worldbody.add_body(name="step", pos=[0.0, 0.07, 0.05])
    step.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.02, 0.05])
    twin = Twin(World(tiny, model=spec.compile()))
    # The left sole on the step at 0.1 m: only a foot touches.
    assert set(names(place(twin, 0.199))) == {"l_leg"}
    # Sunk so far that the torso, from y = -0.05 to 0.05, is over the step's edge, too.
    twin.model.geom_size[twin.model.body("step").geomadr[0]][1] = 0.04
    assert "torso" in names(place(twin, 0.12))


# A robot that a person holds: torso and limp joints stay, joints with torque move --------------


def lift(robot: Robot) -> Posture:
    lifted = robot.standing.position + np.array([0.0, 0.0, 0.3])
    return replace(robot.standing, position=lifted, joint_pos=np.zeros(robot.n))


def hang(robot: Robot) -> Simulation:
    simulation = Simulation(robot)
    simulation.hold(lift(robot))
    return simulation


def drive_one(robot: Robot, joint: int) -> Drive:
    released = Drive.released(robot.n)
    torque = np.zeros(robot.n)
    torque[joint] = robot.max_torque[joint]
    return replace(released, torque=torque)


def test_a_held_robot_stays_and_a_joint_with_torque_moves_alone_until_it_is_without(op3: Robot):
    simulation, joint = hang(op3), op3.joint_names.index("l_knee")
    before = simulation.data.qpos.copy()
    simulation.step(1000)
    np.testing.assert_allclose(simulation.data.qpos, before, atol=1e-5)
    up = simulation.imu.accelerometer / np.linalg.norm(simulation.imu.accelerometer)
    assert np.linalg.norm(simulation.imu.accelerometer) == pytest.approx(9.81, rel=1e-3)
    assert up[2] > 0.99
    target = np.zeros(op3.n)
    target[joint] = 0.5
    simulation.drive(target, drive_one(op3, joint))
    simulation.step(500)
    assert simulation.joint_pos[joint] == pytest.approx(0.5, abs=0.05)
    assert np.abs(np.delete(simulation.joint_pos, joint)).max() < 1e-4
    simulation.release()
    held = simulation.joint_pos[joint]
    simulation.step(500)
    assert simulation.joint_pos[joint] == pytest.approx(held, abs=1e-4)


def test_a_robot_that_is_let_go_falls_as_one_that_was_never_held(op3: Robot):
    held, free = hang(op3), Simulation(op3)
    held.hold(lift(op3))  # once more: what is kept is the inertia of a robot that is free
    for simulation in (held, free):
        simulation.place(lift(op3))
        simulation.step(300)
    np.testing.assert_array_equal(held.data.qpos, free.data.qpos)
    assert held.data.qpos[2] < lift(op3).position[2] - 0.1


def test_only_a_limp_joint_of_a_held_robot_is_turned_and_within_its_range(op3: Robot):
    simulation, joint = hang(op3), op3.joint_names.index("l_knee")
    simulation.turn(joint, 0.2)
    assert simulation.joint_pos[joint] == pytest.approx(0.2)
    with pytest.raises(ValueError, match=r"l_knee would be at \+.*°, expected"):
        simulation.turn(joint, 5.0)
    simulation.drive(np.zeros(op3.n), drive_one(op3, joint))
    with pytest.raises(ValueError, match="it has torque"):
        simulation.turn(joint, 0.1)
    simulation.let_go()
    with pytest.raises(ValueError, match="the robot is not held"):
        simulation.turn(joint, 0.1)
