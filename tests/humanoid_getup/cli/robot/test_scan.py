"""`getup scan`: who answers on a port, whatever hangs there."""

import json
import os
import pty
import re

import pytest
from bus_stories import TINY, run_json, serving

from drivers.dynamixel import bus
from drivers.serial_port import SerialPort
from drivers.service import scan
from drivers.service.scan import PortFacts, scan_port
from drivers.virtual_bus.devices.servo import VirtualServo
from humanoid_getup.cli.main import main
from humanoid_getup.cli.robot import scan as command

MEGABIT = ("--baud", "1000000")


@pytest.fixture(autouse=True)
def short_slots(monkeypatch):
    """In lock-step answers to a ping of all come at once: there is no need to wait for 253."""
    monkeypatch.setattr(bus, "PING_SLOT", 0.001)


@pytest.fixture(scope="module")
def tiny():
    with serving(TINY) as served:
        served.place(l_hip=20.0)
        yield served


def look(port: str, capsys, *options: str) -> tuple[int, dict]:
    return run_json("scan", "--port", port, *options, capsys=capsys)


def test_each_device_that_answers_is_listed_with_model_and_firmware(tiny, capsys):
    code, message = look(tiny.path, capsys, *MEGABIT)
    assert code == 0
    (scan,) = message["scans"]
    assert [d["id"] for d in scan["found"]] == [1, 2, 200]
    assert [d["model"] for d in scan["found"]] == ["XM430-W350", "XM430-W350", "OpenCR"]
    assert [d["firmware"] for d in scan["found"]] == [46, 46, 1]
    assert {d["baud"] for d in scan["found"]} == {1_000_000}
    assert scan["found"][0]["voltage"] == pytest.approx(12.0)
    assert scan["found"][0]["temperature"] == 25.0
    assert not any(d["doubled"] for d in scan["found"])


def test_a_person_sees_a_table(tiny, capsys):
    assert main(("scan", "--port", tiny.path, *MEGABIT)) == 0
    out = capsys.readouterr().out
    assert "3 devices at 1000000 bit/s" in out
    assert re.search(r"2 +1000000 +XM430-W350 +46 +12.0 +25", out)


def test_devices_at_several_speeds_are_found_in_one_scan(tiny):
    found = []
    port = SerialPort(tiny.path, 57_600)
    tiny.poke("r_hip", "baud_rate", 4)  # 2 Mbit/s
    try:
        found = scan_port(port, (1_000_000, 2_000_000)).found
    finally:
        tiny.poke("r_hip", "baud_rate", 3)
    assert [(d.id, d.baud) for d in found] == [(1, 1_000_000), (200, 1_000_000), (2, 2_000_000)]
    assert not port.is_open


def test_at_a_wrong_speed_no_device_answers_and_the_advice_says_what_to_check(tiny, capsys):
    code, message = look(tiny.path, capsys, "--baud", "4000000")
    assert code == 3
    assert message["scans"][0]["found"] == []
    for words in ("power switch", "cable", "--all-bauds"):
        assert words in message["advice"]


def test_two_servos_of_one_id_are_named(capsys):
    double = VirtualServo(1, baud=1_000_000)
    with serving(TINY) as served:
        served.add(double)
        code = main(("scan", "--port", served.path, *MEGABIT))
    out = capsys.readouterr().out
    assert code == 0
    assert "id 1 at 1000000 bit/s: replies are garbled, as by two devices of one id" in out
    assert "id 2 at" not in out and "id 200 at" not in out


def test_an_adapter_that_gives_back_what_was_sent_doubles_no_device(tiny):
    class Echoing(SerialPort):
        """Hands over what was sent before what came."""

        echo = b""

        def write(self, data: bytes) -> None:
            self.echo += data
            super().write(data)

        def read(self, deadline: float) -> bytes:
            echo, self.echo = self.echo, b""
            return echo or super().read(deadline)

    found = scan_port(Echoing(tiny.path, 1_000_000), (1_000_000,)).found
    assert [(d.id, d.doubled) for d in found] == [(1, False), (2, False), (200, False)]


def test_servos_without_power_are_explained_where_their_board_answers(capsys):
    with serving(TINY, powered=False) as served:
        code, message = look(served.path, capsys, *MEGABIT)
    assert code == 0
    assert [d["id"] for d in message["scans"][0]["found"]] == [200]
    assert "only a board answers" in message["advice"]


def test_scanning_changes_nothing(tiny, capsys):
    writable = [item.name for item in tiny.virtual.servos[0].table if item.writable]
    before = {name: tiny.peek(name) for name in writable}
    look(tiny.path, capsys, *MEGABIT)
    assert {name: tiny.peek(name) for name in writable} == before


# Ports ---------------------------------------------------------------------------------------


def facts(path: str, is_adapter: bool = True) -> PortFacts:
    return PortFacts(path=path, description="a port", latency_timer=16, is_adapter=is_adapter)


def test_without_a_port_every_adapter_is_asked_and_one_that_refuses_stops_nothing(
    tiny, capsys, monkeypatch
):
    ports = (facts("/dev/gone"), facts("/dev/ttyS0", is_adapter=False), facts(tiny.path))
    monkeypatch.setattr(command, "list_serial_ports", lambda: ports)
    assert main(("scan", *MEGABIT)) == 0
    out = capsys.readouterr().out
    assert "/dev/ttyS0  a port, latency timer 16 ms (not scanned: name it with --port)" in out
    assert "port /dev/gone: does not exist" in out
    assert "3 devices at 1000000 bit/s" in out


def test_a_computer_without_any_port_gets_advice(capsys, monkeypatch):
    monkeypatch.setattr(scan.list_ports, "comports", list)
    assert main(("scan",)) == 3
    assert "plug the adapter in" in capsys.readouterr().out


def refuse(capsys, *arguments: str) -> str:
    assert main(("scan", *arguments)) == 2
    out, error = capsys.readouterr()
    assert out == "" and error.startswith("getup: ") and error.count("\n") == 1
    return error


def test_a_port_that_is_missing_or_no_serial_port_is_refused_in_one_line(capsys, tmp_path):
    assert "port /dev/nowhere: does not exist" in refuse(capsys, "--port", "/dev/nowhere")
    (tmp_path / "file").write_text("no port")
    assert "is not a serial port" in refuse(capsys, "--port", str(tmp_path / "file"))


def test_a_port_that_another_program_uses_is_refused_in_one_line(capsys, tiny):
    other = SerialPort(tiny.path, 1_000_000)
    other.open()
    try:
        assert "in use by another program" in refuse(capsys, "--port", tiny.path)
    finally:
        other.close()


def test_impossible_speeds_are_refused(capsys):
    assert "baud is 12345 bit/s, expected 9600, 57600" in refuse(capsys, "--baud", "12345")
    assert "exclude each other" in refuse(capsys, "--baud", "57600", "--all-bauds")


def test_a_silent_line_is_no_crowd(capsys):
    master, slave = pty.openpty()
    try:
        code = main(("scan", "--port", os.ttyname(slave), "--baud", "4000000", "--json", "-"))
    finally:
        os.close(master)
        os.close(slave)
    assert code == 3
    assert json.loads(capsys.readouterr().out)["scans"][0]["found"] == []
