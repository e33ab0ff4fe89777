"""Rises in disturbed worlds, by plans and policies that know the nominal one alone."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from script import RefusableRise

from drivers import Command, Twin
from humanoid_getup.benchmarks.rise import rise_once
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import Fall
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.scenes.ground import Slope
from humanoid_getup.scenes.scene import Scene, lay_at
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, TorqueLimit, quaternion
from robots.kinematics import lowest_point, place
from robots.quaternion import Array

OPEN_LOOP, FEEDBACK = "plan, open loop", "plan"
LIMB_SPREAD = math.radians(5.0)  # of joints that were moved after planning


@dataclass(frozen=True, kw_only=True)
class WorldChange:
    """Differences of a rise's world from the flat one of its plan; none by default.

    The robot lies with its head along +x, as `turn_head` lays it.
    """

    slope: float = 0.0
    """Angle by which the ground rises towards the head [rad]."""
    friction: float | None = None
    """Sliding friction of the ground."""
    mass: float = 1.0
    """Factor on the mass of every link."""
    strength: float = 1.0
    """Factor on torque and gain of a random servo."""
    start_angle: float = 0.0
    """Angle by which the robot is turned after planning [rad], and its joints moved by 5 deg
    (standard deviation), before it settles."""

    def disturb(self, world: World, fall: Fall, seed: list[int]) -> DisturbedRise:
        """Disturb a world and a fall; a seed makes it reproducible."""
        rng, robot = np.random.default_rng(seed), world.robot
        direction = rng.uniform(0.0, 2.0 * math.pi)
        strength = np.ones(robot.n)
        strength[int(rng.integers(robot.n))] = self.strength
        return DisturbedRise(
            world=self.build_world(world, direction),
            start=self.lay(world, turn_head(fall.posture), rng),
            strength=strength,
        )

    def build_world(self, world: World, _direction: float) -> World:
        """Build the disturbed world; a direction [rad] is for changes that have one."""
        surface = world.scene.surface
        if self.friction is not None:
            surface = replace(surface, friction=self.friction)
        name = f"{world.scene.name}, disturbed"
        scene = Scene(name=name, ground=Slope(angle=self.slope), surface=surface)
        disturbed = World(world.robot, scene)
        model = disturbed.model
        model.body_mass *= self.mass
        model.body_inertia *= self.mass
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return disturbed

    def lay(self, world: World, start: Posture, rng: np.random.Generator) -> Posture:
        """Lay a robot that was turned by `turn_head` on the disturbed ground."""
        if self.start_angle:
            start = _turn(world, start, self.start_angle, rng)
        slope = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -self.slope)
        return replace(
            start,
            position=quaternion.rotate(slope, start.position),
            orientation=quaternion.multiply(slope, start.orientation),
        )


DISTURBANCES = {
    "nominal": WorldChange(),
    "friction 0.3": WorldChange(friction=0.3),
    "slope +5 deg": WorldChange(slope=math.radians(5.0)),
    "one servo at 60 %": WorldChange(strength=0.6),
    "mass +10 %": WorldChange(mass=1.1),
    "start 10 deg off": WorldChange(start_angle=math.radians(10.0)),
}
"""Disturbances that every robot permits, by their names in tables."""


class WeakTwin(Twin):
    """A twin with weaker servos: they have a share of their torque and gain."""

    def __init__(self, world: World, start: Posture, strength: Array, voltage: float | None):
        """Build a twin in a world at a start; ``strength`` is the share of each servo, (n,)."""
        super().__init__(world, start, voltage=voltage)
        self._strength = strength

    def write(self, command: Command) -> Command:
        """Apply a command for one period with the servos' strength; return it as sent."""
        limit = np.minimum(command.torque_limit, self.robot.max_torque)
        weak = replace(
            command,
            torque_limit=limit * self._strength,
            gain_scale=command.gain_scale * self._strength,
        )
        sent = super().write(weak)
        return replace(sent, torque_limit=limit, gain_scale=command.gain_scale)


@dataclass(frozen=True, kw_only=True)
class SamePlan:
    """A strategy that returns the same plan for every start."""

    world: World
    torque_limit: TorqueLimit
    rise: Plan

    def plan(self, _start: Posture, _rng: np.random.Generator) -> Plan:
        """Return the plan."""
        return self.rise


@dataclass(frozen=True, kw_only=True)
class DisturbedRise:
    """One robot in one disturbed world."""

    world: World
    start: Posture
    strength: Array
    """Share of torque and gain that each servo has, (n,)."""
    voltage: float | None = None
    """Supply [V]; None for the nominal one."""

    def make_twin(self) -> Twin:
        """Make the twin that is to rise."""
        return WeakTwin(self.world, self.start, self.strength, self.voltage)


@dataclass(frozen=True, kw_only=True)
class DisturbedWays:
    """Ways to get up in disturbed worlds: plans, with feedback or not, and policies.

    Each fall is planned once, undisturbed. Preflight and supervision know the nominal world, the
    judge knows the true one.
    """

    planner: PlannedRise
    """Plans in the nominal, flat world."""
    policies: Mapping[str, Strategy]
    """Further strategies for that world, by name."""

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the ways."""
        return OPEN_LOOP, FEEDBACK, *self.policies

    def measure(
        self, fall: Fall, number: int, seed: int, changes: Mapping[str, WorldChange]
    ) -> list[RefusableRise]:
        """Rise from one of several falls in every disturbed world, in every way."""
        ways = self._plan(fall, [seed, 1, number]) | dict(self.policies)
        rises = list[RefusableRise]()
        for case, change in changes.items():
            trial = change.disturb(self.planner.world, fall, [seed, 2, number])
            options = SessionOptions(
                start_class=fall.start_class, support=trial.world.scene.support
            )
            for way, strategy in ways.items():
                rise = rise_once(trial.make_twin(), strategy, [seed, 3, number], options)
                rises.append(RefusableRise.of(rise, case=case, way=way, fall=number))
        return rises

    def _plan(self, fall: Fall, seed: list[int]) -> dict[str, Strategy]:
        """Plan a rise from a measured fall, to be played open loop and with feedback."""
        world, limit = self.planner.world, self.planner.torque_limit
        with Twin(world, turn_head(fall.posture)) as twin:
            start = estimate_posture(world, twin.read())
        rise = self.planner.plan(start, np.random.default_rng(seed))
        bare = rise.open_loop() or rise
        return {
            OPEN_LOOP: SamePlan(world=world, torque_limit=limit, rise=bare),
            FEEDBACK: SamePlan(world=world, torque_limit=limit, rise=rise),
        }


def turn_head(posture: Posture) -> Posture:
    """Turn and move a lying posture: its head points along +x, its root is above the origin."""
    return lay_at(posture, np.zeros(2), 0.0)


def _turn(world: World, start: Posture, angle: float, rng: np.random.Generator) -> Posture:
    """Turn a robot about a random horizontal axis, move its joints, and put it on the ground."""
    robot, heading = world.robot, rng.uniform(0.0, 2.0 * math.pi)
    axis = np.array([math.cos(heading), math.sin(heading), 0.0])
    joints = start.joint_pos + rng.normal(0.0, LIMB_SPREAD, robot.n)
    turned = replace(
        start,
        orientation=quaternion.multiply(quaternion.from_axis_angle(axis, angle), start.orientation),
        joint_pos=np.clip(joints, robot.lower, robot.upper),
    )
    lowest = lowest_point(world.model, place(robot, world.model, turned))
    return replace(turned, position=turned.position - np.array([0.0, 0.0, lowest]))
