"""Action files as a robot's maker would write them, for tests."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Slot:
    """One step: positions by servo id, time and pause in the file's units."""

    positions: Mapping[int, int]
    time: int = 50
    pause: int = 0


def write_action_file(
    path: Path,
    pages: Mapping[int, Sequence[Slot]],
    *,
    speed: int = 32,
    schedule: int = 10,
    following: Mapping[int, int] | None = None,
    repeat: Mapping[int, int] | None = None,
) -> None:
    """Write 256 pages of 512 bytes, empty but for those given, each with its checksum."""
    content = bytearray(256 * 512)
    for number, steps in pages.items():
        page = bytearray(512)
        page[0:4] = b"wave"
        page[15], page[16] = (repeat or {}).get(number, 1), schedule
        page[20], page[22], page[24] = len(steps), speed, 32
        page[25] = (following or {}).get(number, 0)
        for k, step in enumerate(steps):
            slots = [step.positions.get(i, 0) for i in range(31)]
            struct.pack_into("<31HBB", page, 64 + 64 * k, *slots, step.pause, step.time)
        page[31] = (255 - sum(page)) % 256
        content[number * 512 : (number + 1) * 512] = page
    path.write_bytes(content)
