"""The robot as LeRobot's programs use it: on the twin, and on a virtual bus."""

import contextlib
import os
import sys
import threading
import time

import numpy as np
import pytest
from lerobot.robots import make_robot_from_config
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError
from lerobot_robot_getup import GetupRobot, GetupRobotConfig, SwingTeleop, SwingTeleopConfig
from lerobot_robot_getup.robot_thread import RobotStoppedError, RobotThread
from waiting import wait_until

from drivers import DriverError, Twin
from drivers.errors import UnreleasedError
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.strategies.plan import Plan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot

PAN = "head_pan.pos"


def twin_of(robot: GetupRobot) -> Twin:
    assert robot._thread is not None
    twin = robot._thread._guard.backend
    assert isinstance(twin, Twin)
    return twin


def targets_of(robot: GetupRobot) -> np.ndarray:
    """Return the last targets without a call that LeRobot would make [rad]."""
    assert robot._thread is not None
    return robot._thread._guard.targets


def move(robot: GetupRobot, key: str, number: float) -> None:
    def has_arrived() -> bool:
        robot.send_action({key: number})
        return abs(robot.get_observation()[key] - number) < 2.0

    wait_until(has_arrived)


def test_features_are_known_before_it_is_connected(make):
    robot = make()
    assert isinstance(make_robot_from_config(robot.config), GetupRobot)
    assert robot.name == GetupRobotConfig().type == "getup"
    assert not robot.is_connected
    assert robot.action_features == SwingTeleop(SwingTeleopConfig()).action_features
    assert len(robot.action_features) == 20
    own = [key for key in robot.observation_features if key not in robot.action_features]
    imu = [f"imu.{what}.{axis}" for what in ("gravity_b", "gyro_b") for axis in "xyz"]
    assert own == [*imu, "getup.rising"]
    for use in (robot.get_observation, robot.disconnect, lambda: robot.send_action({})):
        with pytest.raises(DeviceNotConnectedError):
            use()


@pytest.mark.parametrize(
    ("backend", "use_degrees"), [("twin", True), ("twin", False), ("virtual", True)]
)
def test_it_is_observed_and_obeys(backend: str, use_degrees: bool, make):
    with make(backend=backend, use_degrees=use_degrees) as robot:
        assert robot.is_connected
        assert robot.is_calibrated
        with pytest.raises(DeviceAlreadyConnectedError):
            robot.connect()
        observed = robot.get_observation()
        assert set(observed) == set(robot.observation_features)
        assert observed["imu.gravity_b.z"] == pytest.approx(-1.0, abs=0.02)
        move(robot, PAN, 20.0)
        sent = robot.send_action({})
        assert set(sent) == set(robot.action_features)
        assert sent[PAN] == pytest.approx(20.0, abs=2.0)
        assert robot.get_observation()["getup.rising"] == 0.0
    assert not robot.is_connected


def test_torque_and_time_wait_for_the_first_action_and_joints_not_named_are_held(connect, op3):
    robot = connect()
    twin = twin_of(robot)
    time.sleep(0.3)
    stand = robot.get_observation()
    assert not twin.simulation.has_torque
    assert twin.data.time == 0.0
    move(robot, PAN, 30.0)
    assert twin.simulation.has_torque
    sent = robot.send_action({})
    others = [key for key in robot.action_features if key != PAN]
    assert len(others) == op3.n - 1
    # As they were measured when torque came on, a cycle after the twin was placed.
    assert max(abs(sent[key] - stand[key]) for key in others) < 0.5
    robot.disconnect()
    assert not twin.simulation.has_torque


def test_the_first_action_is_approached_slowly_and_later_ones_at_once(connect, op3: Robot):
    robot = connect(approach_speed=30.0)
    sent = robot.send_action({PAN: 20.0})
    step = 30.0 * op3.control_period
    assert sent[PAN] < 20.0 - 10.0 * step, "the answer is of the cycle that sent it"
    wait_until(lambda: abs(robot.send_action({PAN: 20.0})[PAN] - 20.0) < 0.1)
    moved = 20.0 - robot.send_action({PAN: 15.0})[PAN]
    fastest = np.degrees(op3.max_velocity[op3.joint_names.index("head_pan")]) * op3.control_period
    assert 2.0 * step < moved <= fastest + 0.1, "the guard limits it to the servo's speed"
    highest, key = np.degrees(op3.upper[op3.joint_names.index("head_tilt")]), "head_tilt.pos"
    wait_until(lambda: robot.send_action({key: 500.0})[key] > 0.99 * highest)
    assert robot.send_action({key: 500.0})[key] <= highest + 0.1, "a tick: what the guard sent"


