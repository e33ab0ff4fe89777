"""The health of a robot that another program moves: one sentence for one cause."""

import os
import threading
from dataclasses import replace

import numpy as np
import pytest
from recording_backend import still_state

from drivers import Command, State
from drivers.control_loop import Cycle, Timing
from drivers.live_feed.feed import LiveFeed
from drivers.live_feed.messages import LiveHello, LiveSample, find_feeds_folder
from drivers.safety_limits import ClipCounts
from humanoid_getup.cli.main import main
from humanoid_getup.jobs.check_health import RobotHealth, check_health, describe_health
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.health import HealthRequest
from robots import Robot


def make_cycle(robot: Robot, state: State) -> Cycle:
    sent = Command.position(robot, state.joint_pos, np.full(robot.n, 1.0))
    clips = ClipCounts(*np.zeros((5, robot.n), dtype=int))
    timing = Timing(late=0.0, read=0.0, step=0.0, write=0.0)
    return Cycle(state=state, asked=sent, sent=sent, clips=clips, timing=timing)


def describe(robot: Robot, rate: float | None = None, **values) -> RobotHealth:
    state = replace(still_state(robot), **values)
    sample = LiveSample.of(make_cycle(robot, state), "rising", 7)
    wanted = 1.0 / robot.control_period
    return describe_health(LiveHello.of(robot), sample, wanted if rate is None else rate, 42)


def test_a_robot_in_order_has_no_findings(op3: Robot):
    found = describe(op3)
    assert (found.healthy, found.findings) == (True, [])
    assert found.torque_limits_nm["l_knee"] == pytest.approx(1.0)
    assert (found.torque_on, found.phase, found.program) == (True, "rising", 42)


@pytest.mark.parametrize(
    ("values", "finding"),
    [
        ({"voltage": 9.0}, "the supply is 9.0 V, expected 10.0 V or more"),
        ({"imu_age": 0.2}, "the IMU has been silent for 0.20 s"),
        ({"joint_age": np.full(20, 0.5)}, "all servos have been silent for 0.50 s: no power?"),
        ({"joint_age": 0.5 * (np.arange(20) == 3)}, "silent for 0.50 s: l_sho_roll"),
        ({"temperature": 20.0 + 60.0 * (np.arange(20) == 13)}, "l_knee is 80 °C hot, expected at"),
        ({"alert": 32 * (np.arange(20) == 0)}, "r_sho_pitch reports overload"),
        ({"rate": 60.0}, "60 cycles a second, expected 125: this computer is too busy"),
    ],
)
def test_each_cause_is_one_finding(op3: Robot, values: dict, finding: str):
    (found,) = describe(op3, **values).findings
    assert found.startswith(finding)


def test_a_program_that_computes_is_not_called_slow(op3: Robot):
    assert describe(op3, rate=0.0).healthy


def test_a_running_program_is_followed_and_its_cycles_are_counted(
    op3: Robot, tmp_path, monkeypatch
):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    ended = threading.Event()
    with LiveFeed(op3, stop=lambda _: None) as feed:
        feed.note("rising")

        def run() -> None:
            while not ended.wait(0.002):
                feed.show(make_cycle(op3, still_state(op3)))

        program = threading.Thread(target=run)
        program.start()
        try:
            found = check_health(HealthRequest(program=os.getpid(), seconds=0.3))
            assert main(("health", "--seconds", "0.3")) in (0, 3)  # 3 on a computer that is late
        finally:
            ended.set()
            program.join()
    assert (found.robot, found.phase, found.program) == ("op3", "rising", os.getpid())
    assert 0.0 < found.rate_hz < 1000.0


def test_a_folder_of_feeds_that_others_can_enter_is_bad_input(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    find_feeds_folder().chmod(0o755)
    assert main(("health",)) == 2
    assert "expected a folder of this user alone; remove it" in capsys.readouterr().err


def test_without_a_program_that_shows_a_robot_there_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(BadInputError, match="no program shows a robot: start rise, watch"):
        check_health(HealthRequest())
    with pytest.raises(BadInputError, match="program 1 shows no robot: start it with --live"):
        check_health(HealthRequest(program=1))
