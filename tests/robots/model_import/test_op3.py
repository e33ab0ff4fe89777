"""OP3's own models, imported without their description."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from paths import SHARED

from robots import Robot
from robots.model_import.importer import ImportedRobot, ImportOptions, import_model

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