def test_joints_are_held_while_lerobot_is_silent(connect, op3: Robot, caplog):
    robot, pan = connect(approach_speed=0.6), op3.joint_names.index("head_pan")
    robot.send_action({PAN: 34.0})
    time.sleep(0.3)  # on a busy computer, the thread may have been late
    held, began = targets_of(robot), twin_of(robot).data.time
    wait_until(lambda: "no call from LeRobot for 1 s: joints are held" in caplog.text)
    assert twin_of(robot).data.time > began
    assert targets_of(robot) == pytest.approx(held)
    assert 0.0 < held[pan] < 0.5
    assert twin_of(robot).simulation.has_torque
    robot.get_observation()
    time.sleep(0.1)
    assert targets_of(robot) == pytest.approx(held), "only an action ends a long silence"
    assert robot.send_action({PAN: 34.0})[PAN] < np.degrees(held[pan]) + 0.6, "slowly"
    wait_until(lambda: robot.send_action({PAN: 34.0})[PAN] > np.degrees(held[pan]) + 0.6)


def test_a_target_that_is_no_number_is_refused_and_the_stand_is_kept(connect):
    robot = connect()
    held = robot.send_action({PAN: 0.0})
    with pytest.raises(ValueError, match="joint 'head_tilt': target is nan, expected a finite"):
        robot.send_action({PAN: 9.0, "head_tilt.pos": float("nan")})
    assert robot.send_action({}) == pytest.approx(held, abs=0.2)
    with pytest.raises(ValueError, match="unknown joint 'gripper'"):
        robot.send_action({"gripper.pos": 1.0})
    assert twin_of(robot).simulation.has_torque


def test_a_robot_that_falls_rises_drops_actions_meanwhile_and_obeys_again(connect):
    robot = connect()
    robot.send_action({PAN: 0.0})
    twin_of(robot).data.qvel[0] += 3.0  # m/s, a push that no stance bears
    observe = robot.get_observation
    wait_until(lambda: observe()["getup.rising"] == 1.0)
    wait_until(lambda: robot.send_action({PAN: 34.0}) and observe()["getup.rising"] == 0.0)
    begin = twin_of(robot).data.time
    wait_until(lambda: twin_of(robot).data.time > begin + 1.0)
    assert observe()["imu.gravity_b.z"] < -0.97
    move(robot, PAN, 34.0)
    assert twin_of(robot).simulation.has_torque
    assert observe()["getup.rising"] == 0.0


def test_a_robot_that_lies_rises_at_the_first_action_by_a_policy(connect):
    robot = connect(start="supine", rise="policy")
    assert robot.get_observation()["imu.gravity_b.z"] > -0.8
    robot.send_action({PAN: 15.0})
    wait_until(lambda: robot.get_observation()["imu.gravity_b.z"] < -0.97)
    move(robot, PAN, 15.0)


def test_without_a_way_to_rise_a_fallen_robot_goes_on_obeying(connect):
    robot = connect(rise="none")
    robot.send_action({PAN: 0.0})
    twin_of(robot).data.qvel[0] += 3.0
    wait_until(lambda: robot.get_observation()["imu.gravity_b.z"] > -0.3)
    wait_until(lambda: abs(robot.send_action({PAN: 20.0})[PAN] - 20.0) < 1.0)
    assert robot.get_observation()["getup.rising"] == 0.0


def test_a_robot_that_cannot_rise_says_why_and_stays_limp(connect, monkeypatch):
    refuse = lambda *_: Plan(status=RiseStatus.NOT_PLANNED)  # noqa: E731
    monkeypatch.setattr(PlannedRise, "plan", refuse)
    robot = connect(start="supine", attempts=1)
    robot.send_action({PAN: 0.0})
    with pytest.raises(RobotStoppedError, match=f"has stopped: {RiseStatus.NOT_PLANNED.value}"):
        wait_until(lambda: not robot.get_observation())
    assert not twin_of(robot).simulation.has_torque
    robot.disconnect()


