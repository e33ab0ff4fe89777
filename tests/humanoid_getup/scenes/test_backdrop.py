"""A backdrop is to be looked at: physics does not notice it."""

import mujoco
import numpy as np

from humanoid_getup.scenes.scene import PICTURE, add_backdrop
from robots.ground import GROUND


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


def fall(model: mujoco.MjModel) -> np.ndarray:
    data = mujoco.MjData(model)
    data.qvel[0] = 1.0
    mujoco.mj_step(model, data, 300)
    return data.qpos.copy()


def test_physics_is_the_same_with_it_and_the_sun_shines_on_its_pattern():
    model = build(with_backdrop=True)
    np.testing.assert_array_equal(fall(model), fall(build(with_backdrop=False)))
    assert model.geom(GROUND).matid[0] == model.material(GROUND).id
    np.testing.assert_array_equal(model.geom(GROUND).rgba, 1.0)
    assert model.light("sun").dir[2] < 0.0
    assert (model.vis.global_.offwidth, model.vis.global_.offheight) == PICTURE
