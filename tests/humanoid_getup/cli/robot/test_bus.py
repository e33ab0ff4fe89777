"""`getup bus`: what it prints, and that a client finds the robot behind the port."""

import subprocess
import sys
from pathlib import Path

import pytest
import serial
from paths import TINY

from drivers.dynamixel import protocol2
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.cli.main import main
from humanoid_getup.cli.robot.bus import describe
from robots import Robot

ONE = {"main": "/tmp/port"}
COMMAND = [sys.executable, "-m", "humanoid_getup.cli.main", "bus", "--robot", str(TINY)]


def test_the_banner_says_how_servos_get_power(op3: Robot):
    text = describe(VirtualRobot(Simulation(op3)), ONE)
    assert "no power" in text
    assert "register 24 of the board, id 200" in text
    assert "--powered" in text
    assert "power" not in describe(VirtualRobot(Simulation(op3), powered=True), ONE)


def test_the_banner_names_several_paths_as_a_client_does(tiny: Robot):
    robot = VirtualRobot(Simulation(tiny))
    text = describe(robot, {"main": "/tmp/port", "imu": "/tmp/port-imu"})
    assert "connect with --port main=/tmp/port,imu=/tmp/port-imu" in text
    assert "--port" not in describe(robot, ONE)


@pytest.mark.parametrize("connection", ["i2c", "uart"])
def test_the_path_of_an_imu_is_printed_after_the_port(
    tmp_path: Path, own_robot: Path, connection: str
):
    file, link = own_robot / "robot.toml", tmp_path / "port"
    file.write_text(f'{file.read_text()}\n[imu]\nkind = "bno055"\nconnection = "{connection}"\n')
    command = [*COMMAND[:-1], str(own_robot), "--hold", "zero", "--link", str(link)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as bus:
        try:
            assert bus.stdout is not None
            paths = [bus.stdout.readline() for _ in range(2)]
            assert paths == [f"{link}\n", f"{link}-imu\n"]
            where = f"main={link},imu={link}-imu"
            assert main(("doctor", "--robot", str(own_robot), "--port", where)) == 0
        finally:
            bus.terminate()
    assert list(tmp_path.glob("port*")) == []


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
