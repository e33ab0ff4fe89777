"""Where a limb ends: in the middle of what is farthest from its joint, wherever its mass is."""

import mujoco
import numpy as np
import pytest

from robots.body.ends import LimbEnds

MODEL = """<mujoco><worldbody><body pos="0 0 1"><freejoint/><geom size="0.1"/>
  <body><joint name="elbow" axis="0 1 0"/>{forearm}</body>
</body></worldbody></mujoco>"""
ROD = '<geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="1"/>'


def end_of(forearm: str, angle: float = 0.0) -> np.ndarray:
    model = mujoco.MjModel.from_xml_string(MODEL.format(forearm=forearm))
    data = mujoco.MjData(model)
    data.qpos[7] = angle
    mujoco.mj_forward(model, data)
    return LimbEnds(model).locate(data, model.joint("elbow").id)


@pytest.mark.parametrize(
    ("forearm", "reach"),
    [
        (ROD, 0.21),
        ('<geom type="box" size="0.02 0.03 0.1" pos="0 0 -0.1"/>', 0.2),
        # As OP2's: a servo beside the elbow is heavy, and a hand light.
        (f'{ROD}<geom size="0.02" pos="0.02 0 0" mass="9"/>', 0.21),
        (f'{ROD}<body><geom size="0.02" pos="0 0 -0.2" mass="1e-6"/></body>', 0.22),
        (f'{ROD}<body><joint/><geom size="0.02" pos="0 0 -0.3"/></body>', 0.32),
        ('<geom size="0.1"/>', 0.0),  # around the joint: it has no end
        # No shape at all: it ends at its mass.
        ('<inertial pos="0 0 -0.1" mass="1" diaginertia="1 1 1"/>', 0.1),
    ],
    ids=["rod", "box", "heavy elbow", "welded hand", "hand on a joint", "ball", "mass alone"],
)
def test_a_limb_ends_in_the_middle_of_its_far_end(forearm: str, reach: float):
    assert end_of(forearm) == pytest.approx([0.0, 0.0, 1.0 - reach], abs=1e-4)
