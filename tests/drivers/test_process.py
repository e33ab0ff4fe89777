"""What the process does for a robot: no signal cuts off a release, and its loop goes first."""

import os
import signal
from collections.abc import Iterator
from typing import Any

import pytest
from memory_rig import Rig

from drivers.dynamixel.servo_chain import ServoChain
from drivers.interrupts import deferred_interrupts
from drivers.real_time_class import LOOP_PRIORITY, enter_real_time_class, in_real_time_class


@pytest.fixture(autouse=True)
def default_handler() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupt() -> None:
    os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_every_signal_that_ends_a_program_waits(name: str):
    """A terminal that is closed sends SIGHUP, a service that is stopped SIGTERM."""
    number, steps = signal.Signals[name], list[str]()
    before = signal.signal(number, lambda *_: steps.append("handled"))
    try:
        with deferred_interrupts():
            os.kill(os.getpid(), number)
            steps.append("block")
    finally:
        signal.signal(number, before)
    assert steps == ["block", "handled"]


def test_an_interrupt_is_raised_after_the_block_and_hides_no_error_of_it():
    with pytest.raises(KeyboardInterrupt), deferred_interrupts():
        interrupt()
    with pytest.raises(KeyboardInterrupt):
        interrupt()
    with pytest.raises(ValueError, match="mine"), deferred_interrupts():
        interrupt()
        raise ValueError("mine")


@pytest.mark.parametrize("method", ["release", "disarm"])
def test_a_robot_is_released_completely(tiny, monkeypatch, method):
    """Interrupted at the first chain, of its release or of a hand-over: every port is closed."""
    original = getattr(ServoChain, method)

    def interrupted(self: ServoChain, *args):
        interrupt()
        return original(self, *args)

    with Rig(tiny) as rig:
        rig.turn(cycles=4)
        assert rig.peek("torque_enable") == [1, 1]
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(ServoChain, method, interrupted)
            if method == "disarm":
                rig.backend.hand_over()
            rig.backend.close()
        rig.backend.close()
        assert rig.peek("torque_enable") == rig.peek("bus_watchdog") == [0, 0]
        assert not rig.port.is_open


# The real-time class: entered where it is permitted, left afterwards, not handed on --------------


def find_class() -> int:
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


@pytest.fixture
def permitted() -> None:
    with in_real_time_class() as is_in:
        if not is_in:
            pytest.skip("the system does not permit this user the real-time class")


@pytest.mark.usefixtures("permitted")
def test_a_thread_is_in_the_class_while_the_block_runs():
    before = find_class()
    with pytest.raises(RuntimeError, match="meanwhile"), in_real_time_class() as is_in:
        assert is_in
        assert find_class() == os.SCHED_FIFO
        assert os.sched_getparam(0).sched_priority == LOOP_PRIORITY
        with in_real_time_class(8) as is_in:  # it stays as it is
            assert is_in
            assert os.sched_getparam(0).sched_priority == LOOP_PRIORITY
        assert find_class() == os.SCHED_FIFO
        raise RuntimeError("meanwhile")
    assert find_class() == before


def test_without_permission_a_thread_stays_where_it_is(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    before = find_class()
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with in_real_time_class() as is_in:
        assert not is_in
    assert not enter_real_time_class(LOOP_PRIORITY)
    assert find_class() == before
    monkeypatch.setattr("drivers.real_time_class.IS_KNOWN", False)
    monkeypatch.delattr(os, "sched_setscheduler")  # a system without such classes
    with in_real_time_class() as is_in:
        assert not is_in


@pytest.mark.usefixtures("permitted")
def test_an_interruption_while_it_enters_leaves_it_where_it_was(monkeypatch: pytest.MonkeyPatch):
    enter = os.sched_setscheduler

    def interrupt(*values: Any) -> None:
        monkeypatch.setattr(os, "sched_setscheduler", enter)
        enter(*values)
        raise KeyboardInterrupt

    before = find_class()
    monkeypatch.setattr(os, "sched_setscheduler", interrupt)
    with pytest.raises(KeyboardInterrupt), in_real_time_class():
        pass
    assert find_class() == before
