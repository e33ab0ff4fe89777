"""The length of a leg, from where it begins."""

from pathlib import Path

import pytest
from tiny_robots import LEGS, make_robot

from robots import RobotError
from robots.body.lengths import leg_length


def test_a_leg_is_as_long_as_from_its_hip_to_its_sole(tmp_path: Path):
    assert leg_length(make_robot(tmp_path, LEGS)) == pytest.approx(0.2)


def test_a_sole_on_the_torso_is_on_no_leg(tmp_path: Path):
    legs = LEGS.replace('<site name="l_sole" pos="0 0 -0.1"/>', "")
    with pytest.raises(RobotError, match="no leg that ends in site 'l_sole'"):
        leg_length(make_robot(tmp_path, legs + '<site name="l_sole" pos="0 0 -0.2"/>'))
