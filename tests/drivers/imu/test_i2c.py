"""Chips on an I2C bus of Linux, behind the socket of another process, and read in a thread."""

import errno
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from served_queue import Serving, serving_line
from smbus2 import smbus2
from waiting import wait_until

from drivers.errors import SetupError
from drivers.imu import i2c
from drivers.imu.build import BackgroundImu, build_i2c_source, build_imu_source, choose_chip
from drivers.imu.i2c import LONGEST_PATH, I2cChip, LinuxI2cChip, SocketI2cChip
from drivers.imu.source import ImuError, ImuSample
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.virtual_imu import ImuReading, VirtualI2cChip
from drivers.virtual_bus.serving.server import CallQueue
from drivers.virtual_bus.serving.side_lines import I2cLine
from drivers.virtual_bus.virtual_robot import build_virtual_imu
from robots import ImuSettings

I2C_FUNCS, I2C_RDWR, READS = 0x0705, 0x0707, 0x0001  # Linux' uapi/linux/i2c-dev.h and i2c.h


class Kernel:
    """Device files of I2C buses, and one chip at an address of the first."""

    def __init__(self) -> None:
        self.chip, self.address = VirtualBno055(), 0x28
        self.open_files, self.refusal = 0, None
        self.transfers: list[list[tuple[int, bool]]] = []
        """Address and direction of each message of each transfer."""

    def open(self, path: str, _flags: int) -> int:
        if path != "/dev/i2c-1":
            raise OSError(errno.ENOENT, "No such file or directory")
        self.open_files += 1
        return 77

    def close(self, file: int) -> None:
        assert file == 77
        self.open_files -= 1

    def ioctl(self, file: int, request: int, data: object) -> int:
        assert file == 77
        if self.refusal is not None:
            raise self.refusal
        if request == I2C_FUNCS:
            return 0
        assert request == I2C_RDWR
        messages = [data.msgs[i] for i in range(data.nmsgs)]  # type: ignore[attr-defined]
        self.transfers.append([(m.addr, bool(m.flags & READS)) for m in messages])
        if any(message.addr != self.address for message in messages):
            raise OSError(errno.EREMOTEIO, "Remote I/O error")
        written = b"".join(m.buf[: m.len] for m in messages if not m.flags & READS)
        count = sum(m.len for m in messages if m.flags & READS)
        reply = self.chip.transfer(written, count)
        for message in messages:
            if message.flags & READS:
                for place, byte in enumerate(reply):
                    message.buf[place] = byte
        return 0


@pytest.fixture
def kernel(monkeypatch: pytest.MonkeyPatch) -> Kernel:
    kernel = Kernel()
    files = SimpleNamespace(open=kernel.open, close=kernel.close, O_RDWR=2)
    monkeypatch.setattr(smbus2, "os", files)
    monkeypatch.setattr(smbus2, "ioctl", kernel.ioctl)
    return kernel


def test_a_register_is_read_in_one_transfer_with_a_repeated_start(kernel: Kernel):
    chip = LinuxI2cChip(1, 0x28)
    assert chip.path == "/dev/i2c-1 at 0x28"
    for _ in range(2):
        chip.open()
    assert kernel.open_files == 1
    assert chip.transfer(bytes([0x00]), 4) == bytes.fromhex("A0FB320F")
    assert chip.transfer(bytes([0x3D, 0x05])) == b""
    assert chip.transfer(bytes([0x3D]), 1) == b"\x05"
    write, read = (0x28, False), (0x28, True)
    assert kernel.transfers == [[write, read], [write], [write, read]]
    for _ in range(2):
        chip.close()
    assert kernel.open_files == 0
    with pytest.raises(OSError, match="its bus is closed"):
        chip.transfer(b"\x00", 1)
    kernel.refusal = OSError(errno.ENOTTY, "Inappropriate ioctl for device")
    with pytest.raises(OSError, match="Inappropriate ioctl"):
        chip.open()
    assert kernel.open_files == 0, "a device that is no I2C bus is closed"


@pytest.mark.parametrize("kind", ["bno055", "bno08x"])
def test_without_the_bus_or_its_package_the_source_says_what_it_needs(kind, monkeypatch):
    settings = ImuSettings(kind=kind, connection="i2c", i2c_bus=250)
    source = build_imu_source(settings, "", lambda *_: pytest.fail("no serial port is needed"))
    with pytest.raises(ImuError, match=r"on /dev/i2c-250 at 0x..: No such file or directory; chec"):
        source.open()
    monkeypatch.setitem(sys.modules, "smbus2", None)
    source = build_i2c_source(ImuSettings(kind=kind, connection="i2c"), LinuxI2cChip(1, 0x28))
    with pytest.raises(ImuError, match="I2C needs Linux and the package smbus2"):
        source.open()


