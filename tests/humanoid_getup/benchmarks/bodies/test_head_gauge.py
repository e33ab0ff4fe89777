"""A head is as high in the robot as in the model that it was made from."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.benchmarks.bodies.head_gauge import HeadGauge, is_standing
from humanoid_getup.benchmarks.bodies.published_body import FEET, HEAD
from robots import load_robot


@pytest.fixture(scope="module")
def model(repository) -> mujoco.MjModel:
    return load_robot(repository.robots / "small").spec().compile()


def test_the_height_is_that_of_the_source_model_in_any_posture(repository, model):
    source = repository.model
    gauge = HeadGauge(source, model, head=HEAD, feet=FEET, standing=0.5)
    rng, data = np.random.default_rng(0), mujoco.MjData(source)
    for _ in range(20):
        data.qpos[:3] = rng.uniform(-1.0, 1.0, 3)
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[7:] = rng.uniform(-1.0, 1.0, source.nq - 7)
        mujoco.mj_kinematics(source, data)
        qpos = np.zeros(model.nq)
        qpos[:7] = data.qpos[:7]
        for joint in range(1, source.njnt):
            own = model.joint(source.joint(joint).name)
            qpos[own.qposadr[0]] = data.qpos[source.jnt_qposadr[joint]]
        feet = np.mean([data.site(name).xpos[2] for name in FEET])
        assert gauge.measure(qpos) == pytest.approx((data.site(HEAD).xpos[2] - feet) / 0.5)


def test_a_head_within_a_fifth_of_its_standing_height_is_up():
    assert [is_standing(share) for share in (0.79, 0.81, 1.0, 1.19, 1.21)] == [
        *(False, True, True, True, False)
    ]


def test_a_model_without_the_site_or_with_another_torso_frame_is_refused(repository, model):
    with pytest.raises(ValueError, match="has no site 'eye', expected one"):
        HeadGauge(repository.model, model, head="eye", feet=FEET, standing=0.5)
    moved = load_robot(repository.robots / "small").spec()
    head = moved.body("head")
    head.pos[2] += 0.01
    with pytest.raises(ValueError, match="site 'camera' is 10 mm from its place"):
        HeadGauge(repository.model, moved.compile(), head=HEAD, feet=FEET, standing=0.5)
