"""Reads position, velocity and current of all servos of a bus in every cycle."""

from __future__ import annotations

import time
from collections.abc import Sequence
from enum import Enum
from functools import lru_cache

import numpy as np

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.control_table import ControlTable
from drivers.dynamixel.diagnostics import ServoFacts
from drivers.dynamixel.protocol2 import ALERT, Instruction, Span
from drivers.dynamixel.requests import GroupLayout, Replies, Request

MISSES = 3  # missing replies in a row after which a servo is left out
POLL_EVERY = 10  # cycles between two pings of a servo that is left out
FAST_FAILURES = 3  # fast reads in a row without any reply, or returns of one servo
FAST_PAUSE = 500  # cycles until fast reads are tried again
LENGTHS = 3  # lengths of a request that alternate from cycle to cycle
CACHED_REQUESTS = 1000  # there are few orders in which to read
GROUP_READS = {Instruction.SYNC_READ, Instruction.BULK_READ}
RETRY_MARGIN = 0.0005  # s beyond the bytes' own time that a retry needs


def count_reads(tables: Sequence[ControlTable]) -> int:
    """Count the reads of a cycle: one of all servos or one of each, and one in the background."""
    known = frozenset.intersection(*(table.instructions for table in tables))
    return 1 + (1 if GROUP_READS & known else len(tables))


class GroupKind(Enum):
    """Instruction by which a group is read."""

    FAST = "fast sync read"
    SYNC = "sync read"
    BULK = "bulk read"
    SINGLE = "single reads"


class CyclicRead:
    """Reads the same values of several servos in every cycle.

    A silent servo breaks the frame of a fast read, and on some buses the replies of all servos
    behind it in any group read. So a servo that did not reply moves to the end of the request,
    and after `MISSES` missing replies it is left out and only polled now and then. Replies that
    are a cycle late are recognized by the order of the ids, which rotates from cycle to cycle;
    where that is not enough, by their length, which alternates.
    """

    def __init__(self, bus: DynamixelBus, servos: Sequence[ServoFacts]) -> None:
        """Prepare to read some servos of a bus, at least one."""
        self._bus = bus
        self._spans = {servo.id: GroupLayout.of(servo.table).span for servo in servos}
        self._ids = list(self._spans)
        self._length = max(span.length for span in self._spans.values())
        self._best = self._choose(servos)
        self.kind = self._best
        """How the group is read now."""
        self._misses = dict.fromkeys(self._ids, 0)
        self._suspects: set[int] = set()
        self._next_poll: dict[int, int] = {}
        self._returns = dict.fromkeys(self._ids, 0)
        self._fast_failures = 0
        self._fast_again = 0
        self._cycle = 0
        self._request: Request | None = None
        self._group = lru_cache(CACHED_REQUESTS)(self._make_group)

    def _choose(self, servos: Sequence[ServoFacts]) -> GroupKind:
        """Choose the fastest instruction that all servos know."""
        known = frozenset.intersection(*(servo.table.instructions for servo in servos))
        if len(set(self._spans.values())) == 1 and Instruction.SYNC_READ in known:
            can_fast = all(servo.supports_fast_read for servo in servos)
            return GroupKind.FAST if can_fast else GroupKind.SYNC
        return GroupKind.BULK if Instruction.BULK_READ in known else GroupKind.SINGLE

    @property
    def left_out(self) -> list[int]:
        """Return the ids that have been silent for too long."""
        return list(self._next_poll)

    def begin(self) -> None:
        """Send this cycle's request."""
        self._cycle += 1
        if self.kind is not self._best and self._cycle >= self._fast_again:
            self.kind, self._fast_failures = self._best, 0
            self._returns = dict.fromkeys(self._ids, 0)
        active = [device for device in self._ids if device not in self._next_poll]
        if not active:
            self._request = None
            return
        turn = self._cycle % len(active)
        self._request = self._build(active[turn:] + active[:turn])
        self._bus.begin(self._request)

    def collect(self, limit: float) -> Replies:
        """Collect the replies, and request missing ones once more if there is time.

        A reply holds the group's bytes, and further ones to be ignored. ``limit`` is the time
        of the monotonic clock after which not to wait [s].
        """
        request = self._request
        if request is None:
            return Replies.of([], self._length)
        replies = self._bus.collect_group(request, limit)
        if len(replies.devices) < len(request.lengths):
            self._suspects.update(self._find_silent(request, replies))
            retry = self._build([i for i in request.lengths if i not in replies.devices])
            if time.monotonic() + self._bus.duration(retry) + RETRY_MARGIN < limit:
                self._bus.statistics.retries += 1
                self._bus.begin(retry)
                replies = replies.join(self._bus.collect_group(retry, limit))
                request = retry
        self._count_misses(request, replies)
        refused = (replies.errors & ~np.uint8(ALERT)) != 0
        return replies.select(~refused) if refused.any() else replies

    def due_poll(self) -> int | None:
        """Return the left-out servo to poll in this cycle, if any."""
        for device, cycle in self._next_poll.items():
            if cycle <= self._cycle:
                self._next_poll[device] = self._cycle + POLL_EVERY
                return device
        return None

    def restore(self, device: int) -> None:
        """Read a left-out servo again that has replied."""
        self._next_poll.pop(device, None)
        self._misses[device] = 0
        self._suspects.discard(device)
        self._returns[device] += 1
        if self._returns[device] >= FAST_FAILURES:
            self._give_up_fast()

    def _build(self, devices: list[int]) -> Request:
        """Build the request to some servos, those that were silent last time at the end."""
        order = sorted(devices, key=self._suspects.__contains__)
        is_fast = self.kind is GroupKind.FAST
        extra = self._cycle % LENGTHS
        if is_fast:
            is_ambiguous = order[-1] in self._suspects or len(order) < LENGTHS
            extra = extra + 1 if is_ambiguous else 0
        return self._group(bytes(order), self._length + extra, is_fast)

    def _make_group(self, order: bytes, length: int, is_fast: bool) -> Request:
        spans = {device: Span(self._spans[device].address, length) for device in order}
        return self._bus.group(spans, fast=is_fast)

    def _count_misses(self, request: Request, replies: Replies) -> None:
        is_whole = len(replies.devices) == len(self._ids) - len(self._next_poll)
        if is_whole and not self._suspects:
            return
        replied = replies.devices.tolist()
        for device in replied:
            self._misses[device] = 0
            self._suspects.discard(device)
        if is_whole:
            self._fast_failures = 0
            return
        for device in self._find_silent(request, replies):
            self._misses[device] += 1
            self._suspects.add(device)
            if self._misses[device] >= MISSES:
                self._next_poll[device] = self._cycle + POLL_EVERY
        if not replied and not replies.is_damaged and self.kind is GroupKind.FAST:
            self._fast_failures += 1
            if self._fast_failures >= FAST_FAILURES:
                self._give_up_fast()

    def _find_silent(self, request: Request, replies: Replies) -> list[int]:
        """Return the silent servos, without those that waited for them in the chain."""
        if replies.is_damaged:
            return []
        replied, order = set(replies.devices.tolist()), list(request.lengths)
        if self.kind is GroupKind.SINGLE:  # each was asked alone, unless there was no time for it
            return [i for i in order if i not in replied and i not in self._bus.unsent]
        last = max((place for place, device in enumerate(order) if device in replied), default=-1)
        return [device for device in order[: last + 2] if device not in replied]

    def _give_up_fast(self) -> None:
        if self._best is GroupKind.FAST:
            self.kind = GroupKind.SYNC
            self._fast_again = self._cycle + FAST_PAUSE
