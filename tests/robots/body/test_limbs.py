"""Limbs: which joints they are, where they point, and the angles that point them back."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from spoiling import spoil

from robots import Robot, load_robot
from robots.body.limb_solver import LimbSolver
from robots.body.limbs import Limbs


@pytest.fixture(scope="module")
def limbs(op3: Robot) -> Limbs:
    return Limbs(op3)


def names(limbs: Limbs, limb: str) -> list[str]:
    return [limbs.robot.joint_names[k] for k in limbs.all[limb].joints]  # type: ignore[index]


def test_arms_and_legs_of_op3_are_found_from_the_torso_on(limbs: Limbs):
    assert set(limbs.all) == {"left_arm", "right_arm", "left_leg", "right_leg"}
    leg = ["hip_yaw", "hip_roll", "hip_pitch", "knee", "ank_pitch", "ank_roll"]
    assert names(limbs, "left_leg") == [f"l_{name}" for name in leg]
    assert names(limbs, "right_arm") == ["r_sho_pitch", "r_sho_roll", "r_el"]
    found = limbs.all["left_leg"]
    bends = [limbs.robot.joint_names[k] for k in (found.start, found.middle, found.end or 0)]
    assert bends == ["l_hip_pitch", "l_knee", "l_ank_pitch"]


def test_a_robot_may_lack_arms(own_folder: Path):
    """Joints that are of the head alone are not an arm."""
    text = (own_folder / "robot.toml").read_text("utf-8").splitlines(keepends=True)
    arm = ("_sho_", '_el"')
    rows = [
        line.replace('"other"', '"head"') if line.startswith("  {") and arm[0] in line else line
        for line in text
    ]
    rows = [line.replace('"other"', '"head"') if '_el", id' in line else line for line in rows]
    (own_folder / "robot.toml").write_text("".join(rows), "utf-8")
    assert set(Limbs(load_robot(own_folder)).all) == {"left_leg", "right_leg"}


def test_legs_below_a_waist_joint_have_a_sole_each(own_folder: Path):
    """A pelvis on a waist joint carries both legs: the sole of each is on its own chain."""
    model = (own_folder / "model.xml").read_text("utf-8")
    at = model.index('      <body name="l_hip_yaw_link"')
    end = model.index("    </body>\n  </worldbody>")
    pelvis = (
        '      <body name="waist_link"><joint name="waist" axis="0 0 1" range="-30 30"/>'
        '<geom type="box" size="0.01 0.01 0.01" mass="0.1" contype="0" conaffinity="0"/>\n'
    )
    model = model[:at] + pelvis + model[at:end] + "      </body>\n" + model[end:]
    (own_folder / "model.xml").write_text(model, "utf-8")
    waist = (
        '{ name = "waist", id = 21, servo = "XM430-W350", sign = 1, zero_ticks = 2048, '
        'mirror = "waist", mirror_sign = -1, segment = "other" },\n]\n\n# Standing'
    )
    spoil(own_folder, "]\n\n# Standing", waist)
    found = Limbs(load_robot(own_folder))
    soles = [found.model.site(found.all[leg].sole).name for leg in ("left_leg", "right_leg")]
    assert soles == ["l_sole", "r_sole"]
    assert "waist" not in names(found, "left_leg")


@pytest.fixture
def own_folder(tmp_path: Path, op3: Robot) -> Path:
    for name in ("robot.toml", "model.xml"):
        (tmp_path / name).write_text((op3.folder / name).read_text("utf-8"), "utf-8")
    return tmp_path


@settings(max_examples=15)
@given(seed=st.integers(0, 1000))
def test_pointing_limbs_where_they_point_changes_nothing(seed: int, limbs: Limbs):
    """There and back again: angles near the stance give directions that give those directions."""
    robot, rng = limbs.robot, np.random.default_rng(seed)
    angles = robot.standing.joint_pos + rng.uniform(-0.3, 0.3, robot.n)
    angles = np.clip(angles, robot.lower, robot.upper)
    wanted = limbs.measure(angles)
    solved = LimbSolver(limbs).solve(wanted, robot.standing.joint_pos)
    assert np.all((robot.lower <= solved) & (solved <= robot.upper))
    found = limbs.measure(solved)
    for name, pose in wanted.items():
        for part in ("upper", "lower"):
            cosine = getattr(pose, part) @ getattr(found[name], part)
            assert np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) < 2.0, (name, part)


def test_the_mass_is_shifted_as_far_forward_as_asked_for(limbs: Limbs):
    stance = limbs.robot.standing.joint_pos
    before = limbs.measure_balance(stance)
    assert before is not None
    shifted = LimbSolver(limbs).solve_balance(before + 0.05, stance)
    after = limbs.measure_balance(shifted)
    assert after == pytest.approx(before + 0.05, abs=0.01)
