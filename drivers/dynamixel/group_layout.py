"""Where load, velocity and position are in the registers that are read in every cycle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.control_table import ControlTable, Item
from drivers.dynamixel.protocol2 import Span
from drivers.dynamixel.requests import Replies

VALUES = ("present_velocity", "present_position")


@dataclass(frozen=True)
class GroupLayout:
    """Adjacent registers of a servo that one read covers."""

    load: Item
    """Its current, or a share of its torque."""
    velocity: Item
    position: Item

    @classmethod
    def of(cls, table: ControlTable) -> GroupLayout:
        """Find them in a control table: with the load where it has one, else the current."""
        velocity, position = (table[name] for name in VALUES)
        load = table["present_load"] if "present_load" in table else table["present_current"]
        return cls(load, velocity, position)

    @property
    def measures_current(self) -> bool:
        """Return whether its load is a current, not a share from which one is estimated."""
        return self.load.name == "present_current"

    @cached_property
    def span(self) -> Span:
        """Return the registers from the first of them to the last."""
        items = (self.load, self.velocity, self.position)
        start = min(item.address for item in items)
        return Span(start, max(item.end for item in items) - start)

    def decode(self, item: Item, replies: Replies) -> NDArray[np.int_]:
        """Decode one of them in every reply, (k,)."""
        column = replies.column(item.address - self.span.address, item.kind)
        if item.sign_bit is None:
            return column
        amount = column.astype(int) & ((1 << item.sign_bit) - 1)
        return np.where(column >> item.sign_bit & 1, -amount, amount)
