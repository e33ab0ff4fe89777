"""Whole turns of servos, which their position registers leave open after a start."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.control_table import table_named
from drivers.servo_units import ServoUnits
from drivers.state import Integers
from robots import Robot
from robots.quaternion import Array

OUTSIDE_RANGE = 0.1  # rad that a joint may be beyond its range


class WholeTurns:
    """Finds the turns that servos have made, from the ranges of their joints.

    A servo that starts counts from within one turn, wherever its joint is: behind a gear or a
    coupling, or beyond the half turn, its count is whole turns off. Under power it counts on.
    Servos without extended position mode never count beyond one turn.
    """

    def __init__(self, robot: Robot) -> None:
        self._units, self._transmission = ServoUnits(robot), robot.transmission
        self._lower, self._upper = robot.lower, robot.upper
        models = [joint.servo.model for joint in robot.joints]
        self._turn: Integers = np.array(  # ticks of a whole turn; 0 if it never counts on
            [round(m.ticks_per_turn) if table_named(m.name).counts_turns else 0 for m in models]
        )
        self._zero = np.array([joint.servo.zero_ticks for joint in robot.joints])
        reach = [max(abs(joint.lower), abs(joint.upper)) for joint in robot.actuators]
        ratio = np.array([joint.servo.gear for joint in robot.joints])
        self._most = np.ceil(ratio * reach / (2.0 * np.pi)).astype(int) + 1
        pairs = [coupling.columns for coupling in self._transmission.couplings]
        alone = np.flatnonzero(~self._transmission.is_coupled)
        self._groups = [*pairs, *([row] for row in alone.tolist())]

    def resolve(self, register: Integers, near: Integers, rows: Integers | None = None) -> Integers:
        """Add whole turns to register values, with which joints are within their ranges.

        Of several the nearest are taken; where none lead into the ranges, those that are least out.

        Args:
            register: Position registers [ticks], (n,).
            near: Positions to be near to [ticks], (n,).
            rows: Joints that this is about, with those coupled to them; None for all.

        Returns:
            Positions [ticks], (n,); those of other joints are ``near``.
        """
        ticks = near.copy()
        for group in self._groups:
            if rows is None or np.isin(group, rows).any():
                ticks[group] = self._choose(group, register, near)
        return ticks

    def find_angles(self, register: Integers, known: NDArray[np.bool_]) -> dict[int, Array]:
        """Find the possible angles of joints [rad], likeliest first, by place, (k,) each.

        Joints whose servo, or one coupled to it, is not ``known``, (n,), are left out.
        """
        angles: dict[int, Array] = {}
        for group in (g for g in self._groups if known[g].all()):
            chosen = self._choose(group, register, register)
            ticks, beyond = self._list_positions(group, register)
            others = ticks[(beyond <= OUTSIDE_RANGE) & (ticks != chosen).any(axis=1)]
            ticks = np.tile(register, (1 + len(others), 1))
            ticks[:, group] = [chosen, *others]
            found = self._units.to_rad(ticks)
            angles |= {row: found[:, row] for row in group}
        return angles

    def _choose(self, group: list[int], register: Integers, near: Integers) -> Integers:
        ticks, beyond = self._list_positions(group, register)
        ticks = ticks[beyond <= max(OUTSIDE_RANGE, float(beyond.min()) + 1e-9)]
        distance = np.abs(ticks - near[group]).sum(axis=1)
        return np.asarray(ticks[int(distance.argmin())])

    def _list_positions(self, group: list[int], register: Integers) -> tuple[Integers, Array]:
        """List positions of a group's servos, (k, group), and how far out joints are, (k,)."""
        turns = [self._list_turns(row, int(register[row])) for row in group]
        ticks = np.tile(register, (int(np.prod([len(t) for t in turns])), 1))
        ticks[:, group] = list(product(*turns))
        angles = self._units.to_rad(ticks)[:, group]
        beyond = np.maximum(self._lower[group] - angles, angles - self._upper[group])
        return ticks[:, group], np.maximum(beyond, 0.0).max(axis=1)

    def _list_turns(self, row: int, register: int) -> list[int]:
        turn = int(self._turn[row])
        if turn == 0:
            return [register]
        most = int(self._most[row])
        middle = register - round((register - int(self._zero[row])) / turn) * turn
        return [middle + k * turn for k in range(-most, most + 1)]
