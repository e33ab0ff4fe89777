"""Identification of one robot from flights of its own rises: CMA-ES on replays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation
from scipy.stats import t as student

from drivers import Command, State, Twin
from drivers.flight_log.reader import FlightRecord
from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.reporting.replay import choose_supply, find_limit_mode
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.individual import Individual
from robots.kinematics import place
from robots.quaternion import Array
from robots.servo import LIMIT_MODES

LENGTH = 1.4  # s of each flight that are replayed, from the first torque on
LEAST_MOTION = 0.3  # rad by which some joint moves meanwhile
MOST_GAP = 0.1  # s between two cycles
MOST_ERROR = 0.3  # rad, at which an error is cut: a replay that lies elsewhere tells no more
POPULATION = 16
STEPS = 160  # generations: a quarter for each model, an eighth for each refit
NEAR = 0.3  # first spread about an earlier result, as a share of that of `FIGURES`
PARTS, CONFIDENCE = 4, 0.95
BETTER = 0.9  # of the gap, below which friction by load has to bring it
TURN_SCALE = 0.5  # s, by which rates are multiplied that are aligned beside unit vectors
MOST_TILT = np.radians(15.0)  # of the IMU's mounting
SUPPLY_WIDTHS = 0.0, 0.1, 0.2, 0.3, 0.4, 0.6  # s, over which a bus averages voltages
LEAST_CURRENT = 1.0  # A of the supply, by which it has to vary
LEAST_SHARE = 0.5  # of the voltage's variance that it explains
WRONG_JOINT, WRONG_GAP = 3.0, 0.03  # times the median joint's gap, and rad
MOST_LATE, FAR_MASS = 0.016, 0.25  # s; share of the mass


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


@dataclass(frozen=True, kw_only=True)
class RobotFit:
    """What sets a robot apart, and how far replays with it are from its flights."""

    individual: Individual
    """With 95 % intervals, of refits without parts of the flights."""
    not_identified: tuple[str, ...]
    """Figures that the flights leave open."""
    fitted_gap_mrad: float
    """Root mean square of the errors of joint angles along the fitted flights."""
    gap_mrad: float
    """The same along the flights that are held out; without any, along the fitted ones."""
    catalog_gap_mrad: float
    """That of the robot as described."""
    warnings: tuple[str, ...]
    """What speaks for another cause than the figures."""

    @property
    def is_better(self) -> bool:
        """Return whether the robot flew clearly more like this than as described."""
        return self.gap_mrad < BETTER * self.catalog_gap_mrad


def identify(
    world: World,
    flights: Sequence[Excerpt],
    held_out: Sequence[Excerpt] = (),
    *,
    steps: int = STEPS,
    advance: Callable[[float], None] = lambda _: None,
) -> RobotFit:
    """Fit the figures of a robot as described, and those of refits without parts of the flights.

    Friction by load is fitted if it is better along the flights that are held out, or without any
    along the others. The errors of neighbouring samples are alike, so that the curvature of the
    cost makes intervals about eight times too narrow.
    """
    parts_of = [np.arange(len(one.last)) * PARTS // len(one.last) for one in flights]
    part_of = np.concatenate(parts_of)  # of each measurement, (T,)
    judged, described = held_out or flights, Replayer(world, PLAIN)
    supply = find_supply_resistance(world.robot, flights, part_of)
    if supply is not None:
        wired = Individual(supply_resistance=max(supply[0], 0.0))
        world = World(world.robot.with_individual(wired), world.scene)
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
    if supply is not None:
        rows.append(("supply_resistance", max(supply[0], 0.0), supply[1], SUPPLY))
    individual = Individual(
        robot=world.robot.name,
        intervals={name: (value - half, value + half) for name, value, half, _ in rows},
        **{name: value for name, value, *_ in rows},
    )
    turned = _find_tilt(World(replace(world.robot, individual=individual), world.scene), flights)
    individual = replace(individual, imu_tilt=tuple(turned.tolist()))
    return RobotFit(
        individual=individual,
        not_identified=tuple(
            name
            for name, value, half, one in rows
            if half > one.open or value in {one.lower, one.upper} - {one.nominal}
        ),
        fitted_gap_mrad=replayer.measure(flights, best),
        gap_mrad=replayer.measure(judged, best),
        catalog_gap_mrad=described.measure(judged, nominal),
        warnings=tuple(find_warnings(world, individual, replayer.measure_joints(judged, best))),
    )


def find_supply_resistance(
    robot: Robot, excerpts: Sequence[Excerpt], part_of: np.ndarray
) -> tuple[float, float] | None:
    """Find the resistance of the supply and half its 95 % interval [Ω] from voltage and currents.

    A bus reads the voltages of all servos in turn, and their mean follows the current late: that
    is averaged over the time that fits best. None where the voltage hardly follows the current.
    """
    fits = [_compare_supply(robot, excerpts, width) for width in SUPPLY_WIDTHS]
    share, i, v = max(fits, key=lambda fit: fit[0])
    if share < LEAST_SHARE:
        return None
    found = [-float(i[k] @ v[k]) / float(i[k] @ i[k]) for k in (part_of != p for p in range(PARTS))]
    spread = float(np.std(found)) * np.sqrt(PARTS - 1)
    return float(np.mean(found)), float(spread * student.ppf(0.5 + 0.5 * CONFIDENCE, PARTS - 1))


def _compare_supply(
    robot: Robot, excerpts: Sequence[Excerpt], width: float
) -> tuple[float, Array, Array]:
    """Return how well voltage follows current averaged over a time [s], and both about a mean.

    That is the share of the voltage's variance that a straight line explains.
    """
    current, voltage = list[Array](), list[Array]()
    for one in excerpts:
        volts = np.array([state.voltage for state in one.states])
        torque = np.array([s.joint_current for s in one.states]) * robot.torque_per_ampere
        speed = robot.transmission.to_actuator(np.array([s.joint_vel for s in one.states]))
        drawn = robot.find_supply_current(np.maximum(volts, 1.0), torque, speed)
        count = max(round(width / robot.control_period), 1)
        drawn = uniform_filter1d(drawn, count, origin=(count - 1) // 2, mode="nearest")
        current.append(drawn - drawn.mean())
        voltage.append(volts - volts.mean())
    i, v = np.concatenate(current), np.concatenate(voltage)
    if not np.all(np.isfinite(v)) or not np.any(v) or np.ptp(i) < LEAST_CURRENT or i @ v >= 0.0:
        return 0.0, i, v
    return float((i @ v) ** 2 / ((i @ i) * (v @ v))), i, v


def _find_tilt(world: World, excerpts: Sequence[Excerpt]) -> Array:
    """Find the rotation vector from the IMU's described mounting to the true one [rad], (3,).

    Directions of gravity and rates that were measured are aligned with those of a twin, whose IMU
    has the same errors while it is accelerated.
    """
    pairs: list[tuple[Array, Array]] = []
    for one in excerpts:
        voltage, mode = float(one.parameters.voltage[0]), int(one.parameters.limit_by[0])
        twin = Twin(world, voltage=voltage, limit_by=LIMIT_MODES[mode])
        twin.place(one.start)
        with twin:
            for command, state in zip(one.commands, one.states, strict=True):
                twin.write(command)
                ours = twin.read()
                down = quaternion.gravity_in_body(np.array([ours.orientation, state.orientation]))
                pairs += [tuple(down), (TURN_SCALE * ours.gyro, TURN_SCALE * state.gyro)]
    ours, theirs = np.swapaxes(np.array(pairs), 0, 1)
    return Rotation.align_vectors(ours, theirs)[0].as_rotvec()


def find_warnings(world: World, found: Individual, joint_gaps: Array) -> Iterator[str]:
    """Find what speaks for another cause; gaps are those of the joints [rad], (n,)."""
    worst = int(joint_gaps.argmax())
    usual = float(np.median(np.delete(joint_gaps, worst)))
    if joint_gaps[worst] > max(WRONG_JOINT * usual, WRONG_GAP):
        yield (
            f"joint '{world.robot.joint_names[worst]}' is {1e3 * joint_gaps[worst]:.0f} mrad off, "
            f"the others {1e3 * usual:.0f} mrad: check its servo type, P gain, horn, zero and sign"
        )
    if abs(found.mass - 1.0) > FAR_MASS:
        yield f"mass is {found.mass:.2f} of the model's: weigh the robot, and correct its model"
    if found.delay > MOST_LATE:
        yield (
            f"targets act {1e3 * found.delay:.0f} ms late: check the latency of the port, and "
            "whether commands and measurements are logged by one clock"
        )
    if (tilt := float(np.linalg.norm(found.imu_tilt))) > MOST_TILT:
        yield (
            f"the torso turns {np.degrees(tilt):.0f}° otherwise than the IMU says: check its "
            "mounting, and zeros and signs of the joints"
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
