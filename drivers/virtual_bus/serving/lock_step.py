"""Time that passes with the client, as fast as both can go."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.protocol2 import Damaged, Instruction, Packet
from drivers.virtual_bus.serving.bus_clock import BusTime
from drivers.virtual_bus.serving.exchange import Exchange, asks_for_answer
from drivers.virtual_bus.serving.instruction_reader import Listener, Request
from drivers.virtual_bus.serving.pseudo_terminal import Wire
from drivers.virtual_bus.serving.wire_faults import Sending

GOAL_POSITION = table_named("XM430-W350")["goal_position"]  # as in every X and MX(2.0) servo
QUIET = 0.01  # s that a client lets pass by waiting for an answer in vain
IDLE = 0.1  # s after which the port is looked after

Wait = Callable[[int, float], bool]
"""Waits for bytes on a file descriptor, so many seconds at most; tells whether there are."""


class LockStep:
    """Serves a wire whose time is its client's.

    A control period passes with each sync write of goal positions, and `QUIET` when an
    answer was due and none came, or part of it is kept back: then the client waits. Nothing
    else takes time. While the port is unplugged there is no client to keep time, so it passes
    by the wall clock.
    """

    def __init__(self, wire: Wire, exchange: Exchange, time: BusTime, wait: Wait) -> None:
        """Serve a wire."""
        self._wire, self._exchange, self._time, self._wait = wire, exchange, time, wait
        self._listener = Listener(exchange.statistics, timed=False)
        self._held: deque[tuple[float, bytes, int]] = deque()

    def serve(self) -> None:
        """Wait for requests, and answer them."""
        wire = self._wire
        if self._wait(wire.fileno(), IDLE if wire.plugged else QUIET) and wire.plugged:
            for request in self._listener.hear(wire.read(), 0.0, wire.baud, 0.0):
                self._answer(request)
        elif not wire.plugged:
            self._held.clear()
            self._time.pass_until(self._time.now + QUIET)
        elif wire.tidy():
            self._held.clear()

    def _answer(self, request: Request) -> None:
        self._release()
        sendings = self._exchange.answer(request)
        if self._held or any(sending.hold for sending in sendings):
            self._hand_over_what_is_not_held(sendings, request.baud)
        else:
            data = b"".join([s.data for s in sendings])
            self._exchange.hand_over(self._wire, data, request.baud)
        if ends_cycle(request.item):
            self._time.pass_period()
        elif asks_for_answer(request.item) and (self._held or not sendings):
            self._time.pass_until(self._time.now + QUIET)
        self._release()

    def _hand_over_what_is_not_held(self, sendings: list[Sending], baud: int) -> None:
        """Hand over up to the first answer that is kept back; all behind it wait with it."""
        for sending in sendings:
            until = self._time.now + sending.hold
            if self._held:
                until = max(until, self._held[-1][0])
            if self._held or sending.hold:
                self._held.append((until, sending.data, baud))
            else:
                self._exchange.hand_over(self._wire, sending.data, baud)

    def _release(self) -> None:
        while self._held and self._held[0][0] <= self._time.now:
            _, data, baud = self._held.popleft()
            self._exchange.hand_over(self._wire, data, baud)


def ends_cycle(item: Packet | Damaged) -> bool:
    """Tell whether an instruction sets goal positions of all: a control period's last."""
    if isinstance(item, Damaged) or item.instruction != Instruction.SYNC_WRITE:
        return False
    if len(item.params) < 4:
        return False
    address = int.from_bytes(item.params[:2], "little")
    length = int.from_bytes(item.params[2:4], "little")
    return address <= GOAL_POSITION.address and address + length >= GOAL_POSITION.end
