"""What the check says of OP3, and of OP3 with one fault put in: one finding, and what to do."""

import re
from pathlib import Path

import pytest
from spoiling import spoil

from humanoid_getup.robot_check.check import check_robot
from humanoid_getup.robot_check.model_check import CheckFinding
from robots import Robot, load_robot

MODEL, TOML = "model.xml", "robot.toml"
WEAK = "[mini]\nstall_torque = 0.5\n"  # N·m


def find_problems(robot: Robot) -> list[CheckFinding]:
    return [found for found in check_robot(robot).findings if found.level != "ok"]


def swap_servo(folder: Path, joint: str, figures: str) -> None:
    """Give a joint a servo that is XM430-W350 but for some figures."""
    own = (Path(load_robot("op3").folder).parent / "servos.toml").read_text("utf-8")
    base = re.search(r"\[XM430-W350\]\n((?:\w.*\n)+)", own)
    assert base
    changed = {line.split(" = ")[0] for line in figures.splitlines()[1:]}
    rest = [line for line in base[1].splitlines() if line.split(" = ")[0] not in changed]
    (folder / "servos.toml").write_text(figures + "\n".join(rest) + "\n")
    row = re.search(rf'name = "{joint}".*', (folder / TOML).read_text("utf-8"))
    assert row
    spoil(folder, row[0], row[0].replace("XM430-W350", "mini"))


def test_nothing_is_wrong_with_op3(op3: Robot):
    checked = check_robot(op3)
    assert {finding.level for finding in checked.findings} == {"ok"}
    assert {finding.subject for finding in checked.findings} == {
        *("body", "soles", "mirror", "stance", "squat", "arms", "motions", "policies")
    }
    assert checked.is_sound
    assert all(str(finding).isprintable() for finding in checked.findings)


L_KNEE = 'mirror = "r_knee", mirror_sign = -1'
R_KNEE = 'mirror = "l_knee", mirror_sign = -1'
PAN = 'mirror = "head_pan", mirror_sign = -1'
YAW = 'name="l_hip_yaw" axis="0 0 -1" range="-50 162"'
FAULTS = {
    "ankles have a narrow range": (
        [(MODEL, 'range="-92 92"', 'range="-31 31"')],
        "warning",
        "squat: crouches in balance down to 78% of its neck height, expected at most 75%; "
        "at the end of their ranges: r_hip_pitch, l_hip_pitch, r_ank_pitch, l_ank_pitch",
    ),
    "the IMU is on the head": (
        [
            (MODEL, '<site name="imu"/>', ""),
            (MODEL, '<geom name="head_tilt_0"', '<site name="imu"/><geom name="head_tilt_0"'),
        ],
        "fault",
        "site 'imu': is on body 'head_tilt_link', expected 'body_link'",
    ),
    "a shape floats behind the back": (
        [(MODEL, '<site name="imu"/>', '<site name="imu"/><geom size="0.01" pos="-0.3 0 0"/>')],
        "warning",
        "shape 'number 0': of body 'body_link' is more than 39 mm from all others, and from its",
    ),
    "a joint mirrors one of another name": (
        [
            (TOML, PAN, PAN.replace("pan", "tilt")),
            (TOML, PAN.replace("pan", "tilt").replace("-1", "1"), PAN),
        ],
        "fault",
        "joint 'head_pan': its mirror is 'head_tilt', which is not its mirror image in the model; "
        "'head_pan' is",
    ),
    "the ranges of a pair differ": (
        [(MODEL, YAW, YAW.replace("162", "100"))],
        "warning",
        "joint 'l_hip_yaw': its range is -50 to 100°, that of its mirror 'r_hip_yaw' would be "
        "-50 to 162°",
    ),
}


@pytest.mark.parametrize(("changes", "level", "text"), FAULTS.values(), ids=FAULTS)
def test_a_fault_is_found_by_one_finding(changes, level: str, text: str, copied_op3: Path):
    for file, old, new in changes:
        spoil(copied_op3, old, new, file)
    found = find_problems(load_robot(copied_op3))
    assert [finding.level for finding in found][:1] == [level]
    assert str(found[0]).startswith(text)
    assert found[0].remedy
    assert len(found) == 1


def test_a_leg_without_room_to_balance_is_named_on_both_sides(copied_op3: Path):
    for side, range_, new in (("l", "-50 162", "-1 162"), ("r", "-162 50", "-162 1")):
        axis = 'axis="0 0 -1"'
        old = f'name="{side}_hip_yaw" {axis} range="{range_}"'
        spoil(copied_op3, old, old.replace(range_, new), MODEL)
    room = "stands 1.0° from the end of its range, expected at least 2° to balance with"
    assert [(found.subject, found.text) for found in find_problems(load_robot(copied_op3))] == [
        ("joint 'r_hip_yaw'", room),
        ("joint 'l_hip_yaw'", room),
    ]


def test_a_knee_that_is_too_weak_is_named_once(copied_op3: Path):
    swap_servo(copied_op3, "l_knee", WEAK)
    (found,) = find_problems(load_robot(copied_op3))
    text = "joint 'l_knee': needs 0.54 N·m to hold the stance, 108% of the mini's"
    assert (found.level, str(found)[: len(text)]) == ("fault", text)


def test_faults_leave_unchecked_what_rests_on_them(copied_op3: Path):
    spoil(copied_op3, L_KNEE, L_KNEE.replace("-1", "1"))
    spoil(copied_op3, R_KNEE, R_KNEE.replace("-1", "1"))
    checked = check_robot(load_robot(copied_op3))
    assert checked.unchecked == ("squats", "strength", "arms", "holding the stance")
    assert not checked.is_sound
    assert checked.squats == ()
