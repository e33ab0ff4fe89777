"""A virtual robot whose wire is in another process: it answers, moves, and ends with its parent."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import serial
from paths import TINY
from waiting import LONGEST_WAIT, wait_until

from drivers import Command
from drivers.dynamixel import protocol2
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.errors import DriverError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import LONGEST_CATCH_UP, RealTimeRobot
from drivers.virtual_bus.serving.fault_schedule import FaultSchedule
from drivers.virtual_bus.serving.server import PortOptions
from robots import ImuSettings, Robot
from robots.imu import IMU_PORT

BUS = [
    sys.executable,
    "-m",
    "humanoid_getup.commands.main",
    "bus",
    "--robot",
    str(TINY),
    "--powered",
]


@pytest.fixture
def served(tiny: Robot) -> Iterator[RealTimeRobot]:
    with RealTimeRobot(Simulation(tiny), powered=True) as robot:
        robot.place(tiny.standing)
        yield robot


def connect(robot: Robot, served: RealTimeRobot) -> DynamixelBackend:
    """Make a driver that waits for replies, however busy the machine is."""
    return DynamixelBackend(robot, served.paths, options=DriverOptions(answer_margin=LONGEST_WAIT))


def ping(robot: Robot, path: str) -> int:
    """Ping the first servo; return the id that answers."""
    assert robot.bus is not None
    with serial.Serial(path, robot.bus.baud, timeout=10.0) as port:
        port.write(protocol2.ping(robot.joints[0].servo.id).encode())
        return port.read(14)[4]


def test_a_client_measures_and_moves_what_is_simulated_here(tiny: Robot, served: RealTimeRobot):
    goal = tiny.standing.joint_pos + 0.2
    with connect(tiny, served) as driver:
        wait_until(lambda: driver.read().joint_pos == pytest.approx(tiny.standing.joint_pos, 0.01))

        def has_arrived() -> bool:
            driver.write(Command.position(tiny, goal))
            return driver.read().joint_pos == pytest.approx(goal, abs=0.05)

        wait_until(has_arrived)
        assert served.simulation.joint_pos == pytest.approx(goal, abs=0.06)


def test_an_answer_does_not_wait_for_physics_which_falls_behind(
    tiny: Robot, served: RealTimeRobot, monkeypatch: pytest.MonkeyPatch
):
    step, goes_on, is_stuck = served.simulation.step, threading.Event(), threading.Event()

    def stick(steps: int) -> None:
        is_stuck.set()
        goes_on.wait()
        step(steps)

    monkeypatch.setattr(served.simulation, "step", stick)
    assert is_stuck.wait(60.0)
    begun = time.monotonic()
    assert ping(tiny, served.paths["main"]) == tiny.joints[0].servo.id
    wait_until(lambda: time.monotonic() - begun > 5.0 * LONGEST_CATCH_UP)
    before = served.behind
    goes_on.set()
    wait_until(lambda: served.behind > before)
    assert served.behind >= 3.0 * LONGEST_CATCH_UP


def test_a_limp_robot_that_lies_still_is_simulated_no_further_until_torque_is_on(
    tiny: Robot, served: RealTimeRobot
):
    wait_until(lambda: served.physics.is_at_rest)
    assert served.running
    with connect(tiny, served) as driver:
        before = driver.read().time
        assert driver.read().time >= before
        driver.write(Command.position(tiny, tiny.standing.joint_pos))
        wait_until(lambda: not served.physics.is_at_rest)


def test_faults_of_a_schedule_reach_the_physics(tiny: Robot, tmp_path: Path):
    file, first = tmp_path / "faults.toml", tiny.joints[0].servo.id
    file.write_text(
        f'[[fault]]\nat = 0.0\nkind = "heat"\nid = {first}\ntemperature = 61.0\n'
        '[[fault]]\nat = 0.0\nkind = "sag"\nvoltage = 10.0\n'
    )
    schedule = FaultSchedule.from_file(file, [first])
    simulation = Simulation(tiny)
    with RealTimeRobot(simulation, options=PortOptions(schedule=schedule)) as robot:
        wait_until(lambda: simulation.temperature[0] > 50.0)
        wait_until(lambda: simulation.voltage < 10.5)
        assert robot.running


@pytest.mark.parametrize(
    "settings",
    [
        ImuSettings(kind="bno08x"),
        ImuSettings(kind="bno055", connection="i2c"),
    ],
)
def test_an_imu_on_a_line_of_its_own_measures(tiny: Robot, settings: ImuSettings):
    robot = replace(tiny, imu=settings)
    with RealTimeRobot(Simulation(robot), powered=True) as served:
        assert list(served.paths) == ["main", IMU_PORT]
        with connect(robot, served) as driver:
            wait_until(lambda: driver.read().imu_age < 0.1)


def test_a_folder_that_cannot_be_made_is_no_fault_of_the_bus(
    tiny: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    deep = os.fspath(tmp_path)
    while len(deep) < 4080:  # room for the trial of a folder for temporary files, not for a bus
        deep = f"{deep}/{'x' * min(200, 4084 - len(deep))}"
        os.mkdir(deep)  # noqa: PTH102
    monkeypatch.setenv("TMPDIR", deep)
    with RealTimeRobot(Simulation(tiny)) as robot, pytest.raises(OSError, match="too long"):
        robot.place(tiny.standing)


def test_a_wire_that_died_is_noticed(tiny: Robot, served: RealTimeRobot):
    os.kill(served.pid, signal.SIGKILL)
    wait_until(lambda: not served.running)
    with pytest.raises(DriverError, match="stopped unexpectedly"):
        served.place(tiny.standing)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_the_wire_ends_with_the_program(tmp_path: Path, how: signal.Signals):
    link = tmp_path / "port"
    with subprocess.Popen([*BUS, "--link", str(link)], stdout=subprocess.PIPE) as bus:
        assert bus.stdout is not None
        assert bus.stdout.readline() == f"{link}\n".encode()
        bus.send_signal(how)
    wait_until(lambda: not link.is_symlink())
