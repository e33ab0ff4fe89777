"""Where a robot lies in its scene, and what its sensors add to that."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import Twin
from humanoid_getup.experiments.disturbances import USUAL
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions.build import lay_down
from humanoid_getup.playback.estimation import SINKING, estimate_posture
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import lying
from humanoid_getup.simulation.physics_engine import find_coarse_step
from humanoid_getup.simulation.placement import Placement, measure_heading
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot, quaternion

yaw = st.floats(-3.1, 3.1)
side = st.sampled_from(["supine", "prone", "left", "right"])


@given(side=side, heading=yaw, drift=yaw)
def test_a_placement_undoes_the_drift_of_the_imu(side: str, heading: float, drift: float):
    true = quaternion.multiply(quaternion.from_yaw(heading), lying(side))
    assert measure_heading(true) == pytest.approx(heading, abs=1e-9)
    measured = quaternion.multiply(quaternion.from_yaw(drift), true)
    found = Placement(x=0.0, y=0.0, heading=heading).turn(measured)
    assert float(quaternion.angle_between(found, true)) < 1e-6


def test_a_robot_that_knows_its_place_knows_its_posture_in_the_scene(op3: Robot):
    world = World(op3, load_scene("low-bed-b", op3))
    fall = sample_falls(world, {"prone": 1}, np.random.default_rng(2))[0].posture
    with Twin(world, fall) as twin:
        state = twin.read()
    drifted = quaternion.multiply(quaternion.from_yaw(1.0), state.orientation)
    estimate = estimate_posture(world, replace(state, orientation=drifted), Placement.of(fall))
    np.testing.assert_allclose(estimate.position, fall.position, atol=0.006 + SINKING)
    assert math.degrees(quaternion.angle_between(estimate.orientation, fall.orientation)) < 2.0
    np.testing.assert_allclose(estimate.joint_pos, fall.joint_pos, atol=0.002)


@pytest.mark.parametrize(("name", "steps"), [("toddlerbot", 1), ("human", 2)])
def test_no_rollout_diverges_in_coarse_steps(name: str, steps: int):
    """In twice as long steps two of eight of the human do, which lies disturbed on its back."""
    world = World(load_robot(name))
    robot, step = world.robot, find_coarse_step(world)
    assert step == pytest.approx(robot.control_period / steps)
    lying = lay_down(world, "supine", robot.standing.joint_pos)
    scenarios = USUAL.sample(world, lying, 8, np.random.default_rng(0))
    held = np.tile(robot.standing.joint_pos, (8, round(1.5 / robot.control_period), 1))
    record = play(world.vary(timestep=step), scenarios, held)
    assert not record.diverged.any()
