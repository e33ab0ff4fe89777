"""A virtual IMU's own port: what it sends by itself, what it replies, and when it is silent."""

import pytest
from fake_wire import FakeWire

from drivers.virtual_bus.serving import imu_line
from drivers.virtual_bus.serving.imu_line import ImuLine


class Parrot:
    """A sensor that replies with what it received, in capitals."""

    def receive(self, data: bytes) -> bytes:
        return data.upper()

    def take(self) -> bytes:
        return b"sample;"

    def repeat(self) -> bytes:
        return b"again;"


class QuietWire(FakeWire):
    unread = 0

    def plug(self) -> None:
        self.plugged = True

    def unplug(self) -> None:
        self.plugged = False


@pytest.fixture
def wire(monkeypatch: pytest.MonkeyPatch) -> QuietWire:
    wire = QuietWire()
    monkeypatch.setattr(imu_line, "PseudoTerminal", lambda _: wire)
    return wire


def make_line(*, repeats: bool = True) -> ImuLine:
    return ImuLine(Parrot(), link=None, repeats=repeats)


def test_replies_and_samples_reach_the_client(wire: QuietWire):
    line = make_line()
    wire.send_at(wire.now, b"id?")
    wire.wait(line.fileno(), 0.0)
    line.serve()
    line.pass_on()
    assert wire.data == b"ID?sample;"


def test_while_time_stands_still_a_sensor_repeats_itself_for_a_client_that_reads(wire: QuietWire):
    line = make_line()
    line.idle()
    wire.unread = 6
    line.idle()
    wire.unread = 0
    line.idle()
    assert wire.data == b"again;again;"


def test_where_time_passes_nothing_is_repeated(wire: QuietWire):
    make_line(repeats=False).idle()
    assert wire.data == b""


def test_an_unplugged_sensor_says_nothing(wire: QuietWire):
    line = make_line()
    line.unplug()
    assert line.fileno() == -1
    line.idle()
    line.pass_on()
    assert wire.data == b""
    line.plug()
    line.pass_on()
    assert wire.data == b"sample;"
