"""Registers that a servo needs before it may move, set one instruction a step."""

import pytest
from memory_port import MemoryPort

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.configuration import ServoSetup, list_eeprom_settings
from drivers.dynamixel.diagnostics import DIAGNOSED, ServoFacts, read_items
from drivers.dynamixel.protocol2 import Instruction
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.devices.servo import VirtualServo
from robots import Robot
from robots.servo import LimitMode

BAUD = 1_000_000
RAM = {
    "torque_enable": 0,
    "status_return_level": 2,
    "bus_watchdog": 0,
    "position_i_gain": 0,
    "position_p_gain": 800,
    "feedforward_2nd_gain": 0,
    "feedforward_1st_gain": 0,
    "profile_acceleration": 0,
    "profile_velocity": 0,
}
EEPROM = {
    "return_delay_time": 0,
    "drive_mode": 0,
    "operating_mode": 5,
    "max_position_limit": 4095,
    "min_position_limit": 0,
}


class Bench:
    """A servo as it left the factory, and the bus that it is on."""

    def __init__(self, robot: Robot) -> None:
        self.joint = robot.joints[0]
        self.servo = VirtualServo(self.joint.servo.id, firmware=46, baud=BAUD)
        self.port = MemoryPort(Chain([self.servo]), BAUD)
        self.port.open()
        self.bus = DynamixelBus(self.port, sleeps=False)

    def facts(self) -> ServoFacts:
        registers = read_items(self.bus, self.servo.id, self.servo.table, DIAGNOSED)
        assert registers is not None
        return ServoFacts(
            joint=self.joint, table=self.servo.table, firmware=46, registers=registers
        )

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
def test_a_servo_that_may_have_restarted_is_read_again_before_it_is_set_up(
    bench: Bench, item: str, changed: int
):
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
