"""Identification of one robot from flights of its own rises: CMA-ES on replays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.stats import t as student

from drivers.flight_log.reader import FlightRecord
from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.reporting.replay import choose_supply, find_limit_mode
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import place
from robots.quaternion import Array

LENGTH = 1.4  # s of each flight that are replayed, from the first torque on
LEAST_MOTION = 0.3  # rad by which some joint moves meanwhile
MOST_GAP = 0.1  # s between two cycles
MOST_ERROR = 0.3  # rad, at which an error is cut: a replay that lies elsewhere tells no more
POPULATION = 16
STEPS = 160  # generations: a quarter for each model, an eighth for each refit
NEAR = 0.3  # first spread about an earlier result, as a share of that of `FIGURES`
PARTS, CONFIDENCE = 4, 0.95
BETTER = 0.9  # of the gap, below which friction by load has to bring it


class Figure(NamedTuple):
    """A global parameter of a robot."""

    nominal: float
    start: float  # mean and standard deviation of the first samples
    spread: float
    lower: float
    upper: float
    open: float  # half an interval beyond which it is not identified


FIGURES = {
    "strength": Figure(1.0, 1.0, 0.1, 0.4, 1.3, 0.05),  # share of torque and gain
    "friction": Figure(1.0, 1.0, 0.3, 0.0, 5.0, 0.4),  # share of dry friction
    "mass": Figure(1.0, 1.0, 0.03, 0.7, 1.4, 0.06),  # share
    "delay": Figure(0.0, 0.006, 0.006, 0.0, 0.05, 0.002),  # s, of targets
    "com": Figure(0.0, 0.0, 0.005, -0.04, 0.04, 0.005),  # m, center of mass of the torso, forward
    "load_friction": Figure(0.0, 0.1, 0.1, 0.0, 0.7, 0.1),  # of gears, per torque of the motor
}
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
            parameters=replace(nominal, voltage=np.full(POPULATION, supply)),
        )


class Replayer:
    """Replays flights with many values of some parameters at once."""

    def __init__(self, world: World, names: Sequence[str]) -> None:
        """Build as many robots as a population has."""
        self.names = tuple(names)
        self._loads_gears = LOADED[-1] in self.names
        self._world = World(_load_gears(world.robot), world.scene) if self._loads_gears else world
        self._sim = VecSim(self._world, POPULATION)
        self._qpos = self._world.robot.layout(self._world.model).qpos

    def measure(self, excerpts: Sequence[Excerpt], row: Array) -> float:
        """Measure the root mean square of the errors of joint angles with a row [mrad]."""
        errors = self.run(excerpts, np.tile(row, (POPULATION, 1)))[0]
        return 1e3 * float(np.sqrt(np.mean(errors**2)))

    def run(self, excerpts: Sequence[Excerpt], rows: Array) -> Array:
        """Replay with rows of parameters, (P, k); return replayed minus measured angles, (P, T, n).

        T goes through all excerpts. What was not measured has no error.
        """
        return np.concatenate([self._replay(each, rows) for each in excerpts], axis=1)

    def _replay(self, excerpt: Excerpt, rows: Array) -> Array:
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
        qpos = sim.advance(targets, 1, ("qpos",))["qpos"][:, excerpt.last]
        errors = np.nan_to_num(qpos[..., self._qpos] - excerpt.joint_pos, nan=0.0)
        errors[sim.diverged] = MOST_ERROR
        return np.clip(errors, -MOST_ERROR, MOST_ERROR)


def _load_gears(robot: Robot) -> Robot:
    """Return a robot of which all gears have a friction that follows the load."""
    joints = []
    for joint in robot.joints:
        own = joint.servo.model
        loaded = replace(own, load_friction=max(own.load_friction, 1e-9))
        joints.append(replace(joint, servo=replace(joint.servo, model=loaded)))
    return replace(robot, joints=tuple(joints))


@dataclass(frozen=True, kw_only=True)
class RobotFit:
    """Parameters of one robot, and how far replays with them are from its flights."""

    parameters: dict[str, float]
    """Those of `FIGURES`; friction by load, if it was chosen."""
    intervals: dict[str, tuple[float, float]]
    """95 % intervals, of refits without parts of the flights."""
    not_identified: tuple[str, ...]
    """Parameters that the flights leave open."""
    fitted_gap_mrad: float
    """Root mean square of the errors of joint angles along the fitted flights."""
    gap_mrad: float
    """The same along the flights that are held out; without any, along the fitted ones."""
    catalog_gap_mrad: float
    """That of the robot as described."""

    @property
    def is_better(self) -> bool:
        """Return whether the robot flew more like this than as described."""
        return self.gap_mrad < self.catalog_gap_mrad


def identify(
    world: World,
    flights: Sequence[Excerpt],
    held_out: Sequence[Excerpt] = (),
    *,
    steps: int = STEPS,
    advance: Callable[[float], None] = lambda _: None,
) -> RobotFit:
    """Fit the parameters of a robot, and those of refits without each part of the flights.

    Friction by load is fitted if it is better along the flights that are held out, or without any
    along the others. The errors of neighbouring samples are alike, so that the curvature of the
    cost makes intervals about eight times too narrow.
    """
    parts_of = [np.arange(len(one.last)) * PARTS // len(one.last) for one in flights]
    part_of = np.concatenate(parts_of)  # of each measurement, (T,)
    judged = held_out or flights
    plain, loaded = Replayer(world, PLAIN), Replayer(world, LOADED)
    start = np.array([one.start for one in FIGURES.values()])
    nominal = np.array([FIGURES[name].nominal for name in PLAIN])
    generations, again = steps // 4, steps // 8
    best = _fit(plain, flights, start[:-1], 1.0, generations, part_of >= 0, advance)
    with_load = _fit(loaded, flights, start, 1.0, generations, part_of >= 0, advance)
    replayer = plain
    if loaded.measure(judged, with_load) < BETTER * plain.measure(judged, best):
        replayer, best = loaded, with_load
    parts = [
        _fit(replayer, flights, best, NEAR, again, part_of != part, advance)
        for part in range(PARTS)
    ]
    # The cost has many small minima, from contacts: each fit ends in another one.
    best = np.mean([best, *parts], axis=0)
    spread = np.std(parts, axis=0) * np.sqrt(PARTS - 1)  # of a jackknife
    reach = spread * student.ppf(0.5 + 0.5 * CONFIDENCE, PARTS - 1)
    figures = [FIGURES[name] for name in replayer.names]
    rows = list(zip(replayer.names, best.tolist(), reach.tolist(), figures, strict=True))
    return RobotFit(
        parameters={name: value for name, value, *_ in rows},
        intervals={name: (value - half, value + half) for name, value, half, _ in rows},
        not_identified=tuple(
            name
            for name, value, half, one in rows
            if half > one.open or value in {one.lower, one.upper} - {one.nominal}
        ),
        fitted_gap_mrad=replayer.measure(flights, best),
        gap_mrad=replayer.measure(judged, best),
        catalog_gap_mrad=plain.measure(judged, nominal),
    )


def _fit(
    replayer: Replayer,
    flights: Sequence[Excerpt],
    start: Array,
    spread: float,
    generations: int,
    used: np.ndarray,
    advance: Callable[[float], None],
) -> Array:
    """Minimize the mean over time of the error of a posture, with the measurements in use, (T,)."""
    keep_matplotlib_out_of_home()  # cma imports it
    import cma

    figures = [FIGURES[name] for name in replayer.names]
    scale = np.array([one.spread for one in figures])
    bounds = [[getattr(one, end) / one.spread for one in figures] for end in ("lower", "upper")]
    options = {"popsize": POPULATION, "seed": 1, "verbose": -9, "bounds": bounds}
    evolution = cma.CMAEvolutionStrategy(start / scale, spread, options)
    for _ in range(generations):
        samples = evolution.ask()
        errors = replayer.run(flights, np.array(samples) * scale)[:, used]
        evolution.tell(samples, np.sqrt(np.mean(errors**2, axis=2)).mean(axis=1).tolist())
        advance(1)
    return evolution.result.xbest * scale
