"""What a model means does not depend on its place, frames and names; its sites belong there."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from paths import SHARED
from small_humanoid import LEFT, small_humanoid

from robots import Robot, quaternion
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


def found(tmp_path: Path, change: Callable[[mujoco.MjSpec], object] = lambda _: None, **how):
    (tmp_path / "model.xml").write_text(small_humanoid(change=change, **how))
    robot = import_model(tmp_path / "model.xml", ImportOptions(name="small"))
    return robot, robot.spec.compile()


def list_guesses(robot: ImportedRobot, site: str) -> list[str]:
    return [guess for guess in robot.guesses if guess.startswith(f"site {site}")]


def add_ankle_plates(spec: mujoco.MjSpec) -> None:
    """Give the ankles larger flat faces than the feet have, 20 mm above the ground."""
    for side in ("left", "right"):
        box = {"type": mujoco.mjtGeom.mjGEOM_BOX, "size": [0.07, 0.04, 0.005]}
        spec.body(f"{side}_ankle").add_geom(**box, pos=[0, 0, -0.005], mass=1e-3)


def test_soles_are_under_the_feet(tmp_path: Path):
    for change in (lambda _: None, add_ankle_plates):
        _, model = found(tmp_path, change)
        left, right = model.site("l_sole"), model.site("r_sole")
        assert model.body(int(left.bodyid[0])).name == "left_foot"
        assert left.pos == pytest.approx([0.015, 0.0, -0.03], abs=1e-6)
        assert right.pos == pytest.approx(left.pos, abs=1e-6)


def add_imu(spec: mujoco.MjSpec) -> None:
    spec.body("torso").add_site(name="gyro_mount", pos=[0.01, 0.02, 0.1])


def test_the_imu_is_where_the_model_names_one_and_turns_back_with_its_torso(tmp_path: Path):
    """A torso whose own frame is turned by a right angle about z: x of the IMU stays its own."""
    robot, model = found(tmp_path, add_imu)
    assert model.site("imu").pos == pytest.approx([0.01, 0.02, 0.1])
    assert list_guesses(robot, "imu") == ["site imu: the model's site gyro_mount"]
    frame = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    _, model = found(tmp_path, add_imu, frame=frame)
    assert model.site("imu").pos == pytest.approx([-0.02, 0.01, 0.1], abs=1e-6)
    assert np.abs(model.site("imu").quat @ frame) == pytest.approx(1.0)


MESHES = SHARED / "models" / "op3-mesh" / "op3.xml"
KP, FORCE = 21.1, 4.1  # N·m/rad and N·m, as a position actuator states an XM430-W350


def add_actuators(robot: Robot, path: Path) -> Path:
    spec = mujoco.MjSpec.from_file(str(robot.folder / "model.xml"))
    for joint in robot.joints:
        spec.add_actuator(
            target=joint.name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gainprm=[KP, *[0.0] * 9],
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[0.0, -KP, *[0.0] * 8],
            forcerange=[-FORCE, FORCE],
        )
    spec.compile()
    path.write_text(spec.to_xml())
    return path


def check(found: ImportedRobot, op3: Robot) -> None:
    own = {
        joint.name: (op3.joint_names[mirror], int(sign))
        for joint, mirror, sign in zip(op3.joints, op3.mirror_index, op3.mirror_sign, strict=True)
    }
    pairs = zip(found.joints, found.mirror, found.mirror_sign, strict=True)
    assert {name: (found.joints[k], sign) for name, k, sign in pairs} == own
    assert found.stance.is_solved
    assert found.torso == "body_link"
    heads = {n for n, kind in zip(found.joints, found.segments, strict=True) if kind == "head"}
    assert heads == {"head_pan", "head_tilt"}
    assert set(found.spreading_joints) == {"l_hip_roll"}
    assert set(found.servos.types) == {"XM430-W350"}


def test_its_model_gives_back_its_description(op3: Robot, tmp_path: Path):
    found = import_model(add_actuators(op3, tmp_path / "model.xml"), ImportOptions(name="op3"))
    check(found, op3)
    # It is as heavy, and its sole is where the description has it.
    ours, theirs = op3.spec().compile(), found.spec.compile()
    assert theirs.body_mass.sum() == pytest.approx(ours.body_mass.sum())
    for name, site in zip(("l_sole", "r_sole"), op3.sole_sites, strict=True):
        np.testing.assert_allclose(theirs.site(name).pos, ours.site(site).pos, atol=0.01)


@pytest.mark.skipif(not MESHES.exists(), reason="needs the mesh model in ../shared")
def test_its_mesh_model_gives_back_its_description(op3: Robot):
    check(import_model(MESHES, ImportOptions(name="op3")), op3)
