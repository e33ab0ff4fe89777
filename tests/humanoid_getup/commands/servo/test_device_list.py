"""`getup servo list`: which ports there are, and who answers on them, whatever hangs there."""

import re

import pytest
from bus_stories import TINY, run_json, serving
from serial.tools.list_ports_common import ListPortInfo

from drivers.dynamixel import bus
from drivers.serial_port import SerialPort
from drivers.service import scan
from drivers.service.scan import PortFacts
from drivers.virtual_bus.devices.servo import VirtualServo
from humanoid_getup.commands.main import main
from humanoid_getup.commands.servo import devices

MEGABIT = ("--baud", "1000000")


@pytest.fixture(autouse=True)
def short_slots(monkeypatch):
    """In lock-step answers to a ping of all come at once: there is no need to wait for 253."""
    monkeypatch.setattr(bus, "PING_SLOT", 0.001)


@pytest.fixture(scope="module")
def served():
    with serving(TINY) as served:
        served.place(l_hip=20.0)
        yield served


@pytest.fixture
def tiny(served, monkeypatch):
    """A robot on a port on which nothing is waited for that does not come."""
    monkeypatch.setattr(devices, "SerialPort", served.make_port)
    return served


def look(port: str, capsys, *options: str) -> tuple[int, dict]:
    return run_json("servo", "list", "--port", port, *options, capsys=capsys)


def test_each_device_that_answers_is_listed_with_what_it_measures_and_nothing_changes(tiny, capsys):
    writable = [item.name for item in tiny.virtual.servos[0].table if item.writable]
    before = {name: tiny.peek(name) for name in writable}
    code, message = look(tiny.path, capsys, *MEGABIT)
    assert code == 0
    (scanned,) = message["scans"]
    found = scanned["found"]
    keys = ("id", "model", "firmware", "is_board", "baud", "doubled")
    assert [tuple(device[key] for key in keys) for device in found] == [
        (1, "XM430-W350", 46, False, 1_000_000, False),
        (2, "XM430-W350", 46, False, 1_000_000, False),
        (200, "OpenCR", 1, True, 1_000_000, False),
    ]
    values = found[0]["values"]
    assert values["present_input_voltage"] == pytest.approx(12.0)
    assert (values["present_temperature"], values["torque_enable"]) == (25.0, 0)
    assert {name: tiny.peek(name) for name in writable} == before
    assert main(("servo", "list", "--port", tiny.path, *MEGABIT)) == 0
    out = capsys.readouterr().out
    assert "3 devices at 1000000 bit/s" in out
    assert re.search(r"2 +1000000 +XM430-W350 +46 .* off .* 12.0 +25", out)


def test_at_a_wrong_speed_no_device_answers_and_the_advice_says_what_to_check(tiny, capsys):
    code, message = look(tiny.path, capsys, "--baud", "4000000")
    assert code == 3
    assert message["scans"][0]["found"] == []
    assert "power switch and supply, the cable" in message["advice"]


def test_two_servos_of_one_id_and_servos_without_power_are_explained(capsys, monkeypatch):
    with serving(TINY) as served:
        monkeypatch.setattr(devices, "SerialPort", served.make_port)
        served.add(VirtualServo(1, baud=1_000_000))
        code = main(("servo", "list", "--port", served.path, *MEGABIT))
    out = capsys.readouterr().out
    assert code == 0
    assert "id 1 at 1000000 bit/s: replies are garbled, as by two devices of one id" in out
    assert "id 2 at" not in out and "id 200 at" not in out
    with serving(TINY, powered=False) as served:
        monkeypatch.setattr(devices, "SerialPort", served.make_port)
        code, message = look(served.path, capsys, *MEGABIT)
    assert code == 0
    assert [d["id"] for d in message["scans"][0]["found"]] == [200]
    assert "only a board answers" in message["advice"]


# Ports ---------------------------------------------------------------------------------------


def test_without_a_port_every_adapter_is_asked_and_one_that_refuses_stops_nothing(
    served, capsys, monkeypatch
):
    ports = [
        PortFacts(path=path, description="a port", latency_timer=16, is_adapter=is_adapter)
        for path, is_adapter in (("/dev/gone", True), ("/dev/ttyS0", False), (served.path, True))
    ]
    monkeypatch.setattr(scan, "list_serial_ports", lambda: ports)
    assert main(("servo", "list", *MEGABIT)) == 0
    out = capsys.readouterr().out
    assert "/dev/ttyS0  a port, latency timer 16 ms (not scanned: name it with --port)" in out
    assert "port /dev/gone: does not exist" in out
    assert "3 devices at 1000000 bit/s" in out


def test_a_computer_without_an_adapter_gets_advice_that_fits_its_ports(capsys, monkeypatch):
    for ports, advice in (
        ([], "no serial port: plug the adapter in"),
        (["/dev/ttyS0"], "no USB adapter: plug the adapter in"),
    ):
        found = [ListPortInfo(port) for port in ports]
        monkeypatch.setattr(scan.list_ports, "comports", lambda found=found: found)
        assert main(("servo", "list")) == 3
        *named, last = capsys.readouterr().out.splitlines()
        assert [line.split()[0] for line in named] == ports
        assert advice in last


def test_a_port_or_a_speed_that_cannot_be_used_is_refused_in_one_line(capsys, tmp_path, served):
    (tmp_path / "file").write_text("no port")
    other = SerialPort(served.path, 1_000_000)
    other.open()
    try:
        for arguments, expected in (
            (("--port", "/dev/nowhere"), "port /dev/nowhere: does not exist"),
            (("--port", str(tmp_path / "file")), "is not a serial port"),
            (("--port", served.path), "in use by another program"),
            (("--baud", "12345"), "baud is 12345 bit/s, expected 9600, 57600"),
            (("--baud", "57600", "--all-bauds"), "exclude each other"),
        ):
            assert main(("servo", "list", *arguments)) == 2
            out, error = capsys.readouterr()
            assert expected in error and not out and error.count("\n") == 1
    finally:
        other.close()
