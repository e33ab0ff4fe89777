"""Real time: bus time follows the wall clock, and every byte takes its time on the wire."""

from __future__ import annotations

import ctypes
import math
from collections import deque
from dataclasses import dataclass, replace
from time import monotonic, sleep

from drivers.dynamixel.protocol2 import BROADCAST, Instruction, Packet
from drivers.virtual_bus.devices.chain import Reply
from drivers.virtual_bus.serving.exchange import (
    Exchange,
    InstructionReader,
    ReceivedInstruction,
    byte_time,
)
from drivers.virtual_bus.serving.lock_step import IDLE, Wait
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal

IDLE_STEP = 0.004  # s of physics at once while the wire is idle
SHORT = 0.001  # s; when the next event is nearer, physics waits
SPIN = 60e-6  # s before an event that are polled, not slept
MICROFRAME = 125e-6  # s; a high-speed USB adapter delivers bytes at most this often
PR_SET_TIMERSLACK = 29  # Linux' prctl.h


@dataclass(frozen=True)
class Batch:
    """Bytes that are delivered to the client together."""

    begin: float
    """Bus time at which the first byte starts on the wire [s]."""
    at: float
    """Bus time at which they are delivered [s]."""
    data: bytes
    baud: int
    """Baud rate [bit/s]."""


class RealTime:
    """Serves a port in real time.

    The devices execute an instruction once its bytes have taken their time at the client's baud
    rate. Each device's reply follows the one before after its return delay, and is delivered when
    its last byte has been sent.

    The wire is silent between the slots of a broadcast ping. An instruction sent meanwhile is
    transmitted at once, and devices whose slots are still to come drop their replies: the new
    instruction replaces the ping. The manual does not describe this case.
    """

    def __init__(
        self, wire: PseudoTerminal, exchange: Exchange, wait: Wait, adapter_latency: float
    ) -> None:
        """Connect a port to its devices; time continues from the physics' own."""
        self._wire, self._exchange, self._wait = wire, exchange, wait
        self._adapter_latency = adapter_latency
        self._reader = InstructionReader(exchange.statistics, timed=True, wire=exchange.wire)
        self._requests: deque[ReceivedInstruction] = deque()
        self._complete_at = math.inf
        self._is_ping_window = False
        self._free_at = 0.0  # when the wire is free of all that was planned
        self._batches: deque[Batch] = deque()
        self._delivered_at = 0.0  # when the last of them is delivered
        self._last_activity = 0.0
        self._start = monotonic() - exchange.time  # physics may have run before
        _sleep_precisely()

    @property
    def now(self) -> float:
        """Return the bus time [s]."""
        return monotonic() - self._start

    def serve(self) -> None:
        """Process due events, then wait for the next one, for bytes, or for physics."""
        while self._next_event <= self.now:
            if self._batches and self._batches[0].at <= self._complete_at:
                batch = self._batches.popleft()
                self._exchange.deliver(self._wire, batch.data, batch.baud)
            else:
                self._run_instruction()
        now, coming = self.now, self._next_event
        if coming - now <= SPIN:
            while self.now < coming:
                sleep(0.0)  # lets clients in the same process run
            return
        until = coming - SPIN
        if coming - now > SHORT:
            self._exchange.pass_until(now)
            if now - self._last_activity > IDLE and not self._batches:
                self._wire.tidy()
                self._last_activity = now
            until = min(until, now + IDLE_STEP)
        if self._wait(self._wire.fileno(), until - self.now):
            self._receive()

    @property
    def _next_event(self) -> float:
        return min(self._batches[0].at, self._complete_at) if self._batches else self._complete_at

    def _receive(self) -> None:
        now, wire = self.now, self._wire
        self._last_activity = now
        if not wire.plugged:
            return
        baud = wire.baud
        requests = self._reader.receive(wire.read(), now, baud)
        self._requests += requests
        if requests and self._is_ping_window:
            self._end_ping_window(now)
        self._begin_next()

    def _begin_next(self) -> None:
        """Start transmitting the next instruction once the wire is free."""
        if self._requests and self._complete_at == math.inf:
            request = self._requests[0]
            begin = max(request.arrival, self._free_at)
            self._complete_at = begin + request.size * byte_time(request.baud)
            # Nothing reaches the devices before that, so physics can run ahead and the reply
            # need not wait for it.
            self._exchange.pass_until(self._complete_at)

    def _run_instruction(self) -> None:
        request, self._free_at = self._requests.popleft(), self._complete_at
        self._plan(self._exchange.run(request), request.baud)
        self._complete_at = math.inf
        item = request.item
        is_ping = isinstance(item, Packet) and item.instruction == Instruction.PING
        self._is_ping_window = is_ping and item.id == BROADCAST
        if self._requests and self._is_ping_window:
            self._end_ping_window(self.now)
        self._begin_next()

    def _plan(self, replies: list[Reply], baud: int) -> None:
        """Schedule the delivery of replies; those close together are delivered at once."""
        first = -math.inf
        for reply in replies:
            begin = self._free_at + reply.delay
            self._free_at = begin + len(reply.data) * byte_time(baud)
            at = max(self._tick(self._free_at) + reply.hold, self._delivered_at)
            self._delivered_at = at
            if at - first < MICROFRAME:
                last = self._batches[-1]
                self._batches[-1] = replace(last, at=at, data=last.data + reply.data)
            else:
                self._batches.append(Batch(begin, at, reply.data, baud))
                first = at

    def _end_ping_window(self, now: float) -> None:
        """Drop the replies to a broadcast ping that are not on the wire yet."""
        self._is_ping_window = False
        while self._batches and self._batches[-1].begin > now:
            self._batches.pop()
        last = self._batches[-1] if self._batches else None
        end = last.begin + len(last.data) * byte_time(last.baud) if last else now
        self._free_at = min(self._free_at, max(end, now))
        self._delivered_at = last.at if last else now

    def _tick(self, at: float) -> float:
        """Return when the adapter delivers bytes that it received at a time [s]."""
        latency = self._adapter_latency
        return math.ceil(at / latency) * latency if latency else at


def _sleep_precisely() -> None:
    """Make this thread's sleeps accurate to a microsecond instead of 50.

    Linux delays wake-ups by its timer slack to save power. On a system without prctl, replies
    are some ten microseconds late.
    """
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
