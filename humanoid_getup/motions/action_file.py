"""ROBOTIS action files: 256 pages of up to seven steps, in encoder ticks by servo id.

A page has 512 bytes: a header of 64 and seven steps of 64. Of the header, counted from 0: bytes 0
to 13 name, 15 repetitions, 16 schedule (10: steps by time), 20 number of steps, 22 speed, 25 page
that follows (0: none), 31 what makes the sum of all bytes 255 modulo 256. A step is 31
little-endian 16-bit positions by servo id, then pause and time in cycles of 8 ms, both scaled by
the page's speed. (ROBOTIS-OP3, op3_action_module, action file 4095; its layout and its times.)
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from humanoid_getup.motions.key_files import KeyCollector, KeySequence
from robots import Robot
from robots.servo import TICKS_PER_TURN
from robots.storage.files import read_bounded

PAGES, PAGE_SIZE, HEADER_SIZE, STEP_SIZE, MOST_STEPS = 256, 512, 64, 64, 7
IDS = 31
CHECKSUM = 255
BY_TIME = 10
CYCLE = 0.008  # s
KEEP, RELEASE = 0x4000, 0x2000
"""Bits of a position: the servo keeps its target; its torque goes off."""


@dataclass(frozen=True)
class ActionStep:
    """One posture of a page."""

    positions: tuple[int, ...]
    """By servo id, with the bits `KEEP` and `RELEASE`, (31,)."""
    move: float
    """Time in which it is reached [s]."""
    pause: float
    """Time for which it is held [s]."""


@dataclass(frozen=True, kw_only=True)
class ActionPage:
    """One page of an action file."""

    number: int
    name: str
    repeat: int
    following: int
    """Page that is played after it; 0 for none."""
    steps: tuple[ActionStep, ...]


class ActionFile:
    """An action file."""

    def __init__(self, path: Path) -> None:
        self.path, size = path, PAGES * PAGE_SIZE
        self._content = read_bounded(path, size)
        if len(self._content) != size:
            raise ValueError(
                f"{path}: has {len(self._content)} bytes, expected {size} of an action file"
            )

    def list_pages(self) -> list[ActionPage]:
        """List the pages that are whole and have steps."""
        return [
            self.read_page(number) for number in range(1, PAGES) if not self._find_damage(number)
        ]

    def read_page(self, number: int) -> ActionPage:
        """Read a page."""
        if damage := self._find_damage(number):
            raise ValueError(f"{self.path}: page {number} {damage}")
        page = self._page(number)
        return ActionPage(
            number=number,
            name=page[:14].split(b"\0")[0].decode("ascii", "replace").strip(),
            repeat=page[15],
            following=page[25],
            steps=tuple(_read_step(page, k) for k in range(page[20])),
        )

    def _page(self, number: int) -> bytes:
        return self._content[number * PAGE_SIZE : (number + 1) * PAGE_SIZE]

    def _find_damage(self, number: int) -> str:
        """Return the problem of a page; "" if there is none."""
        page = self._page(number)
        if sum(page) % 256 != CHECKSUM and any(page):
            return f"is damaged: its bytes sum to {sum(page) % 256}, expected {CHECKSUM}"
        if not page[20] or not page[15]:
            return "is empty, expected one with steps"
        if page[20] > MOST_STEPS:
            return f"has {page[20]} steps, expected at most {MOST_STEPS}"
        if page[16] != BY_TIME or not page[22]:
            return f"has schedule {page[16]} and speed {page[22]}, expected {BY_TIME} and above 0"
        return ""

    def play_order(self, number: int) -> Iterator[ActionPage]:
        """Yield a page, as often as it repeats, and the pages that follow it."""
        seen: list[int] = []
        while number:
            if number in seen:
                chain = ", ".join(map(str, [*seen, number]))
                raise ValueError(f"{self.path}: pages {chain} never end, expected a last one")
            seen.append(number)
            page = self.read_page(number)
            yield from [page] * page.repeat
            number = page.following


def _read_step(page: bytes, number: int) -> ActionStep:
    start, speed = HEADER_SIZE + number * STEP_SIZE, page[22]
    *positions, pause, time = struct.unpack_from(f"<{IDS}HBB", page, start)
    # Both scales are the action module's own: a higher speed makes a move longer.
    cycles, paused = (time * speed) >> 5, (pause << 5) // speed
    return ActionStep(tuple(positions), move=cycles * CYCLE, pause=paused * CYCLE)


def load_page(file: ActionFile, number: int, robot: Robot) -> KeySequence:
    """Read a page and those that follow it as keys of a robot.

    A tick is an angle by the zero and sign of the joint's servo.
    """
    pages = list(file.play_order(number))
    steps = [step for page in pages for step in page.steps]
    source = f"page {number} of {file.path.name}"
    _check_ids(steps, f"{file.path}: page {number}", robot)
    collector = KeyCollector(robot=robot)
    for step in steps:
        collector.add(step.move, _read_angles(step, robot), step.pause)
    name = f"{pages[0].name or 'page'}_{number}"
    return collector.finish(name, source, _find_notes(steps, robot))


def _read_angles(step: ActionStep, robot: Robot) -> dict[int, float]:
    moved = ((j, joint.servo) for j, joint in enumerate(robot.joints) if joint.servo.id < IDS)
    return {
        j: servo.to_rad(step.positions[servo.id])
        for j, servo in moved
        if not step.positions[servo.id] & (KEEP | RELEASE)
    }


def _check_ids(steps: Sequence[ActionStep], place: str, robot: Robot) -> None:
    """Refuse a page for other servos.

    The slots of ids that its robot lacks hold whatever was in memory: only one that changes from
    step to step, always a possible position, is taken for a servo.
    """
    own, given = {joint.servo.id for joint in robot.joints}, _list_moved(steps)
    wrong = {
        i: ticks
        for i in own
        if i < IDS
        for ticks in (step.positions[i] for step in steps)
        if not ticks & (KEEP | RELEASE) and ticks >= TICKS_PER_TURN
    }
    if wrong:
        found = ", ".join(f"id {i} at {ticks} ticks" for i, ticks in sorted(wrong.items()))
        raise ValueError(
            f"{place} has {found}, expected 0 to {TICKS_PER_TURN - 1}: is it another robot's?"
        )
    if foreign := given - own:
        raise ValueError(
            f"{place} moves ids {_list(foreign)}, expected those of robot '{robot.name}', "
            f"{_list(own)}"
        )


def _list_moved(steps: Sequence[ActionStep]) -> set[int]:
    ticks = {i: {step.positions[i] for step in steps} for i in range(IDS)}
    return {i for i, seen in ticks.items() if len(seen) > 1 and 0 < min(seen) <= max(seen) < 4096}


def _list(ids: set[int]) -> str:
    return ", ".join(map(str, sorted(ids)))


def _find_notes(steps: Sequence[ActionStep], robot: Robot) -> tuple[str, ...]:
    notes, positions = [], [step.positions for step in steps]
    for joint in robot.joints:
        servo = joint.servo.id
        flags = [p[servo] for p in positions] if servo < IDS else [KEEP]
        if all(ticks & (KEEP | RELEASE) for ticks in flags):
            notes.append(f"joint '{joint.name}' (id {servo}) is not moved: it stays in its stance")
        elif any(ticks & RELEASE for ticks in flags):
            notes.append(f"joint '{joint.name}' is released on the way: here it keeps its target")
    return tuple(notes)
