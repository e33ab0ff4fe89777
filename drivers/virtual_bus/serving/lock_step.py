"""Lock-step: bus time advances with the client's requests, as fast as both can run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from drivers.virtual_bus.devices.chain import Reply
from drivers.virtual_bus.serving.exchange import (
    Exchange,
    InstructionReader,
    ReceivedInstruction,
    expects_reply,
)
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal

QUIET = 0.01  # s that a client waits before it gives up a reply
IDLE = 0.1  # s without traffic after which an abandoned port is cleaned up

Wait = Callable[[int, float], bool]
"""Waits for bytes on a file descriptor for at most some seconds; returns whether they came."""


class LockStep:
    """Serves a port whose time is advanced by its client.

    Each sync write of goal positions advances time by one control period. An expected reply that
    is missing or held back advances it by `QUIET`, because the client waits then. Nothing else
    takes time. While the port is unplugged, time follows the wall clock.
    """

    def __init__(self, wire: PseudoTerminal, exchange: Exchange, wait: Wait) -> None:
        """Connect a port to its devices."""
        self._wire, self._exchange, self._wait = wire, exchange, wait
        self._reader = InstructionReader(exchange.statistics, timed=False, wire=exchange.wire)
        self._held: deque[tuple[float, bytes, int]] = deque()
        self.handled = 0
        """Bytes of clients whose instructions are executed."""

    def serve(self) -> None:
        """Wait for instructions and execute them."""
        wire = self._wire
        if self._wait(wire.fileno(), IDLE if wire.plugged else QUIET) and wire.plugged:
            data = wire.read()
            for request in self._reader.receive(data, 0.0, wire.baud):
                self._run(request)
            self.handled += len(data)
        elif not wire.plugged:
            self._held.clear()
            self._exchange.pass_until(self._exchange.time + QUIET)
        elif wire.tidy():
            self._held.clear()

    def _run(self, request: ReceivedInstruction) -> None:
        self._release()
        replies = self._exchange.run(request)
        if self._held or any(reply.hold for reply in replies):
            self._deliver_or_hold(replies, request.baud)
        else:
            data = b"".join([s.data for s in replies])
            self._exchange.deliver(self._wire, data, request.baud)
        if self._exchange.cycle_end.is_ended_by(request.item):
            self._exchange.pass_period()
        elif expects_reply(request.item) and (self._held or not replies):
            self._exchange.pass_until(self._exchange.time + QUIET)
        self._release()

    def _deliver_or_hold(self, replies: list[Reply], baud: int) -> None:
        """Deliver up to the first reply that is held back; all after it wait with it."""
        for reply in replies:
            until = self._exchange.time + reply.hold
            if self._held:
                until = max(until, self._held[-1][0])
            if self._held or reply.hold:
                self._held.append((until, reply.data, baud))
            else:
                self._exchange.deliver(self._wire, reply.data, baud)

    def _release(self) -> None:
        while self._held and self._held[0][0] <= self._exchange.time:
            _, data, baud = self._held.popleft()
            self._exchange.deliver(self._wire, data, baud)
