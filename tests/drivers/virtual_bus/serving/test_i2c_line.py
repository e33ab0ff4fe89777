"""The socket of a virtual I2C bus: where it may be, and that nothing of it is left."""

from pathlib import Path

import pytest

from drivers.socket_path import LONGEST_PATH
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.serving.i2c_line import I2cLine
from drivers.virtual_bus.serving.pseudo_terminal import PortLinkError


def make_line(link: Path | None) -> I2cLine:
    return I2cLine(VirtualBno055(), 0x28, link=link)


def test_a_socket_is_there_until_its_bus_is_closed(tmp_path: Path):
    for link in (None, tmp_path / "bus"):
        line = make_line(link)
        path = Path(line.path)
        assert path.is_socket() and link in (None, path)
        line.close()
        assert not path.exists()
        assert path.parent.exists() == (link is not None)


def test_a_socket_that_a_dead_bus_left_behind_is_replaced(tmp_path: Path):
    kept = tmp_path / "kept"
    first = make_line(tmp_path / "bus")
    (tmp_path / "bus").rename(kept)
    first.close()
    assert kept.is_socket()
    again = make_line(kept)
    again.close()
    assert not kept.exists()


def test_a_path_that_is_in_use_or_not_to_be_written_is_refused(tmp_path: Path):
    line, file = make_line(tmp_path / "bus"), tmp_path / "file"
    file.write_text("mine")
    for link in (tmp_path / "bus", file):
        with pytest.raises(PortLinkError, match="a file is there, name another path"):
            make_line(link)
    line.close()
    assert file.read_text() == "mine"
    with pytest.raises(PortLinkError, match="No such file or directory, name a path you may"):
        make_line(tmp_path / "none" / "bus")
    with pytest.raises(PortLinkError, match="File name too long, name a path"):
        make_line(tmp_path / ("x" * LONGEST_PATH))
