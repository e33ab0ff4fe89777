"""Strategies that play stored motions: one for every start, or the nearest."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from humanoid_getup.motions.motion import NO_END, Motion
from humanoid_getup.motions.motion_database import MotionDatabase, find_motion, load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, RiseStatus
from robots import FULL_TORQUE, Posture, TorqueLimit
from robots.arguments import expect
from robots.torque_limit import check_torque_limit


class StoredMotion:
    """Plays one motion as it is, for every start; the preflight may refuse it."""

    def __init__(
        self, world: World, motion: Motion | str | Path, *, torque_limit: TorqueLimit = FULL_TORQUE
    ) -> None:
        """Load one of the robot's motions by name, or an .npz file, or take a loaded motion."""
        expect("world", world, World, "a World, e.g. World(robot)")
        self.world, self.torque_limit = world, check_torque_limit(torque_limit, world.robot)
        is_loaded = isinstance(motion, Motion)
        self.motion = motion if is_loaded else find_motion(world.robot, str(motion))
        if not self.motion.rises:
            is_path = self.motion.end_class == NO_END
            end = "neither standing nor lying" if is_path else f"lying {self.motion.end_class}"
            raise ValueError(
                f"motion '{self.motion.name}' ends {end}, expected one that ends standing"
            )

    def __repr__(self) -> str:
        return f"StoredMotion({self.motion.name} in {self.world!r})"

    def plan(self, _start: Posture, _rng: np.random.Generator) -> Plan:
        """Plan to play the motion."""
        return Plan(status=RiseStatus.STORED, motion=self.motion)


class NearestMotion:
    """Plays the stored motion nearest to the start, from its beginning, as it is."""

    def __init__(
        self,
        world: World,
        database: MotionDatabase | None = None,
        *,
        torque_limit: TorqueLimit = FULL_TORQUE,
    ) -> None:
        """Select from a robot's own motions, or from others."""
        self.world, self.torque_limit = world, check_torque_limit(torque_limit, world.robot)
        self.database = load_database(world.robot) if database is None else database

    def plan(self, start: Posture, _rng: np.random.Generator) -> Plan:
        """Plan to play the motion."""
        nearest = self.database.select(start)[0]
        return Plan(status=RiseStatus.STORED, motion=nearest.motion, connection=nearest)
