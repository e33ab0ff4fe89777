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
from robots import ImuSettings, Robot
from robots.imu import IMU_PORT


@pytest.fixture
def served(tiny: Robot) -> Iterator[RealTimeRobot]:
    with RealTimeRobot(Simulation(tiny), powered=True) as robot:
        robot.place(tiny.standing)
        yield robot


def connect(robot: Robot, served: RealTimeRobot) -> DynamixelBackend:
    return DynamixelBackend(robot, served.paths, options=DriverOptions(answer_margin=LONGEST_WAIT))


def test_a_client_measures_and_moves_what_is_simulated_here_and_no_further_while_it_lies_limp(
    tiny: Robot, served: RealTimeRobot
):
    wait_until(lambda: served.physics.is_at_rest)
    assert served.running
    goal = tiny.standing.joint_pos + 0.2
    with connect(tiny, served) as driver:
        before = driver.read()
        assert before.joint_pos == pytest.approx(tiny.standing.joint_pos, abs=0.01)
        assert driver.read().time >= before.time

        def has_arrived() -> bool:
            driver.write(Command.position(tiny, goal))
            return driver.read().joint_pos == pytest.approx(goal, abs=0.05)

        wait_until(has_arrived)
        assert served.simulation.joint_pos == pytest.approx(goal, abs=0.06)


def test_an_answer_does_not_wait_for_physics_which_falls_behind_and_a_dead_wire_is_noticed(
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
    assert tiny.bus is not None
    with serial.Serial(served.paths["main"], tiny.bus.baud, timeout=10.0) as port:
        port.write(protocol2.ping(2).encode())
        assert port.read(14)[4] == 2
    wait_until(lambda: time.monotonic() - begun > 5.0 * LONGEST_CATCH_UP)
    before = served.behind
    goes_on.set()
    wait_until(lambda: served.behind > before)
    assert served.behind >= 3.0 * LONGEST_CATCH_UP
    os.kill(served.pid, signal.SIGKILL)
    wait_until(lambda: not served.running)
    with pytest.raises(DriverError, match="stopped unexpectedly"):
        served.place(tiny.standing)


@pytest.mark.parametrize(
    "settings", [ImuSettings(kind="bno08x"), ImuSettings(kind="bno055", connection="i2c")]
)
def test_an_imu_on_a_line_of_its_own_measures(tiny: Robot, settings: ImuSettings):
    simulation = Simulation(robot := replace(tiny, imu=settings))
    with RealTimeRobot(simulation, powered=True) as served:
        assert list(served.paths) == ["main", IMU_PORT]
        with connect(robot, served) as driver:
            wait_until(lambda: driver.read().imu_age < 0.1)
        assert served.running


PROGRAM = f"""
import sys, time
from pathlib import Path
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import RealTimeRobot
from drivers.virtual_bus.serving.server import PortOptions
from robots import load_robot
simulation = Simulation(load_robot({str(TINY)!r}))
with RealTimeRobot(simulation, options=PortOptions(link=Path(sys.argv[1]))) as served:
    print(served.paths["main"], flush=True)
    time.sleep(60.0)
"""


@pytest.mark.parametrize(
    "how", [signal.SIGKILL, pytest.param(signal.SIGINT, marks=pytest.mark.slow)]
)
def test_the_wire_ends_with_the_program(tmp_path: Path, how: signal.Signals):
    link = tmp_path / "port"
    command = [sys.executable, "-c", PROGRAM, str(link)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == f"{link}\n".encode()
        program.send_signal(how)
    wait_until(lambda: not link.is_symlink())
