"""Replays of the first moments of flights, with many values of a robot's figures at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from drivers import Command, State
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.reporting.replay import choose_supply, find_limit_mode
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.individual import Individual
from robots.kinematics import place
from robots.quaternion import Array

LENGTH = 1.4  # s of each flight that are replayed, from the first torque on
LEAST_MOTION = 0.3  # rad by which some joint moves meanwhile
MOST_GAP = 0.1  # s between two cycles
MOST_ERROR = 0.3  # rad, at which an error is cut: a replay that lies elsewhere tells no more
POPULATION = 16


class Figure(NamedTuple):
    """A figure of a robot, as of `Individual`."""

    nominal: float
    start: float  # mean and standard deviation of the first samples
    spread: float
    lower: float
    upper: float
    open: float  # half an interval beyond which it is not identified


FIGURES = {
    "strength": Figure(1.0, 1.0, 0.1, 0.4, 1.3, 0.05),
    "friction": Figure(1.0, 1.0, 0.3, 0.0, 5.0, 0.4),
    "mass": Figure(1.0, 1.0, 0.03, 0.3, 2.0, 0.06),
    "delay": Figure(0.0, 0.006, 0.006, 0.0, 0.06, 0.002),
    "com": Figure(0.0, 0.0, 0.005, -0.04, 0.04, 0.005),
    "load_friction": Figure(0.0, 0.1, 0.1, 0.0, 0.7, 0.1),
}
SUPPLY = Figure(0.0, 0.0, 0.0, 0.0, 10.0, 0.05)
LOADED = tuple(FIGURES)
PLAIN = LOADED[:-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class Excerpt:
    """The first moments of a flight with torque."""

    start: Posture
    target: Array
    """Joint targets at each physics step [rad], (S, n)."""
    last: np.ndarray
    """Last physics step before each measurement, (T,)."""
    joint_pos: Array
    """Measured joint angles [rad], (T, n)."""
    states: tuple[State, ...]
    """Measurements, (T,)."""
    commands: tuple[Command, ...]
    """What was sent before each of them, (T,)."""
    parameters: DomainParameters
    """Nominal ones, with the flight's torque limit and supply."""

    @staticmethod
    def of(record: FlightRecord, world: World) -> Excerpt:
        """Cut a flight; a `ValueError` names one without a rise."""
        robot, owner = world.robot, f"flight log {record.path}"
        record.check_robot(robot)
        if not record.cycles:
            raise ValueError(f"{owner}: it has no cycle, expected a rise")
        sent, time = record.sent, record.time
        driven = np.any(sent["torque_limit"] > 0.0, axis=1) & np.all(sent["gain_scale"] == 1.0, 1)
        first = int(driven.argmax())
        if not driven[first]:
            raise ValueError(f"{owner}: no cycle has torque at full gain, expected a rise")
        limit = sent["torque_limit"][first]
        stays = driven & np.all(sent["torque_limit"] == limit, axis=1)
        stays &= (time <= time[first] + LENGTH) & (np.diff(time, prepend=time[0]) <= MOST_GAP)
        stays[: first + 1] = True
        end = len(time) if stays.all() else int(stays.argmin())
        angle = record.state["joint_pos"][first:end]
        if not np.any(np.ptp(angle, axis=0) >= LEAST_MOTION):
            raise ValueError(
                f"{owner}: no joint moves by {LEAST_MOTION} rad in its first {LENGTH} s with "
                "torque, expected a rise"
            )
        steps = np.rint(np.diff(time[first:end]) / world.model.opt.timestep).astype(int)
        by, supply = find_limit_mode(record), choose_supply(record, robot)
        nominal = DomainParameters.nominal(
            world, POPULATION, torque_limit=float(limit.max()), limit_by=by
        )
        return Excerpt(
            start=record.start or estimate_posture(world, record.measurement(first)),
            target=np.repeat(sent["joint_pos"][first : end - 1], steps, axis=0),
            last=np.maximum(np.cumsum(steps) - 1, 0),
            joint_pos=angle[1:],
            states=tuple(record.measurement(k) for k in range(first + 1, end)),
            commands=tuple(record.command(k) for k in range(first, end - 1)),
            parameters=replace(nominal, voltage=np.full(POPULATION, supply)),
        )


class Replayer:
    """Replays flights with many values of some parameters at once."""

    def __init__(self, world: World, names: Sequence[str]) -> None:
        """Build as many robots as a population has."""
        self.names = tuple(names)
        self._loads_gears = LOADED[-1] in self.names
        loaded = replace(world.robot, individual=Individual(load_friction=1e-9))
        self._world = World(loaded, world.scene) if self._loads_gears else world
        self._sim = VecSim(self._world, POPULATION)
        self._qpos = self._world.robot.layout(self._world.model).qpos

    def measure(self, excerpts: Sequence[Excerpt], row: Array) -> float:
        """Measure the root mean square of the errors of joint angles with a row [mrad]."""
        return 1e3 * float(np.sqrt(np.mean(self.measure_joints(excerpts, row) ** 2)))

    def measure_joints(self, excerpts: Sequence[Excerpt], row: Array) -> Array:
        """Measure the root mean square of the errors of each joint with a row [rad], (n,)."""
        errors = self.run(excerpts, np.tile(row, (POPULATION, 1)))[0]
        return np.sqrt(np.mean(errors**2, axis=0))

    def run(self, excerpts: Sequence[Excerpt], rows: Array) -> Array:
        """Replay with rows of parameters, (P, k); return replayed minus measured angles, (P, T, n).

        T goes through all excerpts. What was not measured has no error.
        """
        return np.concatenate([self._replay(each, rows) for each in excerpts], axis=1)

    def _replay(self, excerpt: Excerpt, rows: Array) -> Array:
        qpos = self._simulate(excerpt, rows)[:, excerpt.last]
        errors = np.nan_to_num(qpos[..., self._qpos] - excerpt.joint_pos, nan=0.0)
        errors[self._sim.diverged] = MOST_ERROR
        return np.clip(errors, -MOST_ERROR, MOST_ERROR)

    def _simulate(self, excerpt: Excerpt, rows: Array) -> Array:
        """Simulate with rows of parameters, (P, k); return MuJoCo positions, (P, S, nq)."""
        sim, model, nominal = self._sim, self._world.model, excerpt.parameters
        values = {name: np.full(POPULATION, one.nominal) for name, one in FIGURES.items()}
        values |= dict(zip(self.names, rows.T, strict=True))
        strength, friction, mass, delay, com, load = values.values()
        parameters = replace(
            nominal,
            strength=nominal.strength * strength[:, None],
            friction_loss=friction,
            mass=nominal.mass * mass[:, None],
            com_shift=com[:, None] * np.array([1.0, 0.0, 0.0]),
        )
        if self._loads_gears:  # friction scales it, too
            sim.gears.added_share = (load / np.maximum(friction, 1e-3))[:, None]
        sim.set_parameters(sim.everyone, parameters)
        start = place(self._world.robot, model, excerpt.start)
        sim.place(sim.everyone, np.tile(start, (POPULATION, 1)))
        held = np.vstack([excerpt.start.joint_pos, excerpt.target])
        due = np.maximum(np.arange(1, len(held)) - delay[:, None] / model.opt.timestep, 0.0)
        before = np.floor(due).astype(int)
        share, after = (due - before)[..., None], np.minimum(before + 1, len(held) - 1)
        targets = (1.0 - share) * held[before] + share * held[after]
        return sim.advance(targets, 1, ("qpos",))["qpos"]
