"""Time that passes by the wall clock, with every byte as long on the wire as its rate says."""

from __future__ import annotations

import ctypes
import math
from collections import deque
from dataclasses import dataclass, replace
from time import monotonic, sleep

from drivers.dynamixel.bus import BITS_PER_BYTE
from drivers.dynamixel.protocol2 import BROADCAST, Damaged, Instruction, Packet
from drivers.virtual_bus.serving.bus_clock import BusTime
from drivers.virtual_bus.serving.exchange import Exchange
from drivers.virtual_bus.serving.instruction_reader import Listener, Request
from drivers.virtual_bus.serving.lock_step import Wait
from drivers.virtual_bus.serving.pseudo_terminal import Wire
from drivers.virtual_bus.serving.wire_faults import Sending

IDLE_STEP = 0.004  # s of physics in one go, while nothing is on the wire
SHORT = 0.001  # s to the next event that are too short for a stretch of physics
IDLE = 0.1  # s after which the port is looked after
SPIN = 60e-6  # s before an event that are watched out for and not slept through
MICROFRAME = 125e-6  # s; a high-speed USB adapter hands bytes over no oftener
PR_SET_TIMERSLACK = 29  # Linux' prctl.h


@dataclass(frozen=True)
class Batch:
    """Bytes that reach the client together."""

    begin: float
    """Bus time at which the first of them is on the wire [s]."""
    at: float
    """Bus time at which the last of them reaches the client [s]."""
    data: bytes
    baud: int
    """Rate at which they are sent [bit/s]."""


class RealTime:
    """Serves a wire whose time is the wall's.

    An instruction is complete when its bytes have taken their time at the client's rate;
    then the devices hear it. Each device's answer follows the one before after its return
    delay, and reaches the client when its last byte is through.

    Replies to a broadcast ping leave the wire silent between their slots. An instruction sent
    in such a silence is transmitted at once, and the devices whose slots are still to come
    drop their replies: the new instruction has taken the place of the ping.
    """

    def __init__(
        self,
        wire: Wire,
        exchange: Exchange,
        time: BusTime,
        wait: Wait,
        *,
        adapter_latency: float = 0.0,
    ) -> None:
        """Serve a wire from the thread that calls; its time goes on from the body's."""
        self._wire, self._exchange, self._time, self._wait = wire, exchange, time, wait
        self._adapter_latency = adapter_latency
        self._statistics = exchange.statistics
        self._listener = Listener(exchange.statistics, timed=True)
        self._requests: deque[Request] = deque()
        self._complete_at = math.inf
        self._is_ping_window = False
        self._free_at = 0.0  # when the wire is, of all that was planned
        self._batches: deque[Batch] = deque()
        self._delivered_at = 0.0  # when the last of them will be
        self._last_look = 0.0
        self._start = monotonic() - time.now  # the body may have lived before
        _sleep_precisely()

    @property
    def now(self) -> float:
        """Return the bus time [s]."""
        return monotonic() - self._start

    def serve(self) -> None:
        """Do what is due, then wait for what comes next, for bytes, or for physics' turn."""
        self._do_due()
        now, coming = self.now, self._next_event
        if coming - now <= SPIN:
            self._spin(coming)
            return
        until = coming - SPIN
        if coming - now > SHORT:
            self._pass_idle(now)
            until = min(until, now + IDLE_STEP)
        if self._wait(self._wire.fileno(), until - self.now):
            self._hear()

    @property
    def _next_event(self) -> float:
        return min(self._batches[0].at, self._complete_at) if self._batches else self._complete_at

    def _do_due(self) -> None:
        while self._next_event <= self.now:
            if self._batches and self._batches[0].at <= self._complete_at:
                self._send(self._batches.popleft())
            else:
                self._answer()

    def _spin(self, until: float) -> None:
        while self.now < until:
            sleep(0.0)  # lets clients of the same process run

    def _pass_idle(self, now: float) -> None:
        self._time.pass_until(now)
        if now - self._last_look > IDLE and not self._batches:
            self._wire.tidy()
            self._last_look = now

    def _hear(self) -> None:
        now, wire = self.now, self._wire
        self._last_look = now
        if not wire.plugged:
            return
        baud = wire.baud
        requests = self._listener.hear(wire.read(), now, baud, _byte_time(baud))
        if requests and now < self._free_at:
            self._statistics.talked_over += 1
        self._requests += requests
        if requests and self._is_ping_window:
            self._end_ping_window(now)
        self._begin_next()

    def _begin_next(self) -> None:
        """Let the next instruction's bytes go over the wire, once it is free."""
        if self._requests and self._complete_at == math.inf:
            request = self._requests[0]
            begin = max(request.arrival, self._free_at)
            self._complete_at = begin + request.size * _byte_time(request.baud)
            # Nothing can happen to the devices before that: physics may go ahead already,
            # and the answer need not wait for it.
            self._time.pass_until(self._complete_at)

    def _answer(self) -> None:
        request, self._free_at = self._requests.popleft(), self._complete_at
        self._plan(self._exchange.answer(request), request.baud)
        self._complete_at = math.inf
        self._is_ping_window = _is_broadcast_ping(request.item)
        if self._requests and self._is_ping_window:
            self._end_ping_window(self.now)
        self._begin_next()

    def _plan(self, sendings: list[Sending], baud: int) -> None:
        """Work out when replies reach the client; those close together do so as one."""
        first, byte_time = -math.inf, _byte_time(baud)
        for sending in sendings:
            begin = self._free_at + sending.delay
            self._free_at = begin + len(sending.data) * byte_time
            at = max(self._tick(self._free_at) + sending.hold, self._delivered_at)
            self._delivered_at = at
            if at - first < MICROFRAME:
                last = self._batches[-1]
                self._batches[-1] = replace(last, at=at, data=last.data + sending.data)
            else:
                self._batches.append(Batch(begin, at, sending.data, baud))
                first = at

    def _end_ping_window(self, now: float) -> None:
        """Drop the replies to a broadcast ping that are not on the wire yet."""
        self._is_ping_window = False
        while self._batches and self._batches[-1].begin > now:
            self._batches.pop()
        last = self._batches[-1] if self._batches else None
        end = last.begin + len(last.data) * _byte_time(last.baud) if last else now
        self._free_at = min(self._free_at, max(end, now))
        self._delivered_at = last.at if last else now

    def _tick(self, at: float) -> float:
        """Return when the adapter hands over what it has at a time [s]."""
        latency = self._adapter_latency
        return math.ceil(at / latency) * latency if latency else at

    def _send(self, batch: Batch) -> None:
        self._exchange.hand_over(self._wire, batch.data, batch.baud)
        late = self.now - batch.at
        statistics = self._statistics
        statistics.sendings += 1
        statistics.lateness_total += late
        statistics.lateness_max = max(statistics.lateness_max, late)


def _is_broadcast_ping(item: Packet | Damaged) -> bool:
    is_ping = isinstance(item, Packet) and item.instruction == Instruction.PING
    return is_ping and item.id == BROADCAST


def _byte_time(baud: int) -> float:
    return BITS_PER_BYTE / baud if baud else 0.0


def _sleep_precisely() -> None:
    """Let this thread's sleeps end within a microsecond of their time, not within 50.

    Linux delays wake-ups by its timer slack to save power. On a system without prctl the
    answers come some ten microseconds later.
    """
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is not None:
        prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
