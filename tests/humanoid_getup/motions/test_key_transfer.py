"""Key transfer: keys of OP3 for OP3 itself, and for OP3 under other names, orders and signs."""

from dataclasses import replace

import numpy as np
import pytest
from authored import load_robot_keyframes
from model_files import write_model

from humanoid_getup.motions.key_transfer import KeyTransfer
from humanoid_getup.motions.keyframes import Keyframes
from robots import Robot, load_robot
from robots.body.limbs import Limbs
from robots.model_import.importer import ImportOptions, import_model
from robots.model_import.robot_folder import write_robot
from robots.quaternion import Array

MOST = 2.0  # degrees by which a limb may point elsewhere


@pytest.fixture(scope="module")
def keyframes(op3: Robot) -> dict[str, Keyframes]:
    return {each.name: each for each in load_robot_keyframes(op3)}


@pytest.fixture(scope="module")
def renamed(op3: Robot, tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """OP3 as imported from a model that names and orders its joints otherwise."""
    folder = tmp_path_factory.mktemp("gnome")
    model = write_model(folder / "gnome.xml", op3)
    write_robot(import_model(model, ImportOptions(name="gnome")), folder / "gnome")
    return load_robot(folder / "gnome")


def measure_error(source: Limbs, target: Limbs, key: Array, found: Array) -> float:
    """Measure by how much the worst of the upper and lower limbs points elsewhere [deg]."""
    wanted, got = source.measure(key), target.measure(found)
    cosines = [
        getattr(wanted[name], part) @ getattr(got[name], part)
        for name in wanted
        for part in ("upper", "lower")
    ]
    return float(np.degrees(np.arccos(np.clip(min(cosines), -1.0, 1.0))))


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("squat_to_stand", "renamed"),
        ("prone_push_up_gentle", "op3"),
        ("lateral_side_sit", "renamed"),
    ],
)
def test_limbs_point_as_those_of_the_source(name, target, op3, renamed, keyframes):
    transfer = KeyTransfer.between(op3, {"op3": op3, "renamed": renamed}[target])
    moved = transfer.transfer(keyframes[name])
    errors = [
        measure_error(transfer.source, transfer.target, key, found)
        for key, found in zip(keyframes[name].keys[:-1], moved.keys[:-1], strict=True)
    ]
    assert max(errors) < MOST
    assert moved.keys[-1] == pytest.approx(transfer.target.robot.standing.joint_pos)


def test_a_symmetric_motion_stays_symmetric(op3: Robot, renamed: Robot, keyframes):
    moved = KeyTransfer.between(op3, renamed).transfer(keyframes["supine_long_sit"])
    assert moved.mirrored.any()
    assert renamed.mirror_joints(moved.keys) == pytest.approx(moved.keys, abs=1e-9)


def test_times_grow_with_the_square_root_of_the_height(op3: Robot, keyframes):
    tall = replace(op3, standing_neck_height=4.0 * op3.standing_neck_height)
    transfer = KeyTransfer(Limbs(op3), Limbs(tall))
    assert transfer.time_scale == pytest.approx(2.0)
    own = keyframes["squat_to_stand"]
    assert transfer.transfer(own).duration == pytest.approx(2.0 * own.duration)
