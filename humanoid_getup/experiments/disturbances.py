"""Disturbances: differences of robots and their worlds from the planned ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, TorqueLimit, quaternion
from robots.body.overlap import DEEP, overlaps_at
from robots.ground import GROUND_FRICTION
from robots.individual import Individual
from robots.kinematics import find_carriers, lowest_point
from robots.quaternion import Array
from robots.robot import Layout
from robots.servo import PWM


@dataclass(frozen=True)
class Uniform:
    """A uniform distribution between two bounds."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return rng.uniform(self.lower, self.upper, shape)


@dataclass(frozen=True)
class LogUniform:
    """A distribution that is uniform between the logarithms of two bounds."""

    lower: float
    upper: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return np.exp(rng.uniform(np.log(self.lower), np.log(self.upper), shape))


@dataclass(frozen=True)
class Normal:
    """A normal distribution about zero."""

    deviation: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        return rng.normal(0.0, self.deviation, shape)


@dataclass(frozen=True)
class RandomAxis:
    """Vectors of one length in random directions."""

    length: float

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw vectors (..., 3)."""
        axis = rng.normal(size=shape)
        return self.length * axis / np.linalg.norm(axis, axis=-1, keepdims=True)


@dataclass(frozen=True)
class Mixture:
    """One quantity with a given probability, else another one."""

    probability: float
    one: Quantity
    other: Quantity

    def draw(self, rng: np.random.Generator, *shape: int) -> Array:
        """Draw numbers of a shape."""
        chosen = rng.random(shape) < self.probability
        return np.where(chosen, draw(self.one, rng, *shape), draw(self.other, rng, *shape))


Quantity = float | Uniform | LogUniform | Normal | RandomAxis | Mixture


def draw(quantity: Quantity, rng: np.random.Generator, *shape: int) -> Array:
    """Draw numbers of a shape; a constant quantity is repeated."""
    if isinstance(quantity, int | float):
        return np.full(shape, float(quantity))
    return quantity.draw(rng, *shape)


ROOM_SHARES = (1.0, 0.5, 0.25, 0.1)  # of a disturbance, tried in this order
JOINT_SHARES = np.array([1.0, -1.0, 0.5, -0.5, 0.25, -0.25, 0.0])
"""Of a joint's offset, tried in this order where it puts limbs into each other."""
GRIP = 1.2  # times the friction by which a robot just does not slide off a slope
LEAST_SHARE = 0.05  # of a figure of which an interval is known
MOST_DELAY = 0.04  # s, of targets or measurements
MOST_RAISED = 0.04  # m by which a disturbance may raise or lower a robot


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenarios:
    """Start, domain parameters and world of each of N robots."""

    starts: Array
    """MuJoCo positions at the start, at rest, (N, nq)."""
    parameters: DomainParameters

    def __len__(self) -> int:
        return len(self.starts)

    @staticmethod
    def nominal(world: World, starts: Array, limit: TorqueLimit = FULL_TORQUE) -> Scenarios:
        """Make undisturbed scenarios from MuJoCo positions (N, nq) or (nq,)."""
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
    """Differences of robots and their worlds from the planned ones; none by default."""

    joints: Quantity = 0.0
    """Offset of each joint at the start [rad]."""
    turn: Quantity = 0.0
    """Angle by which the root is turned about a random axis at the start [rad]."""
    ground_friction: Quantity = GROUND_FRICTION
    """Sliding friction on ordinary ground; in other scenes it is scaled to theirs."""
    friction: Quantity | None = None
    """Sliding friction of every contact, in any scene; None for that of the ground."""
    supply: Quantity = 1.0
    """Share of the robot's nominal supply."""
    voltage: float | None = None
    """Supply [V]; None for a share of the nominal one."""
    mass: Quantity = 1.0
    """Factor on the mass of the robot."""
    link_mass: Quantity = 1.0
    """Further factor on the mass of each link."""
    com_shift: Quantity = 0.0
    """Shift of the torso's center of mass along each axis [m]."""
    torque_share: Quantity = 1.0
    """Torque limit as a share of the stall torque."""
    by_pwm: float = 0.0
    """Probability that the torque limit acts on the PWM; else as it does on the robot."""
    strength: Quantity = 1.0
    """Factor on gain and torque of every servo."""
    weak_servo: Quantity = 1.0
    """Further factor on the strength of one random servo."""
    weak_share: float = 1.0
    """Probability of a weak servo."""
    armature: Quantity = 1.0
    """Factor on the rotor inertia of all servos."""
    friction_loss: Quantity = 1.0
    """Factor on the dry friction of all joints."""
    action_delay: Quantity = 0.0
    """Delay of targets [s]."""
    split_delay: Quantity = 0.0
    """Delay of targets plus that of measurements, split at random, each at most 0.04 s [s]."""
    joint_offset: Quantity = 0.0
    """Calibration error of each joint [rad]."""
    backlash: Quantity = 0.0
    """Of each gear, from end to end [rad]."""
    imu_tilt: Quantity = 0.0
    """Mounting error of the IMU, a small rotation vector [rad]."""
    gyro_bias: Quantity = 0.0
    """[rad/s], a vector"""

    def on_slope(self, scene: Scene) -> Disturbance:
        """Return those of a slope: with friction by which a robot can rest on it."""
        least = GRIP * math.tan(abs(scene.slope)) * GROUND_FRICTION / scene.surface.friction
        drawn = self.ground_friction
        if not isinstance(drawn, Uniform) or drawn.lower >= least:
            return self
        return replace(self, ground_friction=Uniform(least, max(least, drawn.upper)))

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
        parameters = self.draw(world, n, rng, limit)
        first = DomainParameters.nominal(world, 1, torque_limit=limit.value, limit_by=limit.by)
        parameters.put(np.arange(1), first)
        return Scenarios(starts=starts, parameters=parameters)

    def draw(
        self, world: World, n: int, rng: np.random.Generator, limit: TorqueLimit = FULL_TORQUE
    ) -> DomainParameters:
        """Draw the domain parameters of n robots; a constant quantity draws nothing.

        What is known of an individual is drawn from its intervals.
        """
        return self._known_of(world.robot.individual)._draw(world, n, rng, limit)

    def _known_of(self, own: Individual) -> Disturbance:
        """Return it with the intervals of an individual in place of its own widths."""
        names = {"mass": "mass", "strength": "strength", "friction": "friction_loss"}
        known: dict[str, Any] = {
            name: Uniform(*np.maximum(own.relative(figure), LEAST_SHARE).tolist())
            for figure, name in names.items()
            if figure in own.intervals
        }
        if "com" in own.intervals:
            known["com_shift"] = Uniform(*(end - own.com for end in own.intervals["com"]))
        return replace(self, **known) if known else self

    def _draw(
        self, world: World, n: int, rng: np.random.Generator, limit: TorqueLimit
    ) -> DomainParameters:
        robot = world.robot
        p = DomainParameters.nominal(world, n, torque_limit=limit.value, limit_by=limit.by)
        p.torque_limit[:] *= draw(self.torque_share, rng, n)
        p.strength[:] = draw(self.strength, rng, n, robot.n)
        if self.weak_share > 0.0 and self.weak_servo != 1.0:
            weak = np.ones(n, dtype=bool)
            if self.weak_share < 1.0:
                weak = rng.random(n) < self.weak_share
            which = rng.integers(0, robot.n, n)
            p.strength[weak, which[weak]] *= draw(self.weak_servo, rng, int(weak.sum()))
        p.armature[:] = draw(self.armature, rng, n)
        if self.split_delay != 0.0:
            delay, part = draw(self.split_delay, rng, n), rng.random(n)
            p.action_delay[:] = np.minimum(delay * part, MOST_DELAY)
            p.sensor_delay[:] = np.minimum(delay * (1.0 - part), MOST_DELAY)
        p.action_delay[:] += draw(self.action_delay, rng, n)
        p.mass[:] = draw(self.mass, rng, n, 1) * draw(self.link_mass, rng, n, world.model.nbody)
        p.com_shift[:] = draw(self.com_shift, rng, n, 3)
        if self.friction is not None:
            p.friction[:] = draw(self.friction, rng, n)
        elif self.ground_friction != GROUND_FRICTION:
            of_ground = draw(self.ground_friction, rng, n)
            p.friction[:] = of_ground * (world.scene.surface.friction / GROUND_FRICTION)
        if self.voltage is None:
            p.voltage[:] = draw(self.supply, rng, n) * robot.supply_voltage
        else:
            p.voltage[:] = self.voltage
        if self.by_pwm > 0.0:
            p.limit_by[rng.random(n) < self.by_pwm] = PWM
        p.friction_loss[:] = draw(self.friction_loss, rng, n)
        p.joint_offset[:] = draw(self.joint_offset, rng, n, robot.n)
        p.backlash[:] = draw(self.backlash, rng, n)
        p.imu_tilt[:] = draw(self.imu_tilt, rng, n, 3)
        p.gyro_bias[:] = draw(self.gyro_bias, rng, n, 3)
        return p

    def _draw_starts(self, world: World, start: Array, n: int, rng: np.random.Generator) -> Array:
        """Draw MuJoCo positions at the start, (n, nq), of which the first is the given one."""
        robot, layout = world.robot, world.robot.layout(world.model)
        starts = np.tile(start, (n, 1))
        if self.joints == 0.0 and self.turn == 0.0:
            return starts
        offset = draw(self.joints, rng, n, robot.n)
        axis = draw(RandomAxis(1.0), rng, n, 3)
        turn = quaternion.from_axis_angle(axis, draw(self.turn, rng, n))
        turn[0] = quaternion.IDENTITY
        _turn_joints(world, starts[1:], offset[1:])
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
"""Disturbances that a motion has to withstand."""


