"""Makes a bench of the servos that reply on a port, so that they can be moved guarded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.configuration import list_eeprom_settings
from drivers.dynamixel.control_table import types_of
from drivers.dynamixel.cyclic_read import count_reads
from drivers.dynamixel.diagnostics import DIAGNOSED, ServoFacts, read_items
from drivers.errors import SetupError
from drivers.serial_port import read_latency
from drivers.service.scan import COMMON_RATES
from drivers.service.servos.loose_servo import (
    LooseServo,
    NoServoError,
    ServoError,
    find_any,
    list_present,
    open_bus,
)
from robots import Joint
from robots.bench import ServoBench, choose_period, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.servo import ServoModel


@dataclass(frozen=True)
class FoundBench:
    """Servos that reply on a port."""

    bench: ServoBench
    eeprom: Mapping[str, Mapping[str, int]]
    """Stored settings that the driver changes before it moves a servo, by servo and register."""

    def describe_eeprom(self) -> list[str]:
        """Describe the changes, one line for each servo."""
        return [
            f"{name}: {', '.join(f'{register} = {value}' for register, value in changes.items())}"
            for name, changes in self.eeprom.items()
            if changes
        ]


def find_bench(
    path: str, ids: Sequence[int] = (), baud: int | None = None, protocol: str | None = None
) -> FoundBench:
    """Find servos on a port; nothing is written, and the port is closed afterwards.

    Each keeps the position limits that are stored in it: they are its range.

    Args:
        path: Serial port.
        ids: Ids of the servos; none for all that reply.
        baud: Their baud rate [bit/s]; None for the first of `COMMON_RATES` at which one replies.
        protocol: What they speak; None for that in which they reply.

    Raises:
        SetupError: if the port cannot be used, or a servo does not reply, or has no range.
        ServoError: if its registers cannot be read.
    """
    with open_bus(path, COMMON_RATES[0] if baud is None else baud, protocol) as bus:
        servos = find_all(bus, ids, COMMON_RATES if baud is None else (baud,))
        found = [_examine(servo) for servo in servos]
        reads = count_reads([facts.table for facts in found])
        period = choose_period(len(found), bus.port.baud, read_latency(path), reads)
        joints = [facts.joint for facts in found]
        bench = make_bench(joints, baud=bus.port.baud, control_period=period)
    changes = {f.joint.name: list_eeprom_settings(f, bench.limit_by) for f in found}
    return FoundBench(bench, changes)


def find_all(bus: DynamixelBus, ids: Sequence[int], rates: Sequence[int]) -> list[LooseServo]:
    """Find the servos of some ids, or all without any; see `find_any`.

    Raises:
        NoServoError: naming those that do not reply.
    """
    if not ids:
        return find_any(bus, rates)
    find_any(bus, rates, ids[0])
    found = list_present(bus, sorted(ids))
    if missing := sorted(set(ids) - {servo.id for servo in found}):
        listed = ", ".join(map(str, missing))
        raise NoServoError(
            f"port {bus.port.path}: no servo of id {listed} replies at {bus.port.baud} bit/s; "
            "check its power and its cable, getup scan lists what replies"
        )
    return found


def _examine(servo: LooseServo) -> ServoFacts:
    """Read a servo's registers, and make a joint of it."""
    known = [servo_models()[name] for name in types_of(servo.table) if name in servo_models()]
    if not known:
        raise SetupError(f"{servo.name} has no figures in servos.toml: its torque is unknown")
    registers = read_items(servo.bus, servo.id, servo.table, DIAGNOSED)
    if registers is None:
        raise ServoError(f"{servo.name}: its registers cannot be read")
    if "hardware_error_status" not in registers:
        registers["hardware_error_status"] = 0  # each reply names errors instead
    supply = servo.table["present_input_voltage"].to_si(registers["present_input_voltage"])
    model = next((model for model in known if model.accepts_supply(supply)), known[0])
    ends = registers["min_position_limit"], registers["max_position_limit"]
    joint = _make_joint(servo, model, *ends)
    return ServoFacts(joint=joint, table=servo.table, firmware=servo.firmware, registers=registers)


def _make_joint(servo: LooseServo, model: ServoModel, first: int, last: int) -> Joint:
    if first >= last:
        raise SetupError(
            f"{servo.name}: min_position_limit is {first} and max_position_limit {last}, expected "
            "a range: getup servo write"
        )
    return make_bench_joint(
        model,
        servo.id,
        lower=(first - model.middle_tick) * model.rad_per_tick,
        upper=(last - model.middle_tick) * model.rad_per_tick,
        keeps_limits=True,
    )
