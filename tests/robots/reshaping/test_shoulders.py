"""Shoulders: arms apart as asked, mass at their height alone, and beams in the gaps."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from tiny_robots import LEGS, build_skeleton, limb, make_robot

from robots.reshaping.shoulders import stretch_shoulders

# The arms' links are 6 x 4 x 10 cm; the torso's box is 4 x 10 x 10 cm, from 5 to 15 cm.
ARMS = limb("l_arm", "0 0.1 0.15") + limb("r_arm", "0 -0.1 0.15")


def widen(folder: Path, factor: float, arms: str = ARMS) -> mujoco.MjModel:
    skeleton = build_skeleton(make_robot(folder, LEGS + arms))
    stretch_shoulders(skeleton, factor)
    return skeleton.spec.compile()


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.5])
def test_arms_are_apart_as_asked_and_nothing_else_of_them_changes(tmp_path: Path, factor: float):
    before, after = widen(tmp_path, 1.0), widen(tmp_path, factor)
    for name, y in (("l_arm_link", 0.1), ("r_arm_link", -0.1)):
        assert after.body(name).pos == pytest.approx([0.0, y * factor, 0.15])
        assert after.body(name).mass == pytest.approx(before.body(name).mass)
    assert after.body("l_hip_link").pos == pytest.approx(before.body("l_hip_link").pos)


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_the_trunk_stays_its_own_mirror_image(tmp_path: Path, factor: float):
    torso = widen(tmp_path, factor).body("torso")
    assert torso.ipos[1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_the_trunk_becomes_heavier_at_the_height_of_the_arms(tmp_path: Path, factor: float):
    """By hand: the arms hang at the height of the whole box of 0.5 kg."""
    assert widen(tmp_path, factor).body("torso").mass == pytest.approx(0.5 * factor)


def test_the_mass_below_the_arms_stays(tmp_path: Path):
    """By hand: links from 10 to 20 cm are as high as the upper half of the torso's box."""
    high = ARMS.replace("0.15", "0.2")
    torso = widen(tmp_path, 3.0, high).body("torso")
    assert torso.mass == pytest.approx(0.25 + 3.0 * 0.25, rel=0.02)  # by quadrature
    assert torso.ipos[2] > 0.1


def test_a_beam_reaches_from_where_an_arm_was_to_where_it_is(tmp_path: Path):
    model = widen(tmp_path, 1.5)
    beam = model.geom("l_arm_link_shoulder")
    assert model.body(int(beam.bodyid[0])).name == "torso"
    assert beam.pos == pytest.approx([0.0, 0.125, 0.1])
    assert beam.size == pytest.approx([0.03, 0.025, 0.05])
    other = model.geom("r_arm_link_shoulder")
    assert other.pos == pytest.approx(beam.pos * [1.0, -1.0, 1.0])
    assert other.size == pytest.approx(beam.size)


def test_narrower_shoulders_have_no_beams_and_narrower_shapes(tmp_path: Path):
    model = widen(tmp_path, 0.5)
    assert not [k for k in range(model.ngeom) if "shoulder" in model.geom(k).name]
    (box,) = np.flatnonzero(model.geom_bodyid == model.body("torso").id)
    assert model.geom_size[box] == pytest.approx([0.02, 0.025, 0.05])
