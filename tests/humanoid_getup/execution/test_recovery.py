"""Faults of the bus in the middle of a rise, and what the attempt manager makes of them."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from fault_injector import FaultInjector
from stored_plans import MOTION, lie_at_start

from drivers import Cycle, SafetyGuard
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.state import HardwareError
from drivers.twin.simulation import Simulation
from drivers.virtual_bus.serving.server import TimeMode
from drivers.virtual_bus.virtual_ports import VirtualPorts
from drivers.virtual_bus.virtual_robot import VirtualRobot
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.execution.session import Phase, PhaseChange, Session
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.stored_motion import StoredMotion
from robots import Robot

KNEE = 13  # id of the right one
STRIKE = 60  # cycles of the first run, half a second


def rise_and_break(
    op3: Robot,
    world: World,
    strike: Callable[[FaultInjector, SafetyGuard], object],
    recover: Callable[[FaultInjector], object] = lambda _: None,
    again: Callable[[SafetyGuard], object] = lambda _: None,
) -> tuple[Rise, list[PhaseChange], VirtualRobot]:
    """Get an OP3 up on the virtual bus; something breaks half a second into the first run.

    ``recover`` is called as it recovers, ``again`` before the second run.
    """
    virtual = VirtualRobot(Simulation(world), powered=True)
    virtual.place(lie_at_start(world))
    phases: list[PhaseChange] = []
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        driver = DynamixelBackend(op3, ports.paths, clock=CycleClock())
        guard = SafetyGuard(driver)
        faults = FaultInjector(ports.main, np.random.default_rng(0))
        cycles = iter(range(10**6))

        def look(_cycle: Cycle) -> None:
            if next(cycles) == STRIKE:
                strike(faults, guard)

        def note(change: PhaseChange) -> None:
            phases.append(change)
            if change.phase is Phase.RECOVERING:
                recover(faults)
            if change.phase is Phase.PLAYING and change.attempt == 2:
                again(guard)

        session = Session(
            guard=guard,
            world=world,
            simulation=virtual.simulation,
            preflight=False,
            settle=False,
            on_phase=note,
            on_cycle=look,
        )
        manager = AttemptManager(session, StoredMotion(world, MOTION), max_attempts=2)
        rise = manager.get_up(np.random.default_rng(0))
    return rise, phases, virtual


def test_an_overload_is_rebooted_and_the_robot_rises_again(op3: Robot, world: World):
    rise, phases, virtual = rise_and_break(
        op3,
        world,
        lambda faults, _: faults.trip(KNEE, HardwareError.OVERLOAD),
        again=lambda guard: guard.stop("it rises again"),
    )
    assert rise.reason == "stopped by the operator: it rises again"
    first, _ = rise.attempts
    assert re.search("joint 'r_knee' .*overload", first.reason)
    message = [change.detail for change in phases if change.phase is Phase.RECOVERING]
    assert "rebooting joint 'r_knee', which tripped by overload" in message
    assert virtual.servos[KNEE - 1].peek("hardware_error_status") == 0


def test_a_weak_supply_ends_the_rise_and_the_next_attempt_waits_for_it(op3: Robot, world: World):
    rise, phases, _ = rise_and_break(
        op3,
        world,
        lambda faults, _: faults.sag(9.2),
        recover=lambda faults: faults.sag(12.0),
        again=lambda guard: guard.stop("it rises again"),
    )
    assert rise.reason == "stopped by the operator: it rises again"
    assert len(rise.attempts) == 2
    assert "report voltage" in rise.attempts[0].reason  # the alerts of servos are read first
    assert any("waiting, torque off: all 20 servos: supply is 9.2" in p.detail for p in phases)


def test_after_a_stop_nothing_moves_any_more(op3: Robot, world: World):
    rise, _, virtual = rise_and_break(op3, world, lambda _, guard: guard.stop("a key was pressed"))
    assert rise.status is AttemptStatus.STOPPED
    assert len(rise.attempts) == 1
    assert not any(servo.torque_on for servo in virtual.servos)


@pytest.mark.parametrize(
    ("strike", "words"),
    [
        (lambda faults, _: faults.kill(KNEE), "joint 'r_knee' since"),
        (lambda faults, _: faults.unplug(), "silent for too long"),
        (lambda faults, _: faults.sag(9.2), "supply is 9.2 V, expected 10.0"),
    ],
)
def test_what_no_rest_cures_asks_for_help(op3: Robot, world: World, strike, words: str):
    rise, _, virtual = rise_and_break(op3, world, strike)
    assert rise.status is AttemptStatus.NEEDS_HELP
    assert rise.by_fault
    assert words in rise.reason
    moving = virtual.simulation.joint_vel
    assert np.abs(moving).max() < 20.0
