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
from humanoid_getup.commands.main import main
from humanoid_getup.commands.robot import bus
from robots import Robot

ONE = {"main": "/tmp/port"}
COMMAND = [sys.executable, "-m", "humanoid_getup.commands.main", "bus", "--robot", str(TINY)]


def test_the_banner_says_how_servos_get_power_and_names_several_paths_as_a_client_does(op3: Robot):
    text = bus.describe(VirtualRobot(Simulation(op3)), ONE)
    assert "no power" in text
    assert "register 24 of the board, id 200" in text
    assert "--powered" in text
    powered = VirtualRobot(Simulation(op3), powered=True)
    assert "power" not in bus.describe(powered, ONE)
    assert "--port" not in bus.describe(powered, ONE)
    text = bus.describe(powered, ONE | {"imu": "/tmp/port-imu"})
    assert "connect with --port main=/tmp/port,imu=/tmp/port-imu" in text


@pytest.mark.parametrize("connection", ["i2c", pytest.param("uart", marks=pytest.mark.slow)])
def test_the_path_of_an_imu_is_printed_after_the_port(
    tmp_path: Path, own_robot: Path, connection: str
):
    file, link = own_robot / "robot.toml", tmp_path / "port"
    file.write_text(f'{file.read_text()}\n[imu]\nkind = "bno055"\nconnection = "{connection}"\n')
    command = [*COMMAND[:-1], str(own_robot), "--hold", "zero", "--link", str(link)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as served:
        try:
            assert served.stdout is not None
            paths = [served.stdout.readline() for _ in range(2)]
            assert paths == [f"{link}\n", f"{link}-imu\n"]
            where = f"main={link},imu={link}-imu"
            assert main(("doctor", "--robot", str(own_robot), "--port", where)) == 0
        finally:
            served.terminate()
    assert list(tmp_path.glob("port*")) == []


def test_a_powered_bus_answers_any_client_and_leaves_no_link(tmp_path: Path, tiny: Robot):
    link = tmp_path / "port"
    command = [*COMMAND, "--hold", "zero", "--powered", "--link", str(link)]
    assert tiny.bus is not None
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as served:
        try:
            assert served.stdout is not None and served.stdout.readline() == f"{link}\n"
            servo_id = tiny.joints[0].servo.id
            with serial.Serial(str(link), tiny.bus.baud, timeout=10.0) as foreign:
                foreign.write(protocol2.ping(servo_id).encode())
                assert foreign.read(14)[4] == servo_id
        finally:
            served.terminate()
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


class Late:
    """A bus that falls half a second further behind at each look, and is then interrupted."""

    def __init__(self, looks: int) -> None:
        self.looks, self.behind = looks, 0.0

    @property
    def running(self) -> bool:
        if not self.looks:
            raise KeyboardInterrupt
        self.looks -= 1
        self.behind += 0.6
        return True


def test_that_physics_is_late_is_said_once_and_at_the_end(monkeypatch, capsys):
    monkeypatch.setattr(bus, "CHECK_PERIOD", 0.0)
    bus.wait(Late(5), None)
    said = capsys.readouterr().err.splitlines()
    assert [line.split(" s behind")[0] for line in said] == [
        "getup: physics is 0.6",
        "getup: physics is 3.0",
    ]
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    bus.wait(Late(5), None)
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1, "one line, which is kept up to date"
    assert [part[:21] for part in shown.split(bus.CLEAR)[1:]] == [
        f"getup: physics is {late}" for late in ("0.6", "1.2", "1.8", "2.4", "3.0", "3.0")
    ]
    bus.wait(Late(0), None)
    assert capsys.readouterr().err == ""
