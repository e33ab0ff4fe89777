"""What actuators of a model can do, and hinges that follow others, with their signs."""

from pathlib import Path

import pytest
from small_humanoid import small_urdf

from robots.model_import.reading import read_model
from robots.model_import.ties import Tie

MODEL = """<mujoco><worldbody><body><freejoint/><geom size="0.1"/>
  <body><joint name="hip"/><geom size="0.1"/></body></body></worldbody>
  <actuator>ACTUATOR</actuator></mujoco>"""


@pytest.mark.parametrize(
    ("actuator", "effort"),
    [
        ('<motor joint="hip" ctrlrange="-2 3"/>', 3.0),
        ('<motor joint="hip" gear="5" ctrlrange="-2 2"/>', 10.0),
        ('<motor joint="hip" gear="-5" ctrlrange="-2 2"/>', 10.0),
        ('<motor joint="hip" gear="5" forcerange="-0.5 0.5"/>', 2.5),
        ('<position joint="hip" kp="9" forcerange="-4 4"/>', 4.0),
        ('<position joint="hip" kp="9" gear="3" forcerange="-4 4"/>', 12.0),
        ('<general joint="hip" gear="2" gainprm="3" ctrlrange="-1 1" ctrllimited="true"/>', 6.0),
        ('<position joint="hip" kp="9" ctrlrange="-1 1"/>', None),
    ],
)
def test_an_actuators_torque_is_that_behind_its_gear(tmp_path: Path, actuator: str, effort):
    (tmp_path / "model.xml").write_text(MODEL.replace("ACTUATOR", actuator))
    assert read_model(tmp_path / "model.xml").actuators["hip"].effort == effort


@pytest.mark.parametrize("multiplier", [1.0, -1.0, -0.5])
def test_a_mimic_keeps_its_sign(tmp_path: Path, multiplier: float):
    old = '<child link="right_forearm"/>'
    mimic = f'{old}<mimic joint="left_forearm_joint" multiplier="{multiplier}"/>'
    text = small_urdf()
    assert old in text
    (tmp_path / "model.urdf").write_text(text.replace(old, mimic))
    (tie,) = read_model(tmp_path / "model.urdf").ties
    assert tie == Tie(("right_forearm_joint", "left_forearm_joint"), (1.0, -multiplier))


def test_a_follower_turns_by_its_ratio_the_same_way():
    tie, leader = Tie.follow("follower", "leader", -2.0), 0.3
    assert sum(s * a for s, a in zip(tie.shares, (-2.0 * leader, leader), strict=True)) == 0.0
