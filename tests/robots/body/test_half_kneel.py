"""Half-kneels: what touches the ground, and that the robot rests there."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.motion_database import load_key
from humanoid_getup.posture_chains.goal import Goal, GoalExperiment
from humanoid_getup.posture_chains.key_goal import settle
from robots import FULL_TORQUE, Posture
from robots.body import half_kneel
from robots.kinematics import place


@pytest.fixture(scope="module")
def kneeling(op3) -> Posture:
    return load_key(half_kneel.HALF_KNEEL, op3).posture


def test_one_sole_and_the_other_knee_and_toes_touch_the_ground(op3, world, kneeling):
    data = mujoco.MjData(world.model)
    data.qpos[:] = place(op3, world.model, kneeling)
    mujoco.mj_kinematics(world.model, data)
    soles = [world.model.site(name).id for name in op3.sole_sites]
    assert data.site_xpos[soles[0], 2] == pytest.approx(0.0, abs=1e-6)
    assert data.site_xmat[soles[0], 8] == pytest.approx(1.0)
    assert data.site_xmat[soles[1], 8] < 0.5
    data.qpos[op3.layout(world.model).root_qpos + 2] -= 0.006  # to press what touches
    mujoco.mj_forward(world.model, data)
    of_world = world.model.geom_bodyid[data.contact.geom] == 0
    touching = {
        world.model.body(int(world.model.geom_bodyid[pair[~ours]][0])).name
        for pair, ours in zip(data.contact.geom, of_world, strict=True)
        if ours.any()
    }
    assert {"l_ank_roll_link", "r_ank_roll_link"} <= touching
    assert touching & {"r_knee_link", "r_hip_pitch_link"}
    assert not any("el" in name or "sho" in name for name in touching)


def test_the_robot_rests_there_on_its_knee_and_does_not_stand(op3, world, kneeling):
    goal = settle(world, kneeling, FULL_TORQUE)
    assert goal is not None
    assert goal.touches
    assert 0.6 < goal.measure_neck(goal.qpos) < 0.9
    starts = np.array([goal.qpos, place(op3, world.model, op3.standing)])
    held = np.array([goal.target, op3.standing.joint_pos])[:, None].repeat(150, axis=1)
    record = Experiment(world, threads=1).play(Scenarios.nominal(world, starts), held)
    assert goal.is_reached(record, 50).tolist() == [True, False]
    assert Goal(world).is_reached(record, 50).tolist() == [False, True]
    assert goal.is_passed(record).tolist() == [True, False]
    stood = GoalExperiment(goal, world, threads=1).compare(
        Scenarios.nominal(world, starts[1]), held
    )
    assert stood.record.upright[1].all()
    assert not stood.stood.any()  # one kneels, and one stands but did not kneel before
