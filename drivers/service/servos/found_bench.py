"""Makes a bench of the servos that reply on a port, so that they can be moved guarded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.configuration import list_eeprom_settings
from drivers.dynamixel.diagnostics import DIAGNOSED, ServoFacts, read_items
from drivers.errors import SetupError
from drivers.serial_port import read_latency_timer
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
from robots.bench import MIDDLE, ServoBench, choose_period, make_bench, make_bench_joint
from robots.description.servo_catalog import servo_models
from robots.servo import RAD_PER_TICK


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


def find_bench(path: str, ids: Sequence[int] = (), baud: int | None = None) -> FoundBench:
    """Find servos on a port; nothing is written, and the port is closed afterwards.

    Each keeps the position limits that are stored in it: they are its range.

    Args:
        path: Serial port.
        ids: Ids of the servos; none for all that reply.
        baud: Their baud rate [bit/s]; None for the first of `COMMON_RATES` at which one replies.

    Raises:
        SetupError: if the port cannot be used, or a servo does not reply, or has no range.
        ServoError: if its registers cannot be read.
    """
    with open_bus(path, COMMON_RATES[0] if baud is None else baud) as bus:
        servos = find_all(bus, ids, COMMON_RATES if baud is None else (baud,))
        found = [_examine(servo) for servo in servos]
        period = choose_period(len(found), bus.port.baud, read_latency(path))
        joints = [facts.joint for facts in found]
        bench = make_bench(joints, baud=bus.port.baud, control_period=period)
    changes = {f.joint.name: list_eeprom_settings(f, bench.limit_by) for f in found}
    return FoundBench(bench, changes)


def read_latency(path: str) -> float:
    """Return how long the adapter of a port holds back a reply [s]; 0 if that is unknown."""
    return (read_latency_timer(path) or 0) * 1e-3


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
    if servo.table.model not in servo_models():
        raise SetupError(f"{servo.name} has no figures in servos.toml: its torque is unknown")
    registers = read_items(servo.bus, servo.id, servo.table, DIAGNOSED)
    if registers is None:
        raise ServoError(f"{servo.name}: its registers cannot be read")
    joint = _make_joint(servo, registers["min_position_limit"], registers["max_position_limit"])
    return ServoFacts(joint=joint, table=servo.table, firmware=servo.firmware, registers=registers)


def _make_joint(servo: LooseServo, first: int, last: int) -> Joint:
    if first >= last:
        raise SetupError(
            f"{servo.name}: min_position_limit is {first} and max_position_limit {last}, expected "
            "a range: getup servo write"
        )
    return make_bench_joint(
        servo_models()[servo.table.model],
        servo.id,
        lower=(first - MIDDLE) * RAD_PER_TICK,
        upper=(last - MIDDLE) * RAD_PER_TICK,
        keeps_limits=True,
    )
