"""Readiness: from which sides a robot has motions, which policies it has, and what to do."""

import shutil
from pathlib import Path

import pytest

from humanoid_getup.motions.motion_database import MOTION_FOLDER, suggest_motions
from humanoid_getup.robot_check.finding import CheckFinding
from humanoid_getup.robot_check.readiness_check import LYING, check_readiness
from robots import Robot, load_robot


def check(folder: Path) -> tuple[CheckFinding, CheckFinding]:
    motions, policies = check_readiness(load_robot(folder))
    return motions, policies


@pytest.fixture
def copy(op3: Robot, tmp_path: Path) -> Path:
    """A copy of OP3 without policies and motions."""
    ignored = shutil.ignore_patterns("policies", MOTION_FOLDER)
    return Path(shutil.copytree(op3.folder, tmp_path / "copy", ignore=ignored))


def store(op3: Robot, folder: Path, *names: str) -> None:
    (folder / MOTION_FOLDER).mkdir()
    for name in names:
        shutil.copy(op3.folder / MOTION_FOLDER / f"{name}.npz", folder / MOTION_FOLDER)


def test_op3_rises_from_every_side_and_has_policies(op3: Robot):
    motions, policies = check_readiness(op3)
    assert (motions.level, policies.level) == ("ok", "ok")
    assert motions.text.endswith(f"from {', '.join(LYING)}")
    assert policies.text.split(", ") == sorted(f.stem for f in op3.folder.glob("policies/*.onnx"))


def test_a_robot_without_motions_gets_advice(copy: Path):
    motions, policies = check(copy)
    assert motions.level == "warning"
    assert motions.text == "there are none, so no rise can be planned"
    assert motions.remedy == f"getup motions discover --robot {copy}"
    assert policies.level == "ok"  # rises are planned without
    assert policies.remedy.startswith(f"getup train --robot {copy} ")


def test_sides_without_motion_are_named(op3: Robot, copy: Path):
    store(op3, copy, "prone_push_up_fast")
    motions, _ = check(copy)
    assert motions.level == "warning"
    assert "from prone; none from supine, left, right" in motions.text
    assert motions.remedy == f"getup motions discover --robot {copy}"


def test_a_motion_from_one_side_serves_its_mirror_image(op3: Robot, copy: Path):
    store(op3, copy, "prone_push_up_fast", "supine_sit_up_fast", "lateral_side_sit")
    motions, _ = check(copy)
    assert motions.level == "ok"


def test_a_motion_that_cannot_be_read_is_a_fault(copy: Path):
    (copy / MOTION_FOLDER).mkdir()
    (copy / MOTION_FOLDER / "broken.npz").write_bytes(b"no archive")
    motions, _ = check(copy)
    assert motions.level == "fault"
    assert "broken.npz" in motions.text


def test_a_robot_of_the_package_is_called_by_its_name():
    motions, policies = check_readiness(load_robot("toddlerbot"))
    assert motions.level == "ok"
    assert suggest_motions(load_robot("toddlerbot")) == "getup motions discover --robot toddlerbot"
    assert policies.remedy == "getup train --robot toddlerbot --recipe quick --out out/quick"
