"""Fuzz the driver: replies to a robot under torque are damaged, doubled or replaced by noise.

The driver must not raise, must never command servos beyond their limits, and must report as fresh
only true encoder positions, except for damage that a 16-bit CRC misses by chance.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from drivers import Command, SafetyGuard
from drivers.dynamixel.backend import DriverOptions, DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.dynamixel.protocol2 import Packet
from drivers.servo_units import ServoUnits
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.virtual_robot import VirtualRobot
from robots import load_robot
from robots.servo import RAD_PER_TICK

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))

from memory_port import MemoryPort  # pyright: ignore[reportMissingImports]

SPOILT = (0.0, 0.02, 0.3)  # share of answers, one after the other
STRETCH = 400  # cycles with one share
SWING = 0.3  # rad about the stance


@dataclass
class DriverTally:
    """What came of fuzzing the driver."""

    bytes: int = 0
    cycles: int = 0
    spoiled: int = 0
    """Answers that were damaged."""
    faults: int = 0
    """Times that the guard let go and was cleared."""
    believed_wrong: int = 0
    """Fresh positions that were not true: collisions of the CRC, see ``expected_wrong``."""
    expected_wrong: float = 0.0
    beyond: int = 0
    """Targets outside a joint's range."""
    examples: list[str] = field(default_factory=list)

    @property
    def has_failed(self) -> bool:
        """Whether the outcome is too bad to be chance."""
        bound = self.expected_wrong + 6.0 * self.expected_wrong**0.5 + 3.0
        return self.beyond > 0 or self.believed_wrong > bound


def fuzz_driver(
    rng: random.Random, size: int, mutate: Callable[[random.Random, bytes], bytes]
) -> DriverTally:
    """Feed at least ``size`` bytes to the driver.

    Args:
        rng: Source of chance.
        size: Bytes of answers.
        mutate: Damages a frame.
    """
    robot = load_robot("op3")
    virtual = VirtualRobot(Simulation(robot), powered=True)
    port = MemoryPort(virtual.chains["main"], virtual.bus.baud, virtual.physics)
    backend = DynamixelBackend(
        robot,
        {"main": "memory"},
        clock=CycleClock(),
        options=DriverOptions(make_port=lambda _path, _baud: port),
    )
    guard, units, tally = SafetyGuard(backend), ServoUnits(robot), DriverTally()
    share = 0.0

    def spoil(_packet: Packet, answers: list[bytes]) -> list[bytes]:
        out: list[bytes] = []
        for answer in answers:
            if rng.random() < share:
                tally.spoiled += 1
                answer = mutate(rng, answer)
            out.append(answer)
        tally.bytes += sum(map(len, out))
        return out

    with guard:
        port.spoil = spoil
        while tally.bytes < size:
            if tally.cycles % STRETCH == 0:
                share = SPOILT[tally.cycles // STRETCH % len(SPOILT)]
            _turn(guard, virtual, units, tally, rng)
    # A damaged answer passes its CRC once in 65536.
    tally.expected_wrong = tally.spoiled / 65536
    return tally


def _turn(
    guard: SafetyGuard,
    virtual: VirtualRobot,
    units: ServoUnits,
    tally: DriverTally,
    rng: random.Random,
) -> None:
    """Run one cycle and compare."""
    robot = guard.robot
    before = units.quantize(virtual.simulation.joint_pos)
    state = guard.read()
    after = units.quantize(virtual.simulation.joint_pos)
    low, high = np.minimum(before, after), np.maximum(before, after)
    off = np.maximum(low - state.joint_pos, state.joint_pos - high)
    wrong = (state.joint_age == 0.0) & (off > 1.5 * RAD_PER_TICK)
    tally.believed_wrong += int(wrong.any())
    if wrong.any() and len(tally.examples) < 5:
        tally.examples.append(f"cycle {tally.cycles}: {np.flatnonzero(wrong).tolist()}")
    phase = 0.05 * tally.cycles
    swing = np.array([SWING * np.sin(phase + i) + rng.gauss(0.0, 0.01) for i in range(robot.n)])
    guard.write(Command.position(robot, robot.standing.joint_pos + swing))
    if guard.fault is not None:
        tally.faults += 1
        guard.clear()
    target = units.to_rad(np.array([round(s.motor_command().target_ticks) for s in virtual.servos]))
    driven = np.array([servo.torque_on for servo in virtual.servos])
    lower, upper = np.minimum(robot.lower, before), np.maximum(robot.upper, before)
    outside = (target < lower - RAD_PER_TICK) | (target > upper + RAD_PER_TICK)
    tally.beyond += int(np.sum(driven & outside))
    tally.cycles += 1
