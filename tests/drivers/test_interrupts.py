"""A signal does not cut off the release of a robot."""

import os
import signal
from collections.abc import Iterator

import pytest
from memory_rig import Rig

from drivers import Command
from drivers.dynamixel.servo_chain import ServoChain
from drivers.interrupts import deferred_interrupts


@pytest.fixture(autouse=True)
def default_handler() -> Iterator[None]:
    """Let SIGINT raise, whatever a command that ran in this process has made of it."""
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
        backend = rig.backend
        for _ in range(4):
            state = backend.read()
            backend.write(Command.position(tiny, state.joint_pos))
        assert {servo.peek("torque_enable") for servo in rig.virtual.servos} == {1}
        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(ServoChain, method, interrupted)
            if method == "disarm":
                backend.hand_over()
            backend.close()
        backend.close()
        assert {servo.peek("torque_enable") for servo in rig.virtual.servos} == {0}
        assert {servo.peek("bus_watchdog") for servo in rig.virtual.servos} == {0}
        assert not any(chain.bus.port.is_open for chain in backend.chains)
