"""Disturbances: how robots and their worlds differ from the ones that were planned for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.distributions import Normal, Quantity, RandomAxis, Uniform, draw
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit, quaternion
from robots.ground import GROUND_FRICTION
from robots.kinematics import lowest_point
from robots.quaternion import Array
from robots.robot import Layout

ROOM_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a disturbance, tried in this order
MOST_RAISED = 0.04  # m by which a disturbance may raise or lower a robot


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenarios:
    """Where each of N robots starts, and how it and its world differ."""

    starts: Array
    """MuJoCo positions at the start, at rest, (N, nq)."""
    parameters: DomainParameters

    def __len__(self) -> int:
        return len(self.starts)

    @staticmethod
    def nominal(world: World, starts: Array, limit: TorqueLimit = FULL_TORQUE) -> Scenarios:
        """Let robots start from MuJoCo positions (N, nq) or (nq,), as they are described."""
        starts = np.atleast_2d(starts)
        return Scenarios(
            starts=starts,
            parameters=DomainParameters.nominal(
                world, len(starts), torque_limit=limit.value, limit_by=limit.by
            ),
        )

    def take(self, rows: NDArray[np.int_]) -> Scenarios:
        """Return some of the scenarios."""
        return Scenarios(starts=self.starts[rows], parameters=self.parameters.take(rows))

    def tile(self, times: int) -> Scenarios:
        """Repeat all scenarios a number of times."""
        return Scenarios(
            starts=np.tile(self.starts, (times, 1)), parameters=self.parameters.tile(times)
        )


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Differences of robots and their worlds from what was planned for; none by default."""

    joints: Quantity = 0.0
    """Offset of each joint at the start [rad]."""
    turn: Quantity = 0.0
    """Angle by which the root is turned about a random axis at the start [rad]."""
    ground_friction: Quantity = GROUND_FRICTION
    """Sliding friction where the ground is a usual one; elsewhere it is scaled to the scene's."""
    supply: Quantity = 1.0
    """Share of the robot's nominal supply."""

    def sample(
        self,
        world: World,
        start: Array,
        n: int,
        rng: np.random.Generator,
        limit: TorqueLimit = FULL_TORQUE,
    ) -> Scenarios:
        """Draw scenarios from MuJoCo positions (nq,), of which the first is nominal.

        The torque limit is that of every servo.
        """
        starts = self._draw_starts(world, start, n, rng)
        friction = draw(self.ground_friction, rng, n) * (world.scene.friction / GROUND_FRICTION)
        supply = draw(self.supply, rng, n)
        friction[0], supply[0] = world.scene.friction, 1.0
        parameters = DomainParameters.nominal(
            world,
            n,
            friction=friction,
            voltage=supply * world.robot.supply_voltage,
            torque_limit=limit.value,
            limit_by=limit.by,
        )
        return Scenarios(starts=starts, parameters=parameters)

    def _draw_starts(self, world: World, start: Array, n: int, rng: np.random.Generator) -> Array:
        """Draw MuJoCo positions at the start, (n, nq), of which the first is the given one."""
        robot, layout = world.robot, world.robot.layout(world.model)
        starts = np.tile(start, (n, 1))
        if self.joints == 0.0 and self.turn == 0.0:
            return starts
        offset = draw(self.joints, rng, n, robot.n)
        axis = draw(RandomAxis(1.0), rng, n, 3)
        turn = quaternion.from_axis_angle(axis, draw(self.turn, rng, n))
        offset[0], turn[0] = 0.0, quaternion.IDENTITY
        starts[:, layout.qpos] = np.clip(starts[:, layout.qpos] + offset, robot.lower, robot.upper)
        root = starts[:, layout.root_orientation]  # a view
        root[:] = quaternion.multiply(turn, root)
        _rest_as(world, start, starts[1:])
        return starts


USUAL = Disturbance(
    joints=Normal(np.radians(3.0)),
    turn=Normal(np.radians(5.0)),
    ground_friction=Uniform(0.4, 1.2),
    supply=Uniform(11.0 / 12.0, 12.6 / 12.0),
)
"""What a motion has to bear."""


def _rest_as(world: World, start: Array, others: Array) -> None:
    """Put MuJoCo positions (N, nq) as high over what is under them as a start (nq,), in place.

    They are neither lifted off the ground nor pressed into it. Where there is no room for one
    under a table, for instance, it becomes more like the start, until there is.
    """
    layout = world.robot.layout(world.model)
    root = layout.root_qpos + 2
    if world.scene.is_flat:
        rest = lowest_point(world.model, start)
        others[:, root] += [rest - lowest_point(world.model, row) for row in others]
        return
    clearance = Clearance(world)
    under = float(world.scene.support(start[root - 2 : root + 1]))
    above = float(start[root] - clearance.rest_where(start)[root])
    for row in others:
        for share in ROOM_SHARES:
            nearer = _blend(layout, start, row, share)
            rested = clearance.rest(nearer, above, over=under)
            if abs(rested[root] - start[root]) < MOST_RAISED:
                row[:] = rested
                break
        else:
            row[:] = start


def _blend(layout: Layout, start: Array, other: Array, share: float) -> Array:
    """Go a share of the way from one lying robot to another, MuJoCo positions (nq,)."""
    blended = start + share * (other - start)
    orientation = layout.root_orientation
    blended[orientation] = quaternion.slerp(start[orientation], other[orientation], share)
    return blended
