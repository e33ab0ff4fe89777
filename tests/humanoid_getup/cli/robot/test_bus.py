"""`getup bus`: what it prints, and that a client finds the robot behind the port."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import serial
from paths import TINY

from drivers.dynamixel import protocol2
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.cli.main import main
from humanoid_getup.cli.robot.bus import describe
from robots import ImuSettings, Robot

COMMAND = [sys.executable, "-m", "humanoid_getup.cli.main", "bus", "--robot", str(TINY)]


def test_the_banner_says_how_servos_get_power(op3: Robot):
    text = describe(VirtualRobot(Simulation(op3)))
    assert "no power" in text
    assert "register 24 of the board, id 200" in text
    assert "--powered" in text
    assert "power" not in describe(VirtualRobot(Simulation(op3), powered=True))


def test_the_banner_says_that_an_imu_on_i2c_is_not_served(tiny):
    on_i2c = replace(tiny, imu=ImuSettings(kind="bno055", connection="i2c"))
    assert "its IMU is on I2C" in describe(VirtualRobot(Simulation(on_i2c)))
    on_uart = replace(tiny, imu=ImuSettings(kind="bno055"))
    assert "I2C" not in describe(VirtualRobot(Simulation(on_uart)))


def test_a_powered_bus_answers_any_client_and_leaves_no_link(tmp_path: Path, tiny: Robot):
    link = tmp_path / "port"
    command = [*COMMAND, "--from", "supine", "--powered", "--link", str(link)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as bus:
        try:
            assert bus.stdout is not None
            assert bus.stdout.readline() == f"{link}\n".encode()
            assert tiny.bus is not None
            servo_id = tiny.joints[0].servo.id
            with serial.Serial(str(link), tiny.bus.baud, timeout=10.0) as port:
                port.write(protocol2.ping(servo_id).encode())
                assert port.read(14)[4] == servo_id
        finally:
            bus.terminate()
    assert not link.is_symlink()


def test_a_link_of_another_program_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    link = tmp_path / "robot"
    link.symlink_to("/dev/null")
    assert main(("bus", "--robot", str(TINY), "--from", "supine", "--link", str(link))) == 2
    *_, line = capsys.readouterr().err.splitlines()
    assert "a link to /dev/null is there, name another path or remove it" in line
    assert link.is_symlink()
