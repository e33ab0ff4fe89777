"""A robot that a person holds: torso and limp joints stay, joints with torque move."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.twin.simulation import Simulation
from robots import Robot
from robots.drive import Drive


def hang(robot: Robot) -> Simulation:
    """Hold a robot in the air with all joints at 0."""
    simulation = Simulation(robot)
    lifted = robot.standing.position + np.array([0.0, 0.0, 0.3])
    simulation.hold(replace(robot.standing, position=lifted, joint_pos=np.zeros(robot.n)))
    return simulation


def drive_one(robot: Robot, joint: int) -> Drive:
    """Give one joint torque."""
    released = Drive.released(robot.n)
    torque = np.zeros(robot.n)
    torque[joint] = robot.max_torque[joint]
    return replace(released, torque=torque)


def test_a_held_robot_without_torque_stays_where_it_is(op3: Robot):
    simulation = hang(op3)
    before = simulation.data.qpos.copy()
    simulation.step(2000)
    np.testing.assert_allclose(simulation.data.qpos, before, atol=1e-5)
    up = simulation.imu.accelerometer / np.linalg.norm(simulation.imu.accelerometer)
    assert np.linalg.norm(simulation.imu.accelerometer) == pytest.approx(9.81, rel=1e-3)
    assert up[2] > 0.99


def test_a_joint_with_torque_moves_alone_and_is_held_again_without(op3: Robot):
    simulation, joint = hang(op3), op3.joint_names.index("l_knee")
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
    lifted = replace(
        op3.standing,
        position=op3.standing.position + np.array([0.0, 0.0, 0.3]),
        joint_pos=np.zeros(op3.n),
    )
    held.hold(lifted)  # once more: what is kept is the inertia of a robot that is free
    held.place(lifted)
    free.place(lifted)
    for simulation in (held, free):
        simulation.step(300)
    np.testing.assert_array_equal(held.data.qpos, free.data.qpos)
    assert held.data.qpos[2] < lifted.position[2] - 0.1


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
