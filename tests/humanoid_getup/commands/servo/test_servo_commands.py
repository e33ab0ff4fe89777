"""`getup servo`: registers, ids, ranges and a servo that moves, at the virtual bus."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from bus_stories import Served, run_json
from desk import BAUD, make_desk, opening, serving_desk

from drivers.dynamixel import bus as bus_module
from drivers.service import loose_servo
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.served_robot import serve_robot
from drivers.virtual_bus.serving.server import TimeMode
from humanoid_getup.commands.main import main
from humanoid_getup.commands.servo.devices import Gauge, list_cells

MOVING = make_desk((1, "XL430-W250"), (3, "XM430-W350"), baud=57_600)


@pytest.fixture
def desk(monkeypatch) -> Iterator[Served]:
    monkeypatch.setattr(bus_module, "PING_SLOT", 0.001)  # replies come at once in lock-step
    with serving_desk() as served:
        yield served


class Person:
    """A person who answers at the terminal."""

    def __init__(self, *answers: str) -> None:
        self.answers = list(answers)

    def isatty(self) -> bool:
        return True

    def readline(self) -> str:
        return f"{self.answers.pop(0)}\n" if self.answers else ""


def port(served: Served) -> tuple[str, ...]:
    return ("--port", served.path, "--baud", str(BAUD))


# Registers --------------------------------------------------------------------------------------


def test_registers_are_read_in_counts_and_units(desk, capsys):
    desk.place(servo_3=90.0)
    names = ("present_position", "temperature_limit")
    code, read = run_json("servo", "read", *names, "--id", "3", *port(desk), capsys=capsys)
    assert code == 0
    assert read["present_position"]["value"] == 3072
    assert read["present_position"]["si"] == pytest.approx(1.570796), "as +90° of servo list"
    limit = {"address": 31, "size": 1, "value": 80, "si": 80.0, "unit": "°C"}
    assert read["temperature_limit"] == limit | {"lower": 0, "upper": 100, "is_kept": True}
    code, table = run_json("servo", "table", "--id", "3", *port(desk), capsys=capsys)
    assert (code, len(table) > 50) == (0, True)
    assert table["temperature_limit"] == read["temperature_limit"]


def test_what_is_kept_without_power_is_written_after_a_yes_only(desk, capsys, monkeypatch):
    line = ("servo", "write", "temperature_limit=70", "--id", "1", *port(desk))
    monkeypatch.setattr(sys, "stdin", Person("no"))
    assert main(line) == 1
    assert desk.peek("temperature_limit")[0] == 72
    monkeypatch.setattr(sys, "stdin", Person("yes"))
    assert main(line) == 0
    assert desk.peek("temperature_limit")[0] == 70
    assert "keeps temperature_limit without power: write?" in capsys.readouterr().out


def test_without_a_terminal_nothing_is_written_unless_yes_is_said_before(desk, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)
    line = ("servo", "id", "9", "--id", "1", *port(desk))
    assert main(line) == 2
    told = "standard input is not a terminal: it cannot ask (or use --yes)"
    assert told in capsys.readouterr().err
    assert desk.peek("id") == [1, 3]
    values = ("temperature_limit=70", "shutdown=99")
    assert main(("servo", "write", *values, "--id", "1", *port(desk), "--yes")) == 2
    assert "shutdown is 99, expected 0 to 63" in capsys.readouterr().err
    assert desk.peek("temperature_limit")[0] == 72, "one wrong value of several writes none"
    assert main((*line, "--yes")) == 0
    assert desk.peek("id") == [9, 3]


def test_a_servo_is_restarted_and_reset(desk):
    desk.poke("servo_3", "hardware_error_status", 32)
    assert main(("servo", "reboot", "--id", "3", *port(desk))) == 0
    assert desk.peek("hardware_error_status") == [0, 0]
    desk.poke("servo_3", "temperature_limit", 70)
    assert main(("servo", "reset", "--id", "3", *port(desk), "--yes")) == 0
    assert desk.peek("temperature_limit")[1] == 80
    assert desk.peek("id") == [1, 3]


def test_a_monitored_range_is_saved_and_nothing_is_changed(desk, tmp_path: Path):
    before = desk.peek("torque_enable"), desk.peek("return_delay_time")
    desk.place(servo_1=-90.0)
    saved = tmp_path / "ranges.json"
    line = ("servo", "monitor", *port(desk), "--seconds", "0.2", "--json", str(saved))
    assert main(line) == 0
    ranges = json.loads(saved.read_text())
    assert ranges["1"]["range_min"] == ranges["1"]["range_max"] == 1024
    assert (desk.peek("torque_enable"), desk.peek("return_delay_time")) == before


def test_an_adapter_unplugged_while_servos_are_watched_is_a_hardware_fault(
    desk, capsys, monkeypatch
):
    read = Gauge.read

    def read_and_unplug(gauge: Gauge) -> None:
        read(gauge)
        desk.unplug()

    monkeypatch.setattr(Gauge, "read", read_and_unplug)
    assert main(("servo", "monitor", *port(desk), "--seconds", "60")) == 3
    assert "lost; is the adapter still plugged in?" in capsys.readouterr().err


def test_a_gauge_keeps_the_range_and_the_last_values_of_a_servo_that_falls_silent(desk):
    with opening(desk) as bus:
        gauge, other = (Gauge(servo) for servo in loose_servo.find_servos(bus, (BAUD,)))
        for angle in (0.0, 30.0, -60.0, 10.0):
            desk.place(servo_1=angle)
            gauge.read()
        desk.virtual.servos[0].powered = False
        gauge.read()
        other.read()
    assert gauge.seen == (1365, 2389)
    assert (gauge.is_silent, other.is_silent) == (True, False)
    assert list_cells(gauge.servo.table, gauge.values)[:7] == [
        "position", "off", "+10.0", "+0", "0%", "11.1", "25",
    ]  # fmt: skip
    assert list_cells(other.servo.table, other.values)[4] == "0.00 A", "it has a current sensor"
    assert list_cells(other.servo.table, {}) == ["-"] * 7 + [""]
    error = {"torque_enable": 1, "hardware_error_status": 32}
    assert list_cells(other.servo.table, error)[1::6] == ["[bold red]on[/]", "[red]overload[/]"]


# With a person ----------------------------------------------------------------------------------


def test_a_robot_is_set_up_one_servo_after_the_other(tmp_path: Path, capsys, monkeypatch):
    (tmp_path / "robot.toml").write_text(
        'name = "arm"\n[bus]\nbaud = 2_000_000\n'
        '[[bench]]\nid = 4\nservo = "XL430-W250"\n[[bench]]\nid = 5\nservo = "XM430-W350"\n'
    )
    with serving_desk((1, "XM430-W350"), baud=57_600) as served:
        (servo,) = served.virtual.servos
        monkeypatch.setattr(sys, "stdin", Person("", "", "q"))
        line = ("servo", "setup", "--robot", str(tmp_path), "--port", served.path)
        assert main(line) == 1  # the second servo is never connected
        out = " ".join(capsys.readouterr().out.split())
        assert "1 of 2: connect only joint 'servo_5' (id 5), XM430-W350" in out
        assert "joint 'servo_5' (id 5): set up at 2000000 bit/s; was id 1 at 57600 bit/s" in out
        assert "is on the bus, expected a XL430-W250 for joint 'servo_4' (id 4)" in out
        assert "left: servo_4; go on with --joint servo_4" in out
        assert (servo.peek("id"), servo.peek("baud_rate")) == (5, 4)
        monkeypatch.setattr(sys, "stdin", Person(""))
        assert main((*line, "--joint", "servo_5")) == 0
        assert "was set up already" in capsys.readouterr().out


def test_of_several_ports_each_servo_is_set_up_on_its_own(tmp_path, monkeypatch, capsys):
    (tmp_path / "robot.toml").write_text(
        'name = "pair"\nbench = [{ id = 4, servo = "XL430-W250" }, '
        '{ id = 5, servo = "XM430-W350" }]\n[bus]\nbaud = 1_000_000\n'
        '[bus.ports]\nleft = ["servo_4"]\nright = ["servo_5"]\n'
    )
    line = ("servo", "setup", "--robot", str(tmp_path), "--port")
    with serving_desk((1, "XL430-W250")) as left, serving_desk((1, "XM430-W350")) as right:
        make_port = {each.path: each.make_port for each in (left, right)}
        monkeypatch.setattr(sys, "stdin", Person("", ""))
        with monkeypatch.context() as patch:
            patch.setattr(loose_servo, "SerialPort", lambda path, *b: make_port[path](path, *b))
            assert main((*line, f"left={left.path},right={right.path}")) == 0
        assert [served.peek("id") for served in (left, right)] == [[4], [5]]
    assert "set up: 2 servos" in capsys.readouterr().out
    assert main((*line, "left=/tmp/a,/tmp/b")) == 2
    assert "expected for robot 'pair': --port left=PATH --port right=PATH" in (
        capsys.readouterr().err
    )


# Motion -----------------------------------------------------------------------------------------


@pytest.mark.realtime
def test_a_servo_moves_to_an_angle_and_back_and_is_limp_afterwards(capsys):
    with serve_robot(Simulation(MOVING), time_mode=TimeMode.REAL_TIME) as served:
        served.place(MOVING.standing)
        where = ("--port", served.paths["main"], "--id", "3", "--speed", "120", "--hold", "0")
        code, there = run_json("servo", "move", "--to", "-20", *where, "--yes", capsys=capsys)
        assert code == 0
        assert there["reached_deg"] == pytest.approx(-20.0, abs=3.0)
        assert not there["current_is_estimated"]
        code, back = run_json("servo", "move", "--by", "20", *where, "--yes", capsys=capsys)
        assert code == 0
        assert back["start_deg"] == pytest.approx(-20.0, abs=3.0)
        assert back["reached_deg"] == pytest.approx(0.0, abs=4.0)
        code, torque = run_json("servo", "read", "torque_enable", *where[:4], capsys=capsys)
        assert torque["torque_enable"]["value"] == 0


def test_a_wrong_target_or_supply_is_found_before_anything_is_asked(desk, capsys, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)  # a question would be refused
    assert main(("servo", "move", "--to", "300", "--id", "3", *port(desk))) == 2
    assert "target is +300.0°, expected -180.0° to +179.9°" in capsys.readouterr().err
    desk.poke("servo_3", "min_voltage_limit", 130)
    assert main(("servo", "move", "--by", "5", "--id", "3", *port(desk))) == 3
    error = capsys.readouterr().err
    assert "supply is 11.1 V, expected 13.0 to 14.8 V; charge or change the supply" in error
