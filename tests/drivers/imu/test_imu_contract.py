"""What every IMU source promises, each against its own virtual sensor."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from imu_bench import KINDS, PERIOD, ImuBench

from drivers.imu.build import build_i2c_source
from drivers.imu.fusion import FROZEN_CYCLES, GRAVITY, ImuFusion
from drivers.imu.source import ImuError
from drivers.virtual_bus.virtual_robot import build_virtual_imu
from robots import ImuSettings, quaternion

pytestmark = pytest.mark.usefixtures("counted_time")
EVERY_KIND = pytest.mark.parametrize("kind", KINDS)
SERIAL = [kind for kind, settings in KINDS.items() if settings.is_serial]
CHECKED = ["described line", "BNO08x UART-RVC"]  # their messages have a checksum


@EVERY_KIND
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_integrates_to_the_orientation_of_the_body(kind: str, axis: int):
    """Half a second at up to 3 rad/s, as a rise turns its torso: within a degree and a half."""
    bench, fusion = ImuBench(KINDS[kind]), ImuFusion(PERIOD)
    fusion.start(bench.first(), bench.time)
    for k in range(60):
        rate = np.zeros(3)
        rate[axis] = 3.0 * np.sin(np.pi * k / 60)
        if (sample := bench.cycle(*rate)) is not None:
            fusion.update(sample, bench.time, speed=0.0)
    for _ in range(3):  # what is on its way arrives
        if (sample := bench.cycle()) is not None:
            fusion.update(sample, bench.time, speed=0.0)
    turned = float(quaternion.angle_between(np.array([1.0, 0, 0, 0]), bench.orientation))
    assert turned > 0.9
    assert quaternion.angle_between(fusion.orientation, bench.orientation) < np.radians(1.5)


@EVERY_KIND
@pytest.mark.parametrize("rate", [-30.0, 30.0])
def test_a_fast_turn_comes_through_whole(kind: str, rate: float):
    """30 rad/s: no torso turns faster, also not in a fall."""
    bench = ImuBench(KINDS[kind])
    bench.first()
    samples = [bench.cycle(0.0, rate, 0.0) for _ in range(6)]
    newest = [sample for sample in samples if sample is not None][-1]
    assert newest.gyro == pytest.approx([0.0, rate, 0.0], rel=0.01, abs=0.1)


@EVERY_KIND
def test_a_frozen_sensor_is_not_believed_while_joints_move(kind: str):
    bench, fusion = ImuBench(KINDS[kind]), ImuFusion(PERIOD)
    fusion.start(bench.first(), bench.time)
    bench.sensor.frozen = True
    for _ in range(4 * FROZEN_CYCLES):
        if (sample := bench.cycle(0.0, 1.0, 0.0)) is not None:
            fusion.update(sample, bench.time, speed=2.0)
    assert bench.time - fusion.stamp > 0.3, "its values age, for the guard to judge"


@pytest.mark.parametrize("kind", SERIAL)
def test_a_slow_line_delivers_its_samples_some_cycles_later(kind: str):
    """Ten bytes a cycle: a message takes from two to eight of them."""
    bench = ImuBench(KINDS[kind])
    bench.first()
    assert bench.port is not None
    bench.port.rate = 10
    samples = [sample for _ in range(40) if (sample := bench.cycle()) is not None]
    assert len(samples) >= 4
    for sample in samples:
        assert sample.accelerometer == pytest.approx([0.0, 0.0, GRAVITY], abs=0.02)
    if kind == "BNO055 on a UART":
        assert samples[-1].age == pytest.approx(2 * PERIOD), "28 bytes: two cycles after the first"


@pytest.mark.parametrize("kind", SERIAL)
def test_an_unplugged_sensor_raises_nothing_and_comes_back(kind, monkeypatch):
    monkeypatch.setattr("drivers.imu.source.REOPEN_EVERY", 0.0)
    bench = ImuBench(KINDS[kind])
    assert bench.port is not None and bench.port.is_open
    bench.first()
    bench.port.unplugged = True
    assert [bench.cycle() for _ in range(5)] == [None] * 5
    bench.port.unplugged = False
    assert bench.first().accelerometer[2] == pytest.approx(GRAVITY, abs=0.02)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in SERIAL[:2]])
def test_a_chip_that_has_restarted_is_configured_again(kind: str):
    bench = ImuBench(KINDS[kind])
    bench.first()
    if hasattr(bench.sensor, "restart"):
        bench.sensor.restart()
    assert bench.first().accelerometer[2] == pytest.approx(GRAVITY, abs=0.02)


@settings(max_examples=25, deadline=None)
@given(data=st.data())
@pytest.mark.parametrize("kind", CHECKED)
def test_a_damaged_byte_never_becomes_a_sample(kind: str, data: st.DataObject):
    """Every sample of a spoiled stream is one that the sensor measured."""
    bench = ImuBench(KINDS[kind])
    bench.first()
    assert bench.port is not None

    def spoil(message: bytes) -> bytes:
        place = data.draw(st.integers(0, len(message) - 1))
        flip = data.draw(st.integers(1, 255))
        return message[:place] + bytes([message[place] ^ flip]) + message[place + 1 :]

    bench.port.spoil = spoil
    for _ in range(6):
        if (sample := bench.cycle()) is not None:
            assert sample.accelerometer == pytest.approx([0.0, 0.0, GRAVITY], abs=0.02)
            assert sample.gyro == pytest.approx(np.zeros(3), abs=1e-3)


@settings(max_examples=25, deadline=None)
@given(junk=st.lists(st.binary(max_size=60), min_size=1, max_size=8))
@pytest.mark.parametrize("kind", SERIAL)
def test_junk_on_the_line_is_no_sample_and_no_error(kind: str, junk: list[bytes]):
    bench = ImuBench(KINDS[kind])
    bench.first()
    assert bench.port is not None
    for piece in junk:
        bench.port.spoil = lambda _, piece=piece: piece
        assert bench.cycle() is None
    bench.port.spoil = lambda message: message
    assert bench.first().accelerometer[2] == pytest.approx(GRAVITY, abs=0.02)


def test_another_chip_is_named_by_its_id_and_one_that_does_not_answer_too(monkeypatch):
    monkeypatch.setattr("drivers.imu.bno055.FIRST_SAMPLE", 0.02)
    for kind in ("bno055", "bno08x"):
        settings = ImuSettings(kind=kind, connection="i2c")
        sensor = build_virtual_imu(settings)
        sensor.alive = False
        with pytest.raises(ImuError, match=r"on virtual I2C: .*; (check|expected)"):
            build_i2c_source(settings, sensor).open()
    monkeypatch.setattr("drivers.virtual_bus.imu.bno055.IDS", bytes([0x68, 1, 2, 3]))
    for connection in ("uart", "i2c"):
        expected = r"IMU BNO055 on .* has the chip ids 68 01 02 03; expected a"
        with pytest.raises(ImuError, match=expected):
            ImuBench(ImuSettings(kind="bno055", connection=connection))
