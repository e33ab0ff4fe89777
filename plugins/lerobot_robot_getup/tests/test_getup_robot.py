"""The robot as LeRobot's programs use it, in its own process: on the twin and on a virtual bus."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("lerobot.robots", reason="needs LeRobot", exc_type=ImportError)

from getup_server.robot_client import RobotUnreachableError
from lerobot.robots import make_robot_from_config
from lerobot.utils.errors import DeviceNotConnectedError
from lerobot_robot_getup import GetupRobot, GetupRobotConfig, SwingTeleop, SwingTeleopConfig

from humanoid_getup.jobs.errors import BadInputError


def make(tmp_path: Path, **options) -> GetupRobot:
    return GetupRobot(GetupRobotConfig(id="test", calibration_dir=tmp_path, **options))


def test_lerobot_makes_it_from_its_configuration(tmp_path: Path):
    robot = make_robot_from_config(GetupRobotConfig(id="test", calibration_dir=tmp_path))
    assert isinstance(robot, GetupRobot)
    assert robot.name == "getup"


def test_features_are_known_before_it_is_connected(tmp_path: Path):
    robot = make(tmp_path)
    assert not robot.is_connected
    assert robot.action_features == SwingTeleop(SwingTeleopConfig()).action_features
    assert len(robot.action_features) == 20
    own = [key for key in robot.observation_features if key not in robot.action_features]
    assert own == [
        *(f"imu.gravity_b.{axis}" for axis in "xyz"),
        *(f"imu.gyro_b.{axis}" for axis in "xyz"),
        "getup.rising",
    ]
    for use in (robot.get_observation, robot.disconnect, lambda: robot.send_action({})):
        with pytest.raises(DeviceNotConnectedError):
            use()


@pytest.mark.parametrize("backend", ["twin", "virtual"])
@pytest.mark.parametrize("use_degrees", [True, False])
def test_it_is_observed_and_obeys(backend: str, use_degrees: bool, tmp_path: Path):
    with make(tmp_path, backend=backend, use_degrees=use_degrees) as robot:
        assert robot.is_connected
        assert robot.is_calibrated
        observed = robot.get_observation()
        assert set(observed) == set(robot.observation_features)
        assert observed["imu.gravity_b.z"] == pytest.approx(-1.0, abs=0.02)
        stand = {key: observed[key] for key in robot.action_features}
        end = time.monotonic() + 60.0
        while abs(observed["head_pan.pos"] - 20.0) > 2.0:
            sent = robot.send_action(stand | {"head_pan.pos": 20.0})
            assert set(sent) == set(robot.action_features)
            observed = robot.get_observation()
            assert time.monotonic() < end
        assert sent["head_pan.pos"] == pytest.approx(20.0, abs=2.0)
        assert observed["getup.rising"] == 0.0
    assert not robot.is_connected


def test_a_robot_that_lies_rises_and_then_obeys(tmp_path: Path):
    robot = make(tmp_path, start="supine", realtime=False)
    robot.connect()
    try:
        assert robot.get_observation()["imu.gravity_b.z"] > -0.8
        robot.send_action({"head_pan.pos": 15.0})
        end = time.monotonic() + 120.0
        rising: list[float] = []
        while not rising or rising[-1]:
            rising.append(robot.get_observation()["getup.rising"])
            robot.send_action({"head_pan.pos": 15.0})
            assert time.monotonic() < end
        assert len(rising) > 5, "it was seen to rise"
        while abs(robot.get_observation()["head_pan.pos"] - 15.0) > 2.0:
            robot.send_action({"head_pan.pos": 15.0})
            assert time.monotonic() < end
        assert robot.get_observation()["imu.gravity_b.z"] < -0.97
    finally:
        robot.disconnect()


def test_a_fault_is_raised_and_torque_stays_off(tmp_path: Path):
    with make(tmp_path) as robot:
        end = time.monotonic() + 60.0
        with pytest.raises(RobotUnreachableError, match="'head_pan': target is nan rad"):
            while time.monotonic() < end:
                robot._client.act({"head_pan": float("nan")})
        with pytest.raises(RobotUnreachableError, match="has stopped"):
            robot.get_observation()


def test_a_target_that_is_no_number_is_refused_and_the_robot_obeys_on(tmp_path: Path):
    with make(tmp_path) as robot:
        held = robot.send_action({"head_pan.pos": 0.0})
        with pytest.raises(ValueError, match="joint 'head_tilt': target is nan, expected a finite"):
            robot.send_action({"head_pan.pos": 9.0, "head_tilt.pos": float("nan")})
        assert robot.send_action({}) == pytest.approx(held, abs=0.2)


def test_an_unknown_joint_is_refused(tmp_path: Path):
    with make(tmp_path) as robot, pytest.raises(ValueError, match="unknown joint 'gripper'"):
        robot.send_action({"gripper.pos": 1.0})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"model": "no_robot"}, "no_robot"),
        ({"backend": "real"}, "--robot.backend is 'real'"),
        ({"backend": "dynamixel"}, "--robot.backend dynamixel requires --robot.port"),
        ({"port": "/dev/ttyUSB0"}, "--robot.port is /dev/ttyUSB0"),
        ({"rise": "jump"}, "--robot.rise is 'jump'"),
        ({"attempts": 0}, "--robot.attempts is 0"),
        ({"torque_limit": -1.0}, "--robot.torque_limit is -1"),
        ({"max_speed": 0.0}, "--robot.max_speed is 0 deg/s, expected more than 0 deg/s"),
        ({"approach_speed": -1.0}, "--robot.approach_speed is -1 deg/s"),
        ({"fallen_tilt": 0.0}, "--robot.fallen_tilt is 0 deg, expected between 0 and 180 deg"),
    ],
)
def test_a_configuration_that_does_not_fit_is_refused(options, message: str, tmp_path: Path):
    with pytest.raises(BadInputError) as refused:
        make(tmp_path, **options)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": "upside"}, "unknown start 'upside'"),
        ({"backend": "dynamixel", "port": "/dev/no_port"}, "/dev/no_port"),
        ({"torque_limit": 99.0}, "torque limit is 99 N·m, expected at most"),
    ],
)
def test_a_robot_that_cannot_be_opened_is_refused_as_it_connects(
    options, message: str, tmp_path: Path
):
    robot = make(tmp_path, **options)
    with pytest.raises(RobotUnreachableError, match=message):
        robot.connect()
    assert not robot.is_connected


KILLED = """
import sys
from pathlib import Path
from lerobot_robot_getup import GetupRobot, GetupRobotConfig
robot = GetupRobot(GetupRobotConfig(id="test", calibration_dir=Path(sys.argv[1])))
robot.connect()
robot.send_action({"head_pan.pos": 5.0})
print(robot._client.pid, flush=True)
while True:
    robot.send_action({"head_pan.pos": 5.0})
"""


def test_the_process_of_the_robot_ends_when_lerobots_is_killed(tmp_path: Path):
    """That its torque goes off then is a test of the runner."""
    program = subprocess.Popen(
        [sys.executable, "-c", KILLED, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert program.stdout is not None
    pid = int(program.stdout.readline())
    assert Path(f"/proc/{pid}").exists()
    os.kill(program.pid, signal.SIGKILL)
    program.communicate()
    end = time.monotonic() + 60.0
    while state_of(pid) != "Z":
        assert time.monotonic() < end
        time.sleep(0.05)


def state_of(pid: int) -> str:
    """Return the state of a process, Z for one that has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return "Z"
