"""Rows of numbers that one process publishes and another one reads, without a lock."""

from __future__ import annotations

import mmap
import os

import numpy as np

from robots.quaternion import Array

SLOTS = 8
"""Rows that are kept, so that a reader has the time of seven to copy one."""
WORD = 8  # bytes of a number


class SharedRows:
    """The newest of the rows that one process writes; neither side ever waits for the other."""

    def __init__(self, width: int, descriptor: int | None = None) -> None:
        """Create rows of some numbers, or open those of another process by their descriptor."""
        self.descriptor = os.memfd_create("rows") if descriptor is None else descriptor
        """File descriptor, for the other process."""
        size = WORD * (1 + SLOTS * (width + 1))
        if descriptor is None:
            os.ftruncate(self.descriptor, size)
        self._memory = mmap.mmap(self.descriptor, size)
        self._count = np.frombuffer(self._memory, dtype=np.int64, count=1)
        rows = np.frombuffer(self._memory, dtype=float, offset=WORD)
        self._rows = rows.reshape(SLOTS, width + 1)  # each begins with its number

    def publish(self, row: Array) -> None:
        """Publish a row, (width,)."""
        number = int(self._count[0]) + 1
        slot = self._rows[number % SLOTS]
        slot[0] = -1.0  # not to be read until it is complete
        slot[1:] = row
        slot[0] = number
        self._count[0] = number

    def read(self, after: int) -> tuple[int, Array] | None:
        """Return number and values of the newest row; None if none came after a number."""
        while (number := int(self._count[0])) > after:
            slot = self._rows[number % SLOTS].copy()
            if slot[0] == number and int(self._count[0]) - number < SLOTS - 1:
                return number, slot[1:]
        return None

    def close(self) -> None:
        """Close the descriptor; the memory goes with the last process that has it."""
        os.close(self.descriptor)
