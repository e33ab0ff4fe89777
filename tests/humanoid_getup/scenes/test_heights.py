"""Heights of obstacles and rough ground, against MuJoCo's own rays, and a backdrop."""

import math

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.scenes.ground import HeightField, Slope, Surface
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import PICTURE, Scene, add_backdrop
from robots import Robot, quaternion
from robots.ground import GROUND
from robots.kinematics import place

HIGH = 5.0
DOWN = np.array([0.0, 0.0, -1.0])
small = st.floats(-0.5, 0.5)
angle = st.floats(-3.0, 3.0)


def cast(model: mujoco.MjModel, x: float, y: float) -> float:
    """Measure the height of the first thing under a place with a ray; -inf if there is none."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    distance = mujoco.mj_ray(
        model, data, np.array([x, y, HIGH]), DOWN, None, 1, -1, np.zeros(1, dtype=np.int32)
    )
    return HIGH - distance if distance >= 0.0 else -math.inf


def cast_on(obstacle: Obstacle, x: float, y: float) -> float:
    spec = mujoco.MjSpec()
    obstacle.add(spec)
    return cast(spec.compile(), x, y)


@given(kind=st.sampled_from(["box", "capsule", "sphere"]), x=small, y=small, a=angle, b=angle)
def test_the_top_of_an_obstacle_is_where_a_ray_from_above_meets_it(kind, x, y, a, b):
    tilt = quaternion.from_axis_angle(np.array([0.6, 0.8, 0.0]), b)
    size = {"box": [0.2, 0.3, 0.1], "capsule": [0.15, 0.3], "sphere": [0.3]}[kind]
    obstacle = Obstacle(
        name="thing",
        kind=kind,
        half_size=np.array(size),
        position=np.array([0.1, -0.05, 0.4]),
        orientation=quaternion.multiply(quaternion.from_yaw(a), tilt),
    )
    top = float(obstacle.top(np.array(x), np.array(y)))
    assert top == pytest.approx(cast_on(obstacle, x, y), abs=1e-9)
    if math.isfinite(top):
        assert obstacle.contains(np.array([x, y, top - 1e-9]))
        assert not obstacle.contains(np.array([x, y, top + 1e-6]))


@given(x=st.floats(-0.74, 0.74), y=st.floats(-0.49, 0.49), seed=st.integers(0, 20))
def test_rough_ground_is_as_high_as_a_ray_says(x, y, seed):
    heights = np.random.default_rng(seed).uniform(-0.1, 0.1, (5, 7))
    ground = HeightField(heights=heights, cell=0.25)
    spec = mujoco.MjSpec()
    ground.pave(spec, Surface())
    assert ground.height(np.array(x), np.array(y)) == pytest.approx(
        cast(spec.compile(), x, y), abs=1e-6
    )


TABLE = Obstacle(
    name="table",
    kind="box",
    half_size=np.array([0.5, 0.5, 0.02]),
    position=np.array([0.0, 0.0, 0.3]),
)


def test_feet_stand_on_a_table_or_under_it():
    scene = Scene(name="table", obstacles=(TABLE,))
    feet = np.array([[0.0, 0.0, 0.315], [0.0, 0.0, 0.0], [0.6, 0.0, 0.32]])
    np.testing.assert_allclose(scene.support(feet), [0.32, 0.0, 0.0])


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


@pytest.mark.parametrize(("sink", "friction"), [(0.005, 0.8), (0.03, 0.4)])
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


def build(*, with_backdrop: bool) -> mujoco.MjModel:
    """A box that slides and tumbles on a plane."""
    spec = mujoco.MjSpec()
    ground = spec.worldbody.add_geom(
        name=GROUND, type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], rgba=[1, 0, 0, 0.5]
    )
    box = spec.worldbody.add_body(pos=[0.0, 0.0, 0.3])
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.05, 0.02], euler=[0.3, 0.2, 0.0])
    if with_backdrop:
        add_backdrop(spec, ground)
    return spec.compile()


def tumble(model: mujoco.MjModel) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    mujoco.mj_step(model, data, 300)
    return data.qpos.copy()


def test_physics_is_the_same_with_it_and_the_sun_shines_on_its_pattern():
    model = build(with_backdrop=True)
    np.testing.assert_array_equal(tumble(model), tumble(build(with_backdrop=False)))
    assert model.geom(GROUND).matid[0] == model.material(GROUND).id
    np.testing.assert_array_equal(model.geom(GROUND).rgba, 1.0)
    assert model.light("sun").dir[2] < 0.0
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == PICTURE
