"""Where a limb ends: as far beyond its mass as its joint is before it."""

import mujoco
import pytest

from robots.body.ends import locate_end

MODEL = """<mujoco><worldbody><body pos="0 0 1"><freejoint/><geom size="0.1"/>
  <body><joint name="elbow" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.01" mass="1"/>HAND</body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("hand", "end"),
    [
        ("", -0.2),  # a rod ends at its end
        # A heavy hand moves the mass to -0.15 m, and the end to -0.3 m.
        ('<body><joint/><geom size="0.01" pos="0 0 -0.2" mass="1"/></body>', -0.3),
    ],
)
def test_a_limb_ends_at_twice_the_way_to_its_mass(hand: str, end: float):
    model = mujoco.MjModel.from_xml_string(MODEL.replace("HAND", hand))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert locate_end(data, model.joint("elbow").id) == pytest.approx([0.0, 0.0, 1.0 + end])
