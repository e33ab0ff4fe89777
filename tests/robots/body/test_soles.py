"""Soles: the flat face that looks down, where the ground touches it, and the mass above it."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tiny_robots import LEGS, make_robot

from robots import Robot, quaternion
from robots.body.soles import find_sole, measure_support_margin, measure_tilt

BOX = '<geom type="box" size="0.05 0.03 0.01" pos="0.02 0 -0.04"/>'
STUDS = "".join(
    f'<geom type="box" size="0.004 0.004 0.001" pos="{x} {y} -0.051"/>'
    for x in (-0.02, 0.06)
    for y in (-0.02, 0.02)
)


def build(shapes: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body name="foot" pos="0 0 0.3"><freejoint/>{shapes}</body>'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def test_the_sole_of_a_box_is_its_lower_face_and_as_low_as_its_lowest_point():
    """Studs reach 2 mm out of the face: the ground touches them, not the face above."""
    sole = find_sole(*build(BOX), body=1, least_area=1e-4)
    assert sole is not None
    assert sole.position == pytest.approx([0.02, 0.0, -0.05])
    assert sole.axes == pytest.approx(np.eye(3))
    assert sole.area == pytest.approx(0.1 * 0.06)
    with_studs = find_sole(*build(BOX + STUDS), body=1, least_area=1e-4)
    assert with_studs is not None
    assert with_studs.position[2] == pytest.approx(-0.052)


@pytest.mark.parametrize(
    "shapes", ['<geom size="0.03"/>', '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>']
)
def test_a_ball_and_a_body_without_shapes_have_no_sole(shapes: str):
    assert find_sole(*build(shapes), body=1, least_area=1e-3) is None


@given(angle=st.floats(0.1, 0.5), way=st.sampled_from([-1.0, 1.0]))
def test_a_face_is_tilted_as_far_as_it_was_turned(angle: float, way: float):
    angle *= way
    corners = np.array([[x, y, z] for x in (-5, 5) for y in (-3, 3) for z in (-1, 1)]) * 0.01
    turn = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
    assert measure_tilt(quaternion.rotate(turn, corners)) == pytest.approx(abs(angle), abs=0.01)


def test_a_high_foot_stands_on_what_looks_down_and_not_on_its_larger_side():
    corners = np.array([[x, y, z] for x in (-4, 4) for y in (-2, 2) for z in (-9, 9)]) * 0.01
    assert measure_tilt(corners) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("roll", [-20, 20])
def test_the_sole_of_a_foot_that_rolled_still_points_ahead(roll: int):
    turned = BOX.replace("/>", f' euler="{roll} 0 0"/>')
    sole = find_sole(*build(turned), body=1, least_area=1e-4)
    assert sole is not None
    assert sole.axes[:, 0] == pytest.approx([1.0, 0.0, 0.0])
    assert abs(sole.axes[1, 2]) == pytest.approx(np.sin(np.radians(20.0)), abs=1e-3)
    assert np.linalg.det(sole.axes) == pytest.approx(1.0)


def test_what_is_above_the_ground_does_not_carry(tiny: Robot, tmp_path: Path):
    """A guard of 26 cm about the foot, 2 cm above the ground: the edge stays 3 cm ahead."""
    guard = '<geom type="box" size="0.13 0.02 0.005" pos="0 0 -0.075" mass="1e-6"/>'
    sole = '<site name="l_sole" pos="0 0 -0.1"/>'
    assert sole in LEGS
    robot = make_robot(tmp_path, LEGS.replace(sole, sole + guard))
    margin = measure_support_margin(robot, robot.spec().compile())
    assert margin == pytest.approx(0.03, abs=1e-4)
    # By hand: tiny's mass is over the middle of soles that reach 30 mm forward and back.
    assert measure_support_margin(tiny, tiny.spec().compile()) == pytest.approx(0.03, abs=1e-6)
