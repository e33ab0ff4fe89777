"""Startup: what is refused before a port opens, how long it waits, and what it measures."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from memory_rig import Rig

from drivers import serial_port
from drivers.dynamixel import startup
from drivers.dynamixel.diagnostics import DiagnosticsError
from drivers.dynamixel.protocol2 import Instruction
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.startup import (
    BOOT_MARGIN,
    BOOT_TIME,
    FIRST_READS,
    await_servos,
    check_description,
    check_period,
    diagnose_robot,
    measure_once,
)
from drivers.errors import SetupError
from robots import Robot
from robots.bench import make_bench_joint
from robots.description.servo_catalog import servo_models


def test_a_description_fits_its_ports_and_its_imu_or_is_refused(tiny: Robot):
    assert check_description(tiny, {"main": "/dev/a"}, without_imu=False) is tiny.bus
    with pytest.raises(SetupError):
        check_description(replace(tiny, bus=None), {}, without_imu=False)
    with pytest.raises(SetupError, match=r"has an IMU \(board\), expected a robot without one"):
        check_description(tiny, {"main": "/dev/a"}, without_imu=True)
    bare = replace(tiny, bus=replace(tiny.bus, board=None), imu=None)
    with pytest.raises(SetupError, match=r"has no IMU: add an \[imu\] table"):
        check_description(bare, {"main": "/dev/a"}, without_imu=False)
    assert check_description(bare, {"main": "/dev/a"}, without_imu=True) is bare.bus
    for ports in ({}, {"other": "/dev/a"}, {"main": "/dev/a", "imu": "/dev/b"}):
        with pytest.raises(SetupError, match="has the ports main; devices were named for"):
            check_description(tiny, ports, without_imu=False)


class BootingBus:
    """A bus whose servos reply to so many pings later; a ping takes its margin."""

    answer_margin = 0.004

    def __init__(self, silent_pings: dict[int, float]) -> None:
        self.silent, self.now, self.pinged = dict(silent_pings), 0.0, []

    def ping(self, device: int) -> bool:
        self.pinged.append(device)
        self.now += self.answer_margin
        self.silent[device] -= 1
        return self.silent[device] < 0


def await_on(bus: BootingBus, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(startup, "time", SimpleNamespace(monotonic=lambda: bus.now))
    joints = [SimpleNamespace(servo=SimpleNamespace(id=device)) for device in bus.silent]
    await_servos([(bus, joint) for joint in joints])


def test_the_wait_for_servos_ends_with_the_last_of_them(monkeypatch: pytest.MonkeyPatch):
    bus = BootingBus({1: 0, 2: 3, 3: 1})
    await_on(bus, monkeypatch)
    assert bus.pinged == [1, 2, 3, 2, 3, 2, 2]
    assert bus.now == pytest.approx(7 * BOOT_MARGIN)
    assert bus.answer_margin == 0.004
    bus = BootingBus({1: 0, 2: np.inf})
    await_on(bus, monkeypatch)
    assert BOOT_TIME <= bus.now <= BOOT_TIME + 2 * BOOT_MARGIN


def test_a_bus_that_is_too_slow_for_the_control_period_is_an_error(tiny: Robot):
    rig = Rig(tiny)
    for chain in rig.backend.chains:
        chain.bus.port.open()
    period = 1e-4
    findings = diagnose_robot(tiny, rig.backend.chains, rig.backend.imu, period).errors
    assert ["on the wire, expected 0.1 ms" in finding.text for finding in findings] == [True]


def test_a_joint_or_imu_that_is_never_measured_is_named(tiny: Robot):
    rig = Rig(tiny)
    groups = (Instruction.FAST_SYNC_READ, Instruction.SYNC_READ)
    rig.port.spoil = lambda packet, replies: [] if packet.instruction in groups else replies
    with pytest.raises(DiagnosticsError, match="set up, but silent when its position is read"):
        rig.backend.connect()
    assert sum(packet.instruction in groups for packet in rig.port.sent) >= FIRST_READS // 2
    assert not rig.port.is_open
    rig.port.spoil = lambda _, replies: replies
    with rig:
        chains, states = rig.backend.chains, ServoStates(tiny, tiny.control_period)
        mute = SimpleNamespace(name="IMU X", measure=lambda: None)
        with pytest.raises(DiagnosticsError, match=r"^IMU X: its IMU cannot be read"):
            measure_once(chains, mute, states, 0.0)
        assert measure_once(chains, None, states, 0.0) is None
        assert np.isfinite(states.stamp).all()


@pytest.mark.parametrize("timer", [1, None], ids=["timer of 1 ms", "unknown: a USB frame"])
@pytest.mark.parametrize(("model", "refused"), [("AX-12A", True), ("XL430-W250", False)])
def test_single_reads_that_wait_for_the_adapter_need_a_longer_period(
    model: str, refused: bool, timer: int | None, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(serial_port, "read_latency_timer", lambda _: timer)
    port = SimpleNamespace(path="main", baud=1_000_000)
    bus = SimpleNamespace(port=port, byte_time=10 / port.baud)
    joints = [make_bench_joint(servo_models()[model], i) for i in range(1, 9)]
    found = check_period(bus, joints, 0.008)
    # 94 + 8 * 26 bytes of 10 µs, and 8 reads and the one in the background of 1 ms each.
    assert [str(finding) for finding in found] == [
        "port main: a cycle takes 3.0 ms on the wire and waits 9.0 ms for the adapter, for its "
        "servos are read one by one: expected at most 6.0 ms of a period of 8.0 ms; "
        "set control_period in robot.toml to 0.022"
    ] * refused
    assert check_period(bus, joints, 0.022) == []