def _turn_joints(world: World, starts: Array, offsets: Array) -> None:
    """Add as much of offsets (N, n) to the joints of starts (N, nq) as limbs permit, in place."""
    robot, model, data = world.robot, world.model, mujoco.MjData(world.model)
    joints, carries = robot.layout(model).qpos, find_carriers(robot, model)
    for start, offset in zip(starts, offsets, strict=True):
        before, tried = start[joints].copy(), np.zeros(robot.n, dtype=int)
        most = overlaps_at(model, start, data) + DEEP
        while True:
            wished = before + JOINT_SHARES[tried] * offset
            start[joints] = np.clip(wished, robot.lower, robot.upper)
            ones, others = np.nonzero(overlaps_at(model, start, data) > most)
            colliding = np.any(carries[ones] ^ carries[others], axis=0)
            colliding &= tried < len(JOINT_SHARES) - 1
            if not colliding.any():
                break
            tried += colliding


def _rest_as(world: World, start: Array, others: Array) -> None:
    """Lift MuJoCo positions (N, nq) to the clearance of a start (nq,), in place.

    They are neither lifted off the ground nor pressed into it. If there is no room for a disturbed
    robot, for instance under a table, it is interpolated towards the start until there is.
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
    """Interpolate between two lying robots by a share, MuJoCo positions (nq,)."""
    blended = start + share * (other - start)
    orientation = layout.root_orientation
    blended[orientation] = quaternion.slerp(start[orientation], other[orientation], share)
    return blended
