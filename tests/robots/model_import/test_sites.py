"""Sites of an imported model: soles, neck and IMU, where the model has them or they belong."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from small_humanoid import small_humanoid

from robots.model_import.importer import ImportedRobot, ImportOptions, import_model


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


def test_without_a_head_it_is_between_the_shoulders(tmp_path: Path):
    robot, model = found(tmp_path, lambda spec: spec.delete(spec.body("head")))
    assert model.site("neck").pos == pytest.approx([0.0, 0.0, 0.2])
    assert "the middle of the shoulders" in list_guesses(robot, "neck")[0]


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
