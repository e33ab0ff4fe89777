"""Startup: what is refused, how long it waits, what it opens, sets and measures."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from memory_port import MemoryPort
from memory_rig import Rig
from tiny_robots import with_servos

from drivers import serial_port
from drivers.dynamixel import startup
from drivers.dynamixel.bus import FACTORY_RETURN_DELAY, DynamixelBus
from drivers.dynamixel.configuration import ServoSetup, list_eeprom_settings
from drivers.dynamixel.diagnostics import DIAGNOSED, DiagnosticsError, ServoFacts, read_items
from drivers.dynamixel.protocol2 import Instruction
from drivers.dynamixel.robot_ports import build_ports, find_imu, open_ports, using_margin
from drivers.dynamixel.servo_states import ServoStates
from drivers.dynamixel.startup import await_servos, check_description, check_period
from drivers.errors import SetupError
from drivers.imu.bno08x import Bno08xRvc
from drivers.serial_port import PortError
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.servo import VirtualServo
from robots import ImuSettings, Robot
from robots.bench import make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.imu import IMU_PORT
from robots.servo import LimitMode


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
    assert bus.now == pytest.approx(7 * startup.BOOT_MARGIN)
    assert bus.answer_margin == 0.004
    bus = BootingBus({1: 0, 2: np.inf})
    await_on(bus, monkeypatch)
    assert startup.BOOT_TIME <= bus.now <= startup.BOOT_TIME + 2 * startup.BOOT_MARGIN


def test_a_bus_that_is_too_slow_for_the_control_period_is_an_error(tiny: Robot):
    rig = Rig(tiny)
    for chain in rig.backend.chains:
        chain.bus.port.open()
    period = 1e-4
    findings = startup.diagnose_robot(tiny, rig.backend.chains, rig.backend.imu, period).errors
    assert ["on the wire, expected 0.1 ms" in finding.text for finding in findings] == [True]


def test_a_joint_or_imu_that_is_never_measured_is_named(tiny: Robot):
    rig = Rig(tiny)
    groups = (Instruction.FAST_SYNC_READ, Instruction.SYNC_READ)
    rig.port.spoil = lambda packet, replies: [] if packet.instruction in groups else replies
    with pytest.raises(DiagnosticsError, match="set up, but silent when its position is read"):
        rig.backend.connect()
    assert sum(packet.instruction in groups for packet in rig.port.sent) >= startup.FIRST_READS // 2
    assert not rig.port.is_open
    rig.port.spoil = lambda _, replies: replies
    with rig:
        chains, states = rig.backend.chains, ServoStates(tiny, tiny.control_period)
        mute = SimpleNamespace(name="IMU X", measure=lambda: None)
        with pytest.raises(DiagnosticsError, match=r"^IMU X: its IMU cannot be read"):
            startup.measure_once(chains, mute, states, 0.0)
        assert startup.measure_once(chains, None, states, 0.0) is None
        assert np.isfinite(states.stamp).all()


@pytest.mark.parametrize("timer", [1, None], ids=["timer of 1 ms", "unknown: a USB frame"])
@pytest.mark.parametrize(("model", "refused"), [("AX-12A", True), ("XL430-W250", False)])
def test_single_reads_that_wait_for_the_adapter_need_a_longer_period(
    model, refused, timer, monkeypatch
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


# Ports of a robot --------------------------------------------------------------------------------

PATHS = {"left": "/dev/a", "right": "/dev/b", "main": "/dev/c"}


class NamedPort(MemoryPort):
    def __init__(self, path: str, baud: int) -> None:
        super().__init__(None, baud)
        self.path = path


def test_the_imu_is_the_board_a_line_of_its_own_or_none(tiny: Robot):
    ports = build_ports(tiny, PATHS, NamedPort, answer_margin=0.01)
    assert find_imu(tiny, ports, PATHS) is ports[0].board
    own = replace(tiny, imu=ImuSettings(kind="bno08x", port="/dev/described"))
    assert isinstance(find_imu(own, ports, PATHS), Bno08xRvc)
    assert find_imu(own, ports, PATHS).name.endswith("/dev/described")
    assert find_imu(own, ports, PATHS | {IMU_PORT: "/dev/named"}).name.endswith("/dev/named")
    bare = replace(tiny, bus=replace(tiny.bus, board=None), imu=None)
    assert find_imu(bare, build_ports(bare, PATHS, NamedPort, answer_margin=0.01), PATHS) is None


def test_every_port_that_does_not_open_is_named():
    buses = [DynamixelBus(NamedPort(path, 1_000_000)) for path in PATHS.values()]
    for bus in buses:
        bus.return_delay = 0.0
    buses[0].port.unplugged = True
    with pytest.raises(PortError, match=r"^port /dev/a: does not exist$"):
        open_ports(buses)
    buses[2].port.unplugged = True
    both = r"^port /dev/a: does not exist; port /dev/c: does not exist$"
    with pytest.raises(SetupError, match=both):
        open_ports(buses)
    assert buses[1].port.is_open
    assert {bus.return_delay for bus in buses} == {FACTORY_RETURN_DELAY}
    buses[0].answer_margin = 0.001
    with pytest.raises(KeyboardInterrupt), using_margin(iter(buses[:2]), 0.5):
        assert [bus.answer_margin for bus in buses[:2]] == [0.5, 0.5]
        raise KeyboardInterrupt
    assert buses[0].answer_margin == 0.001 != buses[1].answer_margin, "each its own again"


def test_servos_without_known_registers_are_refused_in_one_line(tiny: Robot):
    unknown = replace(servo_models()["STS3250-C001"], name="home-made")
    with pytest.raises(SetupError, match="has servos home-made, expected those with") as caught:
        build_ports(with_servos(tiny, {"model": unknown}), PATHS, NamedPort, answer_margin=0.01)
    assert str(caught.value).endswith("by --backend twin")


# Registers that a servo needs before it may move, set one instruction a step ---------------------

BAUD = 1_000_000
RAM = {"status_return_level": 2, "position_p_gain": 800} | dict.fromkeys(
    ("torque_enable", "bus_watchdog", "position_i_gain", "feedforward_2nd_gain",
     "feedforward_1st_gain", "profile_acceleration", "profile_velocity"), 0
)  # fmt: skip
EEPROM = {"operating_mode": 5, "max_position_limit": 4095} | dict.fromkeys(
    ("return_delay_time", "drive_mode", "min_position_limit"), 0
)


class Bench:
    def __init__(self, robot: Robot) -> None:
        self.joint = robot.joints[0]
        self.servo = VirtualServo(self.joint.servo.id, firmware=46, baud=BAUD)
        self.port = MemoryPort(Chain([self.servo]), BAUD)
        self.port.open()
        self.bus = DynamixelBus(self.port, sleeps=False)

    def facts(self) -> ServoFacts:
        registers = read_items(self.bus, self.servo.id, self.servo.table, DIAGNOSED)
        assert registers is not None
        table = self.servo.table
        return ServoFacts(joint=self.joint, table=table, firmware=46, registers=registers)

    def setup(self, by: LimitMode = "current", *, recheck: bool = False) -> ServoSetup:
        return ServoSetup(self.facts(), by, recheck=recheck)


@pytest.fixture
def bench(tiny: Robot) -> Bench:
    return Bench(tiny)


def test_whatever_was_written_before_all_registers_are_set(bench: Bench):
    for name in RAM.keys() - {"status_return_level"}:  # a lower one confirms no write
        bench.servo.poke(name, 1)
    bench.servo.poke("drive_mode", 4)
    bench.servo.poke("max_position_limit", 3000)
    setup = bench.setup()
    assert setup.run(bench.bus) and setup.done and setup.failed == ""
    found = {name: bench.servo.peek(name) for name in RAM | EEPROM}
    assert found == RAM | EEPROM
    assert setup.eeprom_writes == 4, "the lower limit was right"
    assert list_eeprom_settings(bench.facts(), "current") == {}
    again = bench.setup()
    assert again.run(bench.bus) and again.eeprom_writes == 0
    failing = bench.setup(by="pwm")
    assert failing.step(bench.bus)
    bench.servo.write(64, b"\x01")  # torque is on again: the EEPROM is locked
    assert not failing.run(bench.bus)
    assert failing.failed == "operating_mode = 4 is not confirmed (error 7)"


@pytest.mark.parametrize(
    ("item", "changed"), [("return_delay_time", 250), ("drive_mode", 4), ("operating_mode", 3)]
)
def test_a_servo_that_may_have_restarted_is_read_again_before_it_is_set_up(bench, item, changed):
    """What was known of it may be of another servo, that was changed meanwhile."""
    bench.setup().run(bench.bus)
    setup = bench.setup(recheck=True)
    bench.servo.poke(item, changed)
    assert setup.run(bench.bus) and setup.eeprom_writes == 1
    assert bench.servo.peek(item) == EEPROM[item]
    for item, value in (("model_number", 1060), ("firmware_version", 44)):
        setup, before = bench.setup(recheck=True), bench.servo.peek(item)
        bench.servo.poke(item, value)
        bench.port.sent.clear()
        assert not setup.run(bench.bus) and not setup.done, "another servo is in its place"
        assert "now, not the XM430-W350 of the start" in setup.failed
        assert bench.port.frames(Instruction.WRITE) == []
        bench.servo.poke(item, before)
