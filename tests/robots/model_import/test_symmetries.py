"""What a model means does not depend on where it is, how its frames are turned, and on names."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from small_humanoid import LEFT, small_humanoid

from robots import quaternion
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model
from robots.quaternion import Array

FEW = settings(max_examples=5)
ANGLES = st.floats(-3.1, 3.1)


def imported(tmp_path: Path, **how) -> ImportedRobot:
    (tmp_path / "model.xml").write_text(small_humanoid(**how))
    return import_model(tmp_path / "model.xml", ImportOptions(name="small"))


def describe_pairs(robot: ImportedRobot) -> set[tuple[str, str, int]]:
    names = robot.joints
    return {
        (name, names[k], sign)
        for name, k, sign in zip(names, robot.mirror, robot.mirror_sign, strict=True)
    }


def measure_sites(robot: ImportedRobot) -> Array:
    """Return where neck and soles are in the torso's frame, in the stance [m], (9,)."""
    model = robot.spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7] = [0, 0, 0, 1, 0, 0, 0]
    data.qpos[7:] = robot.stance.joint_pos
    mujoco.mj_kinematics(model, data)
    return np.concatenate([data.site(name).xpos for name in ("neck", "l_sole", "r_sole")])


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> ImportedRobot:
    return imported(tmp_path_factory.mktemp("plain"))


def test_pairs_are_those_of_the_model_and_its_stance_is_symmetric_flat_and_balanced(
    plain: ImportedRobot,
):
    # Hinges about x and z turn the other way on the other side, those about y do not.
    expected = {("head_joint", "head_joint", -1)}
    for part in LEFT:
        left, right = f"left_{part.name}_joint", f"right_{part.name}_joint"
        sign = 1 if part.axis[1] else -1
        expected |= {(left, right, sign), (right, left, sign)}
    assert describe_pairs(plain) == expected
    assert plain.stance.is_solved
    stance, mirror = plain.stance.joint_pos, np.array(plain.mirror)
    np.testing.assert_allclose(stance[mirror], np.array(plain.mirror_sign) * stance, atol=1e-9)
    neck, left, right = measure_sites(plain).reshape(3, 3)
    np.testing.assert_allclose(left, right * [1, -1, 1], atol=1e-4)
    assert left[2] == pytest.approx(-0.94 * 0.3, abs=0.004)  # the leg is 0.3 m long
    assert neck == pytest.approx([0.0, 0.0, 0.24], abs=1e-9)
    thigh, shank = (plain.joints.index(f"left_{name}_joint") for name in ("thigh", "shank"))
    assert stance[shank] > 0.2 > 0.0 > stance[thigh]  # the knee bends backwards


@FEW
@given(axis=st.sampled_from(np.eye(3).tolist()), angle=ANGLES)
def test_the_torsos_own_frame_may_be_turned(tmp_path_factory, plain: ImportedRobot, axis, angle):
    assume(angle == 0.0 or abs(angle) > 0.02)  # within a degree the frame itself is believed
    frame = quaternion.from_axis_angle(np.array(axis), angle)
    turned = imported(tmp_path_factory.mktemp("turned"), frame=frame)
    assert describe_pairs(turned) == describe_pairs(plain)
    np.testing.assert_allclose(turned.stance.joint_pos, plain.stance.joint_pos, atol=2e-3)
    np.testing.assert_allclose(measure_sites(turned), measure_sites(plain), atol=2e-3)


@FEW
@given(seed=st.integers(0, 1000))
def test_geometry_alone_pairs_the_joints(tmp_path_factory, plain: ImportedRobot, seed):
    numbers: dict[str, str] = {}
    order = np.random.default_rng(seed).permutation(1000)

    def rename(name: str) -> str:
        return numbers.setdefault(name, f"n{order[len(numbers)]}")

    renamed = imported(tmp_path_factory.mktemp("renamed"), rename=rename)
    expected = {(numbers[a], numbers[b], sign) for a, b, sign in describe_pairs(plain)}
    assert describe_pairs(renamed) == expected
    np.testing.assert_allclose(measure_sites(renamed), measure_sites(plain), atol=1e-6)
