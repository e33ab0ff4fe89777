"""Surfaces: slippery as they say, and as deep."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.scenes.ground import Slope
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.scenes.surface import Surface
from robots import Robot
from robots.kinematics import place


def settle(surface: Surface, seconds: float = 4.0) -> float:
    """Return the height of the bottom of a box after it has come to rest."""
    spec = mujoco.MjSpec()
    Slope().pave(spec, surface)
    body = spec.worldbody.add_body(pos=[0.0, 0.0, 0.1])
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1], density=700.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    while data.time < seconds:
        mujoco.mj_step(model, data)
    assert np.abs(data.qvel).max() < 1e-3
    return float(data.qpos[2]) - 0.1


@pytest.mark.parametrize("friction", [0.4, 0.8])
@pytest.mark.parametrize("sink", [0.005, 0.03])
def test_what_lies_on_a_soft_surface_sinks_in_as_deep_as_it_says(sink, friction):
    assert settle(Surface(sink=sink, friction=friction)) == pytest.approx(-sink, rel=0.02)


def test_the_ground_decides_the_friction_under_every_sole(op3: Robot):
    model = Scene(name="ice", surface=Surface(friction=0.1)).compile(op3)
    data = mujoco.MjData(model)
    data.qpos[:] = place(op3, model, op3.standing)
    data.qpos[op3.layout(model).root_qpos + 2] -= 1e-4
    mujoco.mj_forward(model, data)
    assert data.ncon == 8  # four corners of each sole
    np.testing.assert_allclose(data.contact.friction[:, 0], 0.1)


def test_a_ball_comes_to_rest_where_rolling_friction_is_high():
    speeds = []
    for rolling in (0.0, 0.02):
        spec = mujoco.MjSpec()
        Slope().pave(spec, Surface(rolling_friction=rolling))
        body = spec.worldbody.add_body(pos=[0.0, 0.0, 0.1])
        body.add_freejoint()
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1, 0.0, 0.0])
        model = spec.compile()
        data = mujoco.MjData(model)
        data.qvel[0], data.qvel[4] = 0.5, 5.0
        while data.time < 2.0:
            mujoco.mj_step(model, data)
        speeds.append(float(data.qvel[0]))
    assert speeds[0] > 0.3
    assert abs(speeds[1]) < 0.01


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"friction": 0.0}, "friction is 0, expected above 0"),
        ({"friction": float("nan")}, "friction is nan, expected above 0"),
        ({"rolling_friction": -0.1}, r"rolling friction is -0\.1 m, expected 0 or more"),
        ({"sink": -0.01}, r"sink is -0\.01 m, expected 0 or more"),
    ],
)
def test_a_surface_that_cannot_be_is_refused(values, message):
    with pytest.raises(ValueError, match=message):
        Surface(**values)
