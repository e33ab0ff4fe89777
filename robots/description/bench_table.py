"""A robot.toml that lists servos on a bench instead of a body."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from robots.bench import IMU_SITE, MAX_ARM, MAX_MASS, Load, ServoBench, make_bench, make_bench_joint
from robots.bus_settings import BusSettings
from robots.description.schema import ControlPeriod, SupplyResistance, SupplyVoltage, complete_bus
from robots.imu import ImuSettings, find_imu_problems
from robots.robot import Joint
from robots.servo import MAX_TICKS, PGain, ServoModel
from robots.storage.validation import (
    Sign,
    between,
    positive,
    read_table,
    shown,
    whole,
)

BENCH = "bench"
"""Key of the servos; a robot.toml with it has no model."""


@dataclass(frozen=True, kw_only=True)
class BenchRow:
    """One servo on the bench."""

    id: Annotated[int, whole(0, 253)]
    servo: str
    """Name of the servo model."""
    name: str = ""
    """servo_ID if left out."""
    sign: Sign = 1
    zero_ticks: Annotated[int, whole(-MAX_TICKS, MAX_TICKS)] | None = None
    """The middle of the servo's positions if left out."""
    lower: Annotated[float, between(-100.0, 100.0, "rad")] | None = None
    """[rad]; the end of the servo's positions if left out."""
    upper: Annotated[float, between(-100.0, 100.0, "rad")] | None = None
    """[rad]; the other end if left out."""
    p_gain: PGain | None = None
    """Position P gain; that of the servo type if left out."""
    load_mass: Annotated[float, between(0.0, MAX_MASS, "kg")] = 0.0
    """Mass on a lever of its horn [kg]."""
    load_arm: Annotated[float, positive(MAX_ARM, "m")] = 0.1
    """Its distance from the horn [m]."""


@dataclass(frozen=True, kw_only=True)
class BenchTable:
    """The content of a robot.toml of servos on a bench."""

    name: str
    bench: Annotated[
        tuple[BenchRow, ...], Meta(description="a list of tables, one for each servo", min_length=1)
    ]
    bus: BusSettings
    control_period: ControlPeriod | None = None
    """[s]; one that suits the baud rate if left out."""
    supply_voltage: SupplyVoltage | None = None
    """[V]; the nominal one of the first servo if left out."""
    supply_resistance: SupplyResistance = 0.0
    imu: ImuSettings | None = None
    limit_by: Literal["current", "pwm"] | None = None


def load_bench(
    folder: Path, toml: dict[str, Any], servos: Mapping[str, ServoModel], wrong_servos: list[str]
) -> tuple[ServoBench | None, list[str]]:
    """Load the bench of a robot.toml; return it, or None and all problems, also of servo types."""
    problems = [*wrong_servos]
    table = read_table(BenchTable, toml, "", problems, is_strict=True)
    rows = tuple(replace(row, name=row.name or f"servo_{row.id}") for row in table.bench)
    problems += _find_problems(rows, servos, table.imu)
    bus = complete_bus(table.bus, tuple(row.name for row in rows), problems)
    if bus.board is not None:
        problems.append("bus.board is given, expected none: a bench has no board")
    if problems:
        return None, problems
    bench = make_bench(
        [_make_joint(row, servos[row.servo]) for row in rows],
        baud=bus.baud,
        loads=[Load(mass=row.load_mass, arm=row.load_arm) for row in rows],
        control_period=table.control_period,
    )
    return replace(
        bench,
        name=table.name,
        folder=folder,
        bus=bus,
        imu=table.imu,
        imu_site=None if table.imu is None else IMU_SITE,
        supply_voltage=table.supply_voltage or bench.supply_voltage,
        supply_resistance=table.supply_resistance,
        limit_by=table.limit_by or bench.limit_by,
    ), []


def _make_joint(row: BenchRow, model: ServoModel) -> Joint:
    joint = make_bench_joint(model, row.id, name=row.name, lower=row.lower, upper=row.upper)
    zero = model.middle_tick if row.zero_ticks is None else row.zero_ticks
    servo = replace(joint.servo, sign=row.sign, zero_ticks=zero, own_p_gain=row.p_gain)
    return replace(joint, servo=servo)


def _find_problems(
    rows: tuple[BenchRow, ...], servos: Mapping[str, ServoModel], imu: ImuSettings | None
) -> list[str]:
    problems = [
        f"servo {shown(row.name)}: servo is {shown(row.servo)}, expected {', '.join(servos)}"
        for row in rows
        if row.servo and row.servo not in servos
    ]
    for row in rows:
        if row.servo not in servos:
            continue
        lowest, highest = servos[row.servo].ends
        lower = lowest if row.lower is None else row.lower
        upper = highest if row.upper is None else row.upper
        if lower >= upper:
            problems.append(
                f"servo {shown(row.name)}: lower is {lower:g} rad, expected below upper, "
                f"{upper:g} rad"
            )
        if row.id > servos[row.servo].max_id:
            problems.append(
                f"servo {shown(row.name)}: id is {row.id}, expected 0 to {servos[row.servo].max_id}"
            )
    for key in ("id", "name"):
        counts = Counter(getattr(row, key) for row in rows)
        problems += [
            f"{BENCH}: {key} {shown(value)} is given {count} times, expected once"
            for value, count in counts.items()
            if count > 1
        ]
    return problems + (find_imu_problems(imu, has_board=False) if imu is not None else [])
