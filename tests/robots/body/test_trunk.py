"""The trunk: joints between torso and neck, and angles that turn the chest."""

from pathlib import Path

import numpy as np
import pytest
from tiny_robots import LEGS, limb, make_robot

from robots import Robot, load_robot
from robots.body.trunk import Trunk

NECK = '<site name="neck" pos="0 0 0.1"/>'


@pytest.fixture
def bending(tmp_path: Path) -> Robot:
    """A torso with a waist that yaws and a chest that pitches, with the neck on it."""
    chest = limb("chest", "0 0 0.02", inside=NECK)
    bodies = LEGS + limb("waist", "0 0 0.1", axis="0 0 1", inside=chest)
    folder = tmp_path / "bending"
    robot = make_robot(folder, bodies.replace('"neck"', '"top"'))
    text = (folder / "robot.toml").read_text("utf-8")
    (folder / "robot.toml").write_text(text.replace('neck_site = "neck"', 'neck_site = "top"'))
    assert robot.n == 6
    return load_robot(folder)


def test_the_chest_is_turned_where_it_is_asked_to(bending: Robot):
    trunk = Trunk(bending)
    wanted = bending.standing.joint_pos.copy()
    wanted[trunk.joints] = [0.4, -0.3]
    found = trunk.solve(trunk.measure(wanted), bending.standing.joint_pos)
    assert found[trunk.joints] == pytest.approx([0.4, -0.3], abs=0.01)
    others = [k for k in range(bending.n) if k not in trunk.joints]
    assert found[others] == pytest.approx(wanted[others])


def test_a_chest_whose_own_frame_is_turned_is_upright_at_rest(tmp_path: Path):
    chest = limb("chest", '0 0 0.1" euler="20 0 0', axis="1 0 0", inside=NECK)
    folder = tmp_path / "turned"
    make_robot(folder, LEGS + chest.replace('"neck"', '"top"'))
    text = (folder / "robot.toml").read_text("utf-8")
    (folder / "robot.toml").write_text(text.replace('neck_site = "neck"', 'neck_site = "top"'))
    trunk = Trunk(load_robot(folder))
    found = trunk.solve(np.eye(3), np.full(5, 0.2))
    assert found[trunk.joints] == pytest.approx([0.0], abs=1e-3)
