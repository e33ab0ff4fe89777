"""Transfers on an I2C bus of Linux, as its kernel sees them; a sensor that is read in a thread."""

import errno
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from smbus2 import smbus2
from waiting import wait_until

from drivers.imu.build import BackgroundImu, build_i2c_source, build_imu_source
from drivers.imu.i2c import LinuxI2cChip
from drivers.imu.source import ImuError, ImuSample
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from robots import ImuSettings

I2C_FUNCS, I2C_RDWR, READS = 0x0705, 0x0707, 0x0001  # Linux' uapi/linux/i2c-dev.h and i2c.h


class Kernel:
    """Device files of I2C buses, and one chip at an address of the first."""

    def __init__(self) -> None:
        self.chip, self.address = VirtualBno055(), 0x28
        self.open_files = 0
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


def test_a_bus_that_is_no_i2c_bus_is_not_left_open(kernel: Kernel, monkeypatch):
    def refuse(*_: object) -> int:
        raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")

    monkeypatch.setattr(smbus2, "ioctl", refuse)
    with pytest.raises(OSError, match="Inappropriate ioctl"):
        LinuxI2cChip(1, 0x28).open()
    assert kernel.open_files == 0


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
