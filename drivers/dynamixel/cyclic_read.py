"""The read of every cycle: one question to all servos of a bus, whoever is silent."""

from __future__ import annotations

import time
from collections.abc import Mapping
from enum import Enum

import numpy as np

from drivers.dynamixel.bus import DynamixelBus, Replies, Request
from drivers.dynamixel.protocol2 import ALERT, Span

MISSES = 3  # silences in a row after which a servo is left out
POLL_EVERY = 10  # cycles between two pings of a servo that is left out
FAST_FAILURES = 3  # fast reads in a row without any answer, or returns of one servo
FAST_PAUSE = 500  # cycles until fast reads are tried again
SALTS = 3  # lengths of a question that turn from cycle to cycle
MOST_QUESTIONS = 1000  # that are kept, for there are few orders in which to ask
RETRY_MARGIN = 0.0005  # s beyond the bytes' own time without which it is no use to ask again


class GroupKind(Enum):
    """How a group is read."""

    FAST = "fast sync read"
    SYNC = "sync read"
    BULK = "bulk read"


class CyclicRead:
    """Reads the same values of several servos, again and again.

    A silent servo breaks the frame of a fast read, and on some buses the answers of all
    behind it in any group read. So one that did not answer goes to the end of the question,
    where it harms nobody, and after `MISSES` silences it is left out and only pinged now and
    then. Answers that come a cycle late are told by the order of the ids, which turns from
    cycle to cycle; where that cannot tell, the question asks for some bytes more, in turn.
    """

    def __init__(self, bus: DynamixelBus, spans: Mapping[int, Span], *, can_fast: bool) -> None:
        """Prepare a group.

        Args:
            bus: Where the servos are.
            spans: Registers of each servo, by id; all of one length.
            can_fast: Whether every one of them answers fast reads.
        """
        self._bus, self._spans = bus, dict(spans)
        self._ids = list(spans)
        self._length = next(iter(spans.values())).length
        is_same = len(set(spans.values())) == 1
        self._best = GroupKind.BULK
        if is_same:
            self._best = GroupKind.FAST if can_fast else GroupKind.SYNC
        self.kind = self._best
        """How the group is read now."""
        self._misses = dict.fromkeys(spans, 0)
        self._suspects: set[int] = set()
        self._next_poll: dict[int, int] = {}
        self._returns = dict.fromkeys(spans, 0)
        self._fast_failures = 0
        self._fast_again = 0
        self._cycle = 0
        self._question: Request | None = None
        self._questions: dict[tuple[bytes, int, bool], Request] = {}

    @property
    def left_out(self) -> list[int]:
        """Return the ids that have been silent for too long."""
        return list(self._next_poll)

    @property
    def question(self) -> Request | None:
        """Return what was asked last, ``None`` when there was nobody to ask."""
        return self._question

    def ask(self) -> None:
        """Send this cycle's question."""
        self._cycle += 1
        if self.kind is not self._best and self._cycle >= self._fast_again:
            self.kind, self._fast_failures = self._best, 0
            self._returns = dict.fromkeys(self._ids, 0)
        active = [device for device in self._ids if device not in self._next_poll]
        if not active:
            self._question = None
            return
        turn = self._cycle % len(active)
        self._question = self._ask_for(active[turn:] + active[:turn])
        self._bus.ask(self._question)

    def collect(self, limit: float) -> Replies:
        """Take in the answers, and ask once more for those that are missing if there is time.

        Args:
            limit: Time of the monotonic clock after which not to wait [s].
        """
        question = self._question
        if question is None:
            return Replies.of([], self._length)
        answers = self._collect_one(question, limit)
        if len(answers.devices) < len(question.lengths):
            missing = self._find_missing(question, answers)
            self._suspects.update(self._find_silent(question, answers))
            again = self._ask_for(missing)
            if time.monotonic() + self._bus.duration(again) + RETRY_MARGIN < limit:
                self._bus.statistics.retries += 1
                self._bus.ask(again)
                second = self._collect_one(again, limit)
                answers, question = _join(answers, second), again
        self._judge(question, answers)
        return _without_refusals(answers)

    def due_poll(self) -> int | None:
        """Return the left-out servo that is to be pinged in this cycle, if any."""
        for device, cycle in self._next_poll.items():
            if cycle <= self._cycle:
                self._next_poll[device] = self._cycle + POLL_EVERY
                return device
        return None

    def restore(self, device: int) -> None:
        """Take a servo in again that has answered."""
        self._next_poll.pop(device, None)
        self._misses[device] = 0
        self._suspects.discard(device)
        self._returns[device] += 1
        if self._returns[device] >= FAST_FAILURES:
            self._give_up_fast()

    def _ask_for(self, devices: list[int]) -> Request:
        """Build the question to some, those that were silent last time at the end."""
        suspects = [device for device in devices if device in self._suspects]
        order = devices
        if suspects:
            order = [device for device in devices if device not in self._suspects] + suspects
        is_fast = self.kind is GroupKind.FAST
        extra = self._cycle % SALTS
        if is_fast:
            extra = extra + 1 if suspects or len(order) < SALTS else 0
        key = (bytes(order), extra, is_fast)
        question = self._questions.get(key)
        if question is None:
            if len(self._questions) > MOST_QUESTIONS:
                self._questions.clear()
            spans = {i: Span(self._spans[i].address, self._length + extra) for i in order}
            question = self._questions[key] = Request.group(spans, fast=is_fast)
        return question

    def _collect_one(self, question: Request, limit: float) -> Replies:
        answers = self._bus.collect_group(question, limit)
        if answers.data.shape[1] == self._length:
            return answers
        data = answers.data[:, : self._length]
        return Replies(answers.devices, answers.errors, data, answers.is_cut)

    def _find_missing(self, question: Request, answers: Replies) -> list[int]:
        told = set(answers.devices.tolist())
        return [device for device in question.lengths if device not in told]

    def _judge(self, question: Request, answers: Replies) -> None:
        """Remember who was silent."""
        is_whole = len(answers.devices) == len(self._ids) - len(self._next_poll)
        if is_whole and not self._suspects:
            return
        told = answers.devices.tolist()
        for device in told:
            self._misses[device] = 0
            self._suspects.discard(device)
        if is_whole:
            self._fast_failures = 0
            return
        for device in self._find_silent(question, answers):
            self._misses[device] += 1
            self._suspects.add(device)
            if self._misses[device] >= MISSES:
                self._next_poll[device] = self._cycle + POLL_EVERY
        if not told and not answers.is_cut and self.kind is GroupKind.FAST:
            self._fast_failures += 1
            if self._fast_failures >= FAST_FAILURES:
                self._give_up_fast()

    def _find_silent(self, question: Request, answers: Replies) -> list[int]:
        """Find who was silent himself; whom that may have kept from answering is excused."""
        if answers.is_cut:
            return []
        told, order = set(answers.devices.tolist()), list(question.lengths)
        last = max((place for place, device in enumerate(order) if device in told), default=-1)
        return [device for device in order[: last + 2] if device not in told]

    def _give_up_fast(self) -> None:
        if self._best is GroupKind.FAST:
            self.kind = GroupKind.SYNC
            self._fast_again = self._cycle + FAST_PAUSE


def _join(first: Replies, second: Replies) -> Replies:
    return Replies(
        np.concatenate([first.devices, second.devices]),
        np.concatenate([first.errors, second.errors]),
        np.concatenate([first.data, second.data]),
        second.is_cut,
    )


def _without_refusals(answers: Replies) -> Replies:
    """Leave out who told an error instead of values."""
    refused = answers.errors & ~np.uint8(ALERT)
    if not refused.any():
        return answers
    kept = refused == 0
    return Replies(answers.devices[kept], answers.errors[kept], answers.data[kept], answers.is_cut)
