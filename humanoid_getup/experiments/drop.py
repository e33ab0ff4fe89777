"""Drops: robots that fall with torque off until they settle."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.scenes.scene import ANYWHERE, StartRegion
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.kinematics import place
from robots.quaternion import Array

DROP_HEIGHT = 0.02  # m under the lowest point
HIGH = 1.0  # m, while joint angles are drawn
SPAWN_OVERLAP = 0.001  # m of self-collision that a drop may begin with
MOST_SAMPLES = 10_000
MOST_MISSES = 300  # samples that are free, but outside their region
SETTLED_TIME = 0.25  # s for which no coordinate is faster
FIRST_CHECK, NEXT_CHECK = 3.0, 1.0  # s from the drop, and between checks of those that still move
LONGEST_FALL = 10.0  # s after which a robot that still moves is left out


class FallError(ValueError):
    """Falls do not lead to the requested postures."""


class Drops:
    """Drops batches of robots of one world with torque off."""

    def __init__(
        self, world: World, count: int, *, threads: int = 0, physics: PhysicsEngine = MUJOCO
    ) -> None:
        """Prepare for batches of a size; 0 threads are one per processor."""
        self.world, self.count = world, count
        self._sim = VecSim(world, count, threads=threads, physics=physics)

    def drop(
        self,
        settled_speed: float,
        rng: np.random.Generator,
        regions: Sequence[StartRegion] = (),
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Drop the robots in random postures, and let them settle.

        A robot has settled when all its coordinates are slower than a speed [rad/s, m/s]. They are
        dropped in ``regions`` of the scene, or in all of them.

        Returns:
            Final MuJoCo positions (N, nq), and which robots settled, (N,).
        """
        drops = DropSampler(self.world, regions or self.world.scene.starts or (ANYWHERE,))
        qpos = np.array([drops.sample(rng) for _ in self._sim.everyone])
        return self.settle(qpos, settled_speed)

    def settle(
        self, qpos: Array, settled_speed: float, longest: float = LONGEST_FALL
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Let robots settle from MuJoCo positions (N, nq) at rest; return as `drop` does."""
        sim, world, qpos = self._sim, self.world, qpos.copy()
        # The fewest control periods that make a whole number of physics steps.
        steps = Fraction(sim.robot.control_period / sim.model.opt.timestep)
        hold = steps.limit_denominator(1000).numerator
        sim.set_parameters(sim.everyone, DomainParameters.nominal(world, sim.n, torque_limit=0.0))
        sim.place(sim.everyone, qpos)
        sample_time = hold * world.model.opt.timestep
        window = round(SETTLED_TIME / sample_time)
        moving, time, duration = sim.everyone, 0.0, FIRST_CHECK
        while time < longest - 1e-9 and len(moving):
            targets = np.zeros((len(moving), round(duration / sample_time), world.robot.n))
            went = sim.advance(targets, hold, ("qpos",), moving)["qpos"]
            time, duration = time + duration, NEXT_CHECK
            qpos[moving] = went[:, -1]
            speed = np.abs(np.diff(went[:, -window:], axis=1)).max(axis=(1, 2)) / sample_time
            moving = moving[(speed >= settled_speed) | sim.diverged[moving]]
        settled = ~np.isin(sim.everyone, moving)
        return qpos, settled


class DropSampler:
    """Draws postures in which robots are dropped, just above the ground or an obstacle."""

    def __init__(self, world: World, regions: Sequence[StartRegion]) -> None:
        self._world, self._regions = world, regions
        self._clearance = Clearance(world)
        self._root = world.robot.layout(world.model).root_qpos

    def sample(self, rng: np.random.Generator) -> Array:
        """Sample joints anywhere in their range, free of self-collision, in any orientation.

        In a scene with start regions, orientation and place are near to those of a region.

        Returns:
            MuJoCo positions, (nq,).
        """
        robot, model = self._world.robot, self._world.model
        heights: list[float] = []
        for _ in range(MOST_SAMPLES):
            if len(heights) == MOST_MISSES:
                break
            region = rng.choice(len(self._regions)) if len(self._regions) > 1 else 0
            at, orientation = self._regions[region].sample(rng)
            posture = Posture(
                position=np.array([*at, HIGH]),
                orientation=orientation,
                joint_pos=rng.uniform(robot.lower, robot.upper),
            )
            qpos = place(robot, model, posture)
            if self._clearance.measure_self_overlap(qpos) < SPAWN_OVERLAP:
                lowest = self._regions[region].z[0]  # on a shelf, not under it
                qpos = self._clearance.rest(qpos, DROP_HEIGHT, over=lowest)
                if self._regions[region].spans(qpos[self._root : self._root + 3]):
                    return qpos
                heights.append(float(qpos[self._root + 2]))
        if not heights:
            raise FallError(
                f"robot '{robot.name}' collides with itself in {MOST_SAMPLES} random postures"
            )
        raise FallError(
            f"scene '{self._world.scene.name}' has no place for robot '{robot.name}' where it "
            f"starts: over what is there its torso is at {min(heights):.2f} to {max(heights):.2f} "
            "m (expected: starts whose z spans that height)"
        )
