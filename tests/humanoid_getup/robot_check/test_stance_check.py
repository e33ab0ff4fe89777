"""The check of a stance: soles and overlaps, on robots small enough to print."""

from pathlib import Path

import pytest
from tiny_robots import LEGS, limb, make_robot

from humanoid_getup.robot_check.stance_check import check_soles, check_stance
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.body.limbs import Limbs


def soles_of(folder: Path, old: str = "", new: str = "") -> list[str]:
    assert old in LEGS
    robot = make_robot(folder, LEGS.replace(old, new, 1) if old else LEGS)
    return [f"{found.level}: {found}" for found in check_soles(robot)]


SOLE = '<site name="l_sole" pos="0 0 -0.1"/>'


@pytest.mark.parametrize(
    ("new", "message"),
    [
        (SOLE.replace("-0.1", "-0.09"), "warning: site 'l_sole': is 10 mm above the lowest point"),
        (SOLE.replace("-0.1", "-0.12"), "warning: site 'l_sole': is 20 mm below the lowest point"),
        (SOLE.replace("/>", ' euler="10 0 0"/>'), "fault: site 'l_sole': is tilted by 10° against"),
    ],
)
def test_a_sole_that_is_off_its_face_is_named(tmp_path: Path, new: str, message: str):
    (found,) = soles_of(tmp_path, SOLE, new)
    assert found.startswith(message)


def stance_of(robot: Robot) -> list[str]:
    return [str(found) for found in check_stance(World(robot), Limbs(robot))]


def test_a_balanced_stance_has_a_margin(tmp_path: Path):
    """By hand: the mass is over the middle of soles that reach 3 cm forward and back."""
    found = stance_of(make_robot(tmp_path, LEGS))
    assert found == ["stance: the center of mass is 30 mm inside the soles' edge"]


def test_a_load_in_front_of_the_soles_is_a_fault(tmp_path: Path):
    load = '<geom size="0.01" pos="0.2 0 0.1" mass="1"/>'
    found = stance_of(make_robot(tmp_path, LEGS + load))
    # By hand: 1 kg at 0.2 m beside 0.9 kg at 0: 105 mm, 75 beyond the edge.
    assert found[-1].startswith("stance: the center of mass is 75 mm outside the soles, expected")


def test_an_arm_in_the_torso_is_named(tmp_path: Path):
    elbow = limb("arm", "0 0 -0.01")
    shoulder = (
        '<body name="shoulder" pos="0 0.2 0.1"><joint name="swing" axis="0 1 0" range="-9 9"/>'
    )
    shoulder += (
        f'<geom size="0.01" mass="0.01"/>{elbow.replace("0 0 -0.01", "0 -0.16 0.05")}</body>'
    )
    found = stance_of(make_robot(tmp_path, LEGS + shoulder))
    assert "arm_link reaches" in found[0] or "into arm_link" in found[0]


def test_a_tail_on_the_ground_is_a_fault(tmp_path: Path):
    tail = '<geom name="tail" size="0.01" pos="-0.1 0 -0.2" mass="0.01"/>'
    assert stance_of(make_robot(tmp_path, LEGS + tail))[0].startswith("stance: torso touches")