def test_it_is_disconnected_while_it_plans(connect, monkeypatch):
    planning, plan = threading.Event(), PlannedRise.plan
    monkeypatch.setattr(PlannedRise, "plan", lambda *given: planning.set() or plan(*given))
    robot = connect(start="supine")
    # At Python's own interval a loop over a wire, which waits often, gets a fifth of its turns.
    assert sys.getswitchinterval() <= 0.001
    robot.send_action({PAN: 0.0})
    assert planning.wait(120.0)
    twin = twin_of(robot)
    robot.disconnect()
    assert not twin.simulation.has_torque


def test_a_fault_or_error_is_raised_by_the_next_call_and_torque_stays_off(connect, monkeypatch):
    robot = connect()
    robot.send_action({PAN: 0.0})
    assert robot._thread is not None
    robot._thread._guard.stop("a person pressed a button")
    for use in (lambda: robot.send_action({PAN: 1.0}), robot.get_observation):
        with pytest.raises(RobotStoppedError, match="the robot was stopped: a person pressed"):
            wait_until(lambda use=use: not use())
    assert not twin_of(robot).simulation.has_torque
    robot.disconnect()
    robot.connect()
    robot.send_action({PAN: 0.0})
    monkeypatch.setattr(RobotThread, "leans", lambda *_: 1 / 0)
    with pytest.raises(RobotStoppedError, match="division by zero"):
        wait_until(lambda: not robot.get_observation())
    assert not twin_of(robot).simulation.has_torque


def test_joints_that_do_not_confirm_torque_off_are_named_at_disconnect(connect, monkeypatch):
    robot = connect()
    robot.send_action({PAN: 0.0})
    joints, close = robot._robot.joints[:2], Twin.close

    def leave(self: Twin) -> None:
        close(self)
        raise UnreleasedError(joints, watched=False)

    monkeypatch.setattr(Twin, "close", leave)
    monkeypatch.setattr(Twin, "unreleased", tuple(joint.name for joint in joints))
    with pytest.raises(RobotStoppedError, match=f"joint '{joints[0].name}'.*'{joints[1].name}'"):
        robot.disconnect()
    assert not robot.is_connected


def test_a_forked_child_cannot_move_or_end_the_robot(connect):
    robot = connect()
    robot.send_action({PAN: 0.0})
    reading, writing = os.pipe()
    if (child := os.fork()) == 0:
        with contextlib.suppress(RobotStoppedError):
            robot.send_action({PAN: 9.0})
            os._exit(1)
        robot.disconnect()
        os.write(writing, b"closed")
        os._exit(0)
    assert os.read(reading, 6) == b"closed"
    assert os.waitpid(child, 0)[1] == 0
    move(robot, PAN, 10.0)


REFUSED = [
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
]


def test_a_configuration_that_does_not_fit_is_refused(make):
    for options, message in REFUSED:
        with pytest.raises(BadInputError) as refused:
            make(**options)
        assert message in str(refused.value)
        assert "\n" not in str(refused.value)
    for options, message in (  # as it connects
        ({"start": "upside"}, "unknown start 'upside'"),
        ({"backend": "dynamixel", "port": "/dev/no_port"}, "/dev/no_port"),
        ({"torque_limit": 99.0}, "torque limit is 99 N·m, expected at most"),
    ):
        robot = make(**options)
        with pytest.raises((BadInputError, DriverError), match=message):
            robot.connect()
        assert not robot.is_connected


def test_a_swing_is_about_the_stand(op3: Robot):
    teleop = SwingTeleop(SwingTeleopConfig(joints=["head_pan"], amplitude=10.0))
    teleop.connect()
    actions = []
    for _ in range(5):
        actions.append(np.radians(list(teleop.get_action().values())))
        time.sleep(0.01)
    assert np.nonzero(np.ptp(actions, axis=0))[0].tolist() == [op3.joint_names.index("head_pan")]
    assert np.abs(np.array(actions) - op3.standing.joint_pos).max() <= np.radians(10.0) + 1e-9
    with pytest.raises(ValueError, match=r"--teleop\.joints: unknown joint 'tail'"):
        SwingTeleop(SwingTeleopConfig(joints=["tail"]))