class SlowSensor:
    """A source whose only transfer takes half a second of a clock that it advances itself."""

    name, note, damaged = "slow", "", 7

    def __init__(self) -> None:
        self.now = 10.0
        self.requests: list[float] = []

    def monotonic(self) -> float:
        return self.now

    def open(self) -> None: ...

    def close(self) -> None: ...

    def request(self, now: float) -> None:
        self.requests.append(now)

    def poll(self) -> ImuSample | None:
        if len(self.requests) != 1:
            return None
        self.now += 0.5
        return ImuSample(np.zeros(3), np.array([0.0, 0.0, 9.81]), counts=b"", age=0.25)


def test_a_sample_is_as_old_as_its_transfer_and_the_time_since(monkeypatch):
    sensor = SlowSensor()
    monkeypatch.setattr("drivers.imu.build.time", sensor)
    source = BackgroundImu(sensor)
    assert (source.name, source.note, source.damaged) == ("slow", "", 7)
    source.open()
    try:
        wait_until(lambda: len(sensor.requests) > 2)  # the first sample is there
        sensor.now = 12.0
        sample = source.poll()
    finally:
        source.close()
    assert sensor.requests[0] == 10.0
    assert sample is not None and sample.age == 0.25 + 12.0 - 10.0


# A chip behind a socket is the chip itself, and a lost bus a lost IMU ----------------------------

SETTINGS = {kind: ImuSettings(kind=kind, connection="i2c") for kind in ("bno055", "bno08x")}
UP = np.array([0.0, 0.0, 9.81])
TRANSFERS = st.lists(st.tuples(st.binary(max_size=40), st.integers(0, 300)), max_size=12)
SWITCH_ON = bytes.fromhex("15 00 02 00 FD 02 00 0000 88130000 00000000 00000000")  # the gyro


