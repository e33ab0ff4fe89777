"""Identification of one robot from flights of its own rises: CMA-ES on replays."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from humanoid_getup.library_environment import keep_matplotlib_out_of_home
from humanoid_getup.simulation.world import World
from robots.individual import Individual
from robots.quaternion import Array
from sim2real.identification.flight_replay import (
    FIGURES,
    LOADED,
    PLAIN,
    POPULATION,
    SUPPLY,
    Excerpt,
    Replayer,
)
from sim2real.identification.servo_fit import compute_reach
from sim2real.identification.supply_and_imu import find_imu_tilt, find_supply_resistance

STEPS = 160  # generations: a quarter for each model, an eighth for each refit
NEAR = 0.3  # first spread about an earlier result, as a share of that of `FIGURES`
PARTS = 4
BETTER = 0.9  # of the gap, below which friction by load has to bring it
MOST_TILT = np.radians(15.0)  # of the IMU's mounting
WRONG_JOINT, WRONG_GAP = 3.0, 0.03  # times the median joint's gap, and rad
MOST_LATE, FAR_MASS = 0.016, 0.25  # s; share of the mass


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
    reach = compute_reach(np.array(parts))
    figures = [FIGURES[name] for name in replayer.names]
    rows = list(zip(replayer.names, best.tolist(), reach.tolist(), figures, strict=True))
    if supply is not None:
        rows.append(("supply_resistance", max(supply[0], 0.0), supply[1], SUPPLY))
    individual = Individual(
        robot=world.robot.name,
        intervals={name: (value - half, value + half) for name, value, half, _ in rows},
        **{name: value for name, value, *_ in rows},
    )
    turned = find_imu_tilt(World(replace(world.robot, individual=individual), world.scene), flights)
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
