"""The port that is gone after an adapter was unplugged is its port."""

import pytest

from drivers.errors import SetupError
from drivers.service.servos import port_finder
from drivers.service.servos.port_finder import PortFinder


@pytest.fixture(autouse=True)
def _no_ports_of_this_computer(monkeypatch):
    monkeypatch.setattr(port_finder, "list_serial_ports", lambda: ())


def test_the_port_that_is_gone_is_found(tmp_path):
    ports = [tmp_path / "a", tmp_path / "b"]
    for port in ports:
        port.touch()
    finder = PortFinder(ports)
    ports[1].unlink()
    assert finder.find() == str(ports[1])


def test_none_or_two_that_are_gone_are_named(tmp_path):
    ports = [tmp_path / "a", tmp_path / "b"]
    for port in ports:
        port.touch()
    finder = PortFinder(ports)
    with pytest.raises(SetupError, match="none, expected one"):
        finder.find()
    for port in ports:
        port.unlink()
    with pytest.raises(SetupError, match=f"{ports[0]}, {ports[1]}, expected one"):
        finder.find()


def test_without_any_port_it_says_to_plug_the_adapter_in(tmp_path):
    with pytest.raises(SetupError, match="no serial port is there"):
        PortFinder([tmp_path / "none"])