@pytest.fixture(autouse=True)
def _wait_for_replies_and_not_for_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A busy machine delays every reply, and brings a bus back at once."""
    monkeypatch.setattr(i2c, "TIMEOUT", 60.0)
    monkeypatch.setattr(i2c, "REOPEN_EVERY", 0.0)


def make_chip(kind: str) -> VirtualI2cChip:
    chip = build_virtual_imu(SETTINGS[kind])
    assert isinstance(chip, VirtualI2cChip)
    chip.sense(ImuReading(0.0, np.zeros(3), UP, np.array([1.0, 0.0, 0.0, 0.0])))
    return chip


@contextmanager
def serving(chip: I2cChip, kind: str, path: Path) -> Iterator[CallQueue]:
    with serving_line(I2cLine(chip, SETTINGS[kind].address, link=path)) as queue:
        yield queue


@contextmanager
def opening(kind: str, path: Path) -> Iterator[SocketI2cChip]:
    chip = SocketI2cChip(str(path), SETTINGS[kind].address)
    chip.open()
    try:
        yield chip
    finally:
        chip.close()


def transfer(chip: I2cChip, data: bytes, count: int) -> bytes | int | None:
    try:
        return chip.transfer(data, count)
    except OSError as error:
        return error.errno


@pytest.mark.parametrize("kind", SETTINGS)
@given(transfers=TRANSFERS)
def test_transfers_through_the_socket_read_what_the_chip_gives_directly(
    kind: str, tmp_path_factory: pytest.TempPathFactory, transfers: list[tuple[bytes, int]]
):
    """Whatever is written, sensible or not."""
    direct, path = make_chip(kind), tmp_path_factory.mktemp("i2c") / "bus"
    transfers = [(SWITCH_ON, 0), *transfers] if kind == "bno08x" else transfers
    with serving(make_chip(kind), kind, path), opening(kind, path) as chip:
        read = [transfer(chip, *each) for each in transfers]
    assert read == [transfer(direct, *each) for each in transfers]
    assert [len(each) for each in read if isinstance(each, bytes)] == [n for _, n in transfers]


def test_only_the_chip_acknowledges_and_only_with_power(tmp_path: Path):
    path, chip = tmp_path / "bus", make_chip("bno055")
    other = SocketI2cChip(str(path), 0x29)
    with serving(chip, "bno055", path) as queue, opening("bno055", path) as client:
        other.open()
        assert transfer(other, b"\0", 4) == errno.EREMOTEIO
        assert client.transfer(b"\0", 4) == bytes.fromhex("A0FB320F")
        queue.call(lambda: setattr(chip, "alive", False))
        assert transfer(client, b"\0", 4) == errno.EREMOTEIO
        queue.call(lambda: setattr(chip, "alive", True))
        assert client.transfer(b"\0", 4) == bytes.fromhex("A0FB320F")
        other.close()


def connect(path: Path) -> socket.socket:
    client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    client.connect(str(path))
    return client


def fill(client: socket.socket) -> None:
    client.setblocking(False)
    packet = b"\x28\xff\xff\x00"
    with pytest.raises(OSError):
        for _ in range(100_000):
            client.send(packet)


def test_clients_that_die_mutter_or_do_not_read_harm_nothing(tmp_path: Path):
    path = tmp_path / "bus"
    with serving(make_chip("bno055"), "bno055", path), opening("bno055", path) as client:
        connect(path).close()
        for packet in (b"?", b"\x28\x04\x00"):
            dying = connect(path)
            dying.send(packet)
            dying.close()
        deaf = connect(path)
        fill(deaf)
        assert client.transfer(b"\0", 4) == bytes.fromhex("A0FB320F")
        deaf.close()


def test_a_bus_that_ends_is_a_silent_imu_until_it_is_back(tmp_path: Path):
    path = tmp_path / "bus"
    source = build_i2c_source(SETTINGS["bno08x"], choose_chip(SETTINGS["bno08x"], str(path)))
    with serving(make_chip("bno08x"), "bno08x", path):
        source.open()
        assert source.measure() is not None
    for _ in range(3):
        source.request(0.0)
        assert source.poll() is None
    with serving(make_chip("bno08x"), "bno08x", path):
        wait_until(lambda: source.poll() is not None)
        source.close()
        source.close()


@pytest.mark.parametrize("kind", SETTINGS)
def test_what_is_no_bus_is_named_in_one_line(kind: str, tmp_path: Path):
    file, dead, other = (tmp_path / name for name in ("file", "dead", "other"))
    file.touch()
    gone = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    gone.bind(str(dead))
    gone.close()
    foreign = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    foreign.bind(str(other))
    foreign.listen()
    with foreign:
        for path, text in (
            (tmp_path / "none", "No such file or directory"),
            (file, "is no I2C bus"),
            (dead, "the virtual bus has ended"),
            (other, "is no I2C bus"),
            (tmp_path / ("x" * LONGEST_PATH), "File name too long"),
        ):
            source = build_i2c_source(SETTINGS[kind], choose_chip(SETTINGS[kind], str(path)))
            expected = rf"^IMU BNO0\w\w on {path} at 0x..: {text}; check .* --port imu=PATH"
            with pytest.raises(ImuError, match=expected):
                source.open()


def test_a_late_reply_is_not_taken_for_that_to_the_next_transfer(tmp_path, monkeypatch):
    monkeypatch.setattr(i2c, "TIMEOUT", 0.5)
    line = I2cLine(make_chip("bno055"), 0x28, link=tmp_path / "bus")
    stuck, chip = CallQueue(), SocketI2cChip(line.path, 0x28)
    stuck.lines.append(line)
    serving = Serving(stuck)
    chip.open()
    serving.end()
    with pytest.raises(OSError, match="the virtual bus has ended"):
        chip.transfer(b"\x3b", 1)
    monkeypatch.setattr(i2c, "TIMEOUT", 60.0)
    with serving_line(line):
        assert chip.transfer(b"\0", 4) == bytes.fromhex("A0FB320F")
        chip.close()
        with pytest.raises(OSError, match="its bus is closed"):
            chip.transfer(b"\0", 4)


def test_a_path_is_a_bus_of_linux_or_a_socket(tmp_path: Path):
    settings = SETTINGS["bno08x"]
    chosen = [choose_chip(settings, path) for path in ("", "/dev/i2c-3", str(tmp_path / "bus"))]
    assert [type(chip) for chip in chosen] == [LinuxI2cChip, LinuxI2cChip, SocketI2cChip]
    assert [chip.path for chip in chosen] == [
        "/dev/i2c-1 at 0x4A",
        "/dev/i2c-3 at 0x4A",
        f"{tmp_path / 'bus'} at 0x4A",
    ]
    (tmp_path / "link").symlink_to("/dev/null")
    assert isinstance(choose_chip(settings, str(tmp_path / "link")), LinuxI2cChip)


def test_a_path_in_use_or_not_to_be_written_is_refused_and_a_dead_one_replaced(tmp_path: Path):
    make_line = lambda link: I2cLine(make_chip("bno055"), 0x28, link=link)  # noqa: E731
    line, file, kept = make_line(tmp_path / "bus"), tmp_path / "file", tmp_path / "kept"
    file.write_text("mine")
    for link in (tmp_path / "bus", file):
        with pytest.raises(SetupError, match="a file is there, name another path"):
            make_line(link)
    line.close()
    assert file.read_text() == "mine"
    with pytest.raises(SetupError, match="No such file or directory, name a path you may"):
        make_line(tmp_path / "none" / "bus")
    with pytest.raises(SetupError, match="File name too long, name a path"):
        make_line(tmp_path / ("x" * LONGEST_PATH))
    line = make_line(tmp_path / "bus")
    (tmp_path / "bus").rename(kept)
    line.close()
    assert kept.is_socket(), "a dead bus left it behind"
    make_line(kept).close()
    assert not kept.exists()


def test_the_path_of_a_bus_may_be_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / ("x" * 200)
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    line = I2cLine(make_chip("bno055"), 0x28, link=None)
    with serving_line(line):
        assert line.path.startswith(str(folder))
        chip = SocketI2cChip(line.path, 0x28)
        chip.open()
        assert len(chip.transfer(b"\0", 1)) == 1
        chip.close()
    assert list(folder.iterdir()) == []
