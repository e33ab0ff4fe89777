"""The robot's process as LeRobot's process sees it: how both end. No LeRobot is needed."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from getup_server import robot_client
from getup_server.messages import Setup
from getup_server.robot_client import RobotClient, RobotUnreachableError
from getup_server.robot_request import RobotRequest

from drivers.twin.simulation import Simulation
from drivers.virtual_bus.own_process.real_time_robot import RealTimeRobot
from robots import load_robot

TINY = Path(__file__).parents[3] / "tests" / "robots" / "tiny"


def make_setup(**request) -> Setup:
    return Setup(
        request=RobotRequest(**request),
        rises=False,
        realtime=True,
        max_speed=np.inf,
        approach_speed=100.0,
        fallen_tilt=0.8,
    )


def has_ended(pid: int) -> bool:
    """Return whether a process has ended, and at most its parent has not noticed."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except FileNotFoundError:
        return True


def wait_until(holds: Callable[[], bool], longest: float = 120.0) -> None:
    """Wait until something holds; fail if it never does."""
    end = time.monotonic() + longest
    while not holds():
        assert time.monotonic() < end, f"never within {longest:g} s"
        time.sleep(0.01)


@pytest.fixture
def fork() -> Iterator[Callable[[Callable[[], object]], int]]:
    """Fork children that do something, then sleep; they are killed after the test."""
    children: list[int] = []

    def run(work: Callable[[], object]) -> int:
        if (child := os.fork()) == 0:
            work()
            while True:
                signal.pause()
        children.append(child)
        return child

    yield run
    for child in children:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


@pytest.fixture
def client() -> Iterator[RobotClient]:
    client = RobotClient(make_setup())
    yield client
    client.close()


def test_the_robot_ends_although_a_forked_child_holds_the_connection(client: RobotClient, fork):
    client.act({"head_pan": 0.1})
    fork(lambda: None)
    client.close()
    assert client.returncode == 0, "it ended by itself, and was not killed"


def test_a_forked_child_that_closes_it_leaves_the_robot_to_its_parent(client: RobotClient, fork):
    reading, writing = os.pipe()
    fork(lambda: (client.close(), os.write(writing, b"closed")))
    assert os.read(reading, 6) == b"closed"
    assert not client.act({"head_pan": 0.1}).ended
    os.close(reading)
    os.close(writing)


KILLED = """
import os, signal
from test_robot_client import RobotClient, make_setup
client = RobotClient(make_setup())
client.act({"head_pan": 0.1})
if (child := os.fork()) == 0:
    while True:
        signal.pause()
print(client.pid, child, flush=True)
signal.pause()
"""


def test_the_robot_ends_when_its_parent_is_killed_although_a_child_of_it_lives():
    path = os.pathsep.join([*sys.path, str(Path(__file__).parent)])
    program = subprocess.Popen(
        [sys.executable, "-c", KILLED],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert program.stdout is not None
    robot, child = map(int, program.stdout.readline().split())
    try:
        assert not has_ended(robot)
        program.kill()
        program.wait()
        wait_until(lambda: has_ended(robot))
        assert not has_ended(child)
    finally:
        os.kill(child, signal.SIGKILL)
        program.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_signal_to_the_robots_process_switches_torque_off(number: signal.Signals):
    tiny = load_robot(TINY)
    with RealTimeRobot(Simulation(tiny), powered=True) as served:
        served.place(tiny.standing)
        client = RobotClient(
            make_setup(robot=str(TINY), backend="dynamixel", port=(served.paths["main"],))
        )
        motors = served.physics.motors
        with contextlib.closing(client):
            client.act({tiny.joint_names[0]: 0.1})
            wait_until(lambda: all(motor.motor_command().torque_on for motor in motors))
            os.kill(client.pid, number)
            wait_until(lambda: client.returncode is not None)
            assert client.returncode == 0
            assert not any(motor.motor_command().torque_on for motor in motors)


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("how", ["interrupted", "late"])
def test_after_a_call_without_its_reply_later_ones_are_refused_and_torque_goes_off(
    how: str, client: RobotClient, monkeypatch: pytest.MonkeyPatch
):
    """The old reply would be taken for that to the next message."""
    os.kill(client.pid, signal.SIGSTOP)
    if how == "late":
        monkeypatch.setattr(robot_client, "LONGEST_REPLY", 0.2)
        with pytest.raises(RobotUnreachableError, match=r"does not answer within 0.2 s"):
            client.act({"head_pan": 0.1})
    else:
        before = signal.signal(signal.SIGALRM, interrupt)
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            client.act({"head_pan": 0.1})
        signal.signal(signal.SIGALRM, before)
    os.kill(client.pid, signal.SIGCONT)
    for call in (client.observe, lambda: client.act({"head_pan": 0.2})):
        with pytest.raises(RobotUnreachableError, match="was closed, which switches torque off"):
            call()
    wait_until(lambda: client.returncode == 0)


def test_an_unexpected_error_as_it_opens_is_named():
    with pytest.raises(RobotUnreachableError, match="unexpected TypeError: can't multiply"):
        RobotClient(replace(make_setup(), max_speed=cast(float, "fast")))


def test_an_unexpected_error_as_it_obeys_is_named(client: RobotClient):
    for use in (lambda: client.act({"no_joint": 1.0}), client.observe):
        with pytest.raises(RobotUnreachableError, match="has stopped: unexpected KeyError"):
            use()
        assert client.returncode is None, "it stays to say why"


def test_a_robot_that_was_asked_to_end_says_so(client: RobotClient):
    os.kill(client.pid, signal.SIGTERM)
    wait_until(lambda: client.returncode is not None)
    with pytest.raises(RobotUnreachableError, match="was asked to end: torque is off"):
        client.observe()


@pytest.mark.parametrize("is_real", [False, True])
def test_a_process_that_was_killed_leaves_servos_to_themselves(
    is_real: bool, client: RobotClient, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(client, "_is_real", is_real)
    os.kill(client.pid, signal.SIGKILL)
    with pytest.raises(RobotUnreachableError, match="has ended") as refused:
        client.observe()
    assert ("others hold" in str(refused.value)) == is_real
