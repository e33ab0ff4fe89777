"""The instruction with which a client ends a control period: in lock-step, time passes then."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.dynamixel.control_table import ControlTable, table_named
from drivers.dynamixel.protocol2 import Damaged, Instruction, Packet, Span


@dataclass(frozen=True)
class CycleEnd:
    """A sync write of goal positions, or of torque off to all servos that have no watchdog.

    To those without torque no goal is written, for that would switch it on.
    """

    goal: Span
    torque: Span | None = None
    """Register of the torque; None where goals are written to limp servos too."""
    servos: int = 0
    """Number of servos."""

    @classmethod
    def of(cls, tables: Sequence[ControlTable]) -> CycleEnd:
        """Find it for the servos of a bus; that of the X series if there is none."""
        servos = [table for table in tables if table.is_servo]
        if not servos:
            return X_SERIES
        torque = None if servos[0].has_watchdog else servos[0]["torque_enable"].span
        return cls(servos[0]["goal_position"].span, torque, len(servos))

    def is_ended_by(self, item: Packet | Damaged) -> bool:
        """Return whether an instruction ends a period."""
        if isinstance(item, Damaged) or item.instruction != Instruction.SYNC_WRITE:
            return False
        if len(item.params) < 4:
            return False
        address = int.from_bytes(item.params[:2], "little")
        length = int.from_bytes(item.params[2:4], "little")
        goal, torque = self.goal, self.torque
        if address <= goal.address and address + length >= goal.address + goal.length:
            return True
        if torque is None or (address, length) != (torque.address, torque.length):
            return False
        values = item.params[5::2]
        return len(values) == self.servos and not any(values)


X_SERIES = CycleEnd(table_named("XM430-W350")["goal_position"].span)
"""As in every X and MX(2.0) servo."""
