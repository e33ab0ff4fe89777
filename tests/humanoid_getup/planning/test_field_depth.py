"""Depth under a field of heights: of the corners of boxes, and of what is swept by a ball."""

import mujoco
import numpy as np
import pytest

from humanoid_getup.planning.collision import FieldDepth
from humanoid_getup.scenes.ground import HeightField

MODEL = """
<mujoco><worldbody><body name="b" pos="0.2 0.1 0.5"><freejoint/>
  <geom type="box" size="0.1 0.2 0.05"/>
  <geom type="sphere" size="0.04" pos="0 0 -0.2"/>
  <geom type="capsule" size="0.03 0.1" pos="0 0 0.3"/>
</body></worldbody></mujoco>
"""


@pytest.fixture(scope="module")
def ground() -> HeightField:
    """It rises by 0.1 m a meter along x."""
    x = np.arange(-2.0, 2.01, 0.5)
    return HeightField(heights=np.tile(0.1 * x, (len(x), 1)), cell=0.5)


def test_the_lowest_points_of_geoms_are_measured(ground: HeightField):
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    depth = FieldDepth(model, np.arange(3), ground)
    measured = depth.measure(data)
    deepest = [float(measured[depth.geom == geom].max()) for geom in range(3)]
    # The ground is at 0.1 x: under the box's far edge, the ball's and the capsule's center.
    assert deepest == pytest.approx([0.03 - 0.45, 0.02 - 0.26, 0.02 - 0.67])
