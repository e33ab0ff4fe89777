"""`getup robots import`: from a model file to a robot that stands on the twin."""

import json
from pathlib import Path

import numpy as np
import pytest
from run_getup import Run
from small_humanoid import small_humanoid, small_urdf

import humanoid_getup as hg
from drivers import Command
from humanoid_getup.experiments.judging.standing import HOLD_TIME


def stands(folder: Path) -> bool:
    """Tell whether a robot stays upright on the twin with its servos at the stance's angles."""
    robot = hg.load_robot(folder)
    n = len(robot.joints)
    command = Command(
        joint_pos=robot.standing.joint_pos,
        gain_scale=np.ones(n),
        torque_limit=robot.max_torque,
        pwm_limit=np.ones(n),
    )
    with hg.Twin(hg.World(robot)) as twin:
        for _ in range(round(HOLD_TIME / twin.period)):
            twin.write(command)
        tilt = np.arccos(1.0 - 2.0 * np.sum(twin.data.qpos[4:6] ** 2))
    return bool(tilt < np.radians(15.0))


@pytest.mark.parametrize(
    ("name", "content"), [("small.xml", small_humanoid(yaw=2.0)), ("small.urdf", small_urdf())]
)
def test_an_imported_robot_stands_on_the_twin(run: Run, tmp_path: Path, name, content):
    (tmp_path / name).write_text(content)
    code, out, _ = run(
        "robots", "import", str(tmp_path / name), "--out", str(tmp_path / "mine"), "--json", "-"
    )
    assert code == 0
    found = json.loads(out)
    assert (found["dof"], found["pairs"], found["torso"]) == (19, 9, "torso")
    assert found["servos"] == ["XM430-W350"]
    assert stands(tmp_path / "mine")


def test_a_servo_type_and_a_fixed_joint_can_be_said(run: Run, tmp_path: Path):
    (tmp_path / "small.xml").write_text(small_humanoid())
    code, _, _ = run(
        *("robots", "import", str(tmp_path / "small.xml"), "--out", str(tmp_path / "mine")),
        *("--servo", "XM430-W210,XM540-W270=*shank*", "--fix", "head_joint"),
    )
    assert code == 0
    robot = hg.load_robot(tmp_path / "mine")
    types = {joint.name: joint.servo.model.name for joint in robot.joints}
    assert "head_joint" not in types
    assert {name for name, kind in types.items() if kind == "XM540-W270"} == {
        "left_shank_joint",
        "right_shank_joint",
    }
