"""Compare plans and policies on the same settled falls: success, time, load, impact, heat.

One attempt each, on the twin. The heat is that of the hottest servo after ten rises in a row, with
5 s of rest after each, from 25 °C.

    python benchmarks/compare_methods.py --ways plan robust --n 20 --seed 1 --json methods.json
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
import tyro
from msgspec.structs import asdict
from script import LOAD_FIGURES, LimitedOptions, do_pieces, write_results

from drivers import Twin
from humanoid_getup.benchmarks.rise import (
    BENCH_CLASSES,
    MeasuredRise,
    RisePiece,
    list_pieces,
    measure_rise,
    rise_once,
)
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import Fall, sample_falls
from humanoid_getup.experiments.judging.summary import RiseSummary, summarize
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.plan import Strategy

IN_A_ROW = 10  # rises whose heat adds up
REST = 5.0  # s between them, torque off
HEAT = "hottest_after_ten_rises_c"
FIGURES = ("n", "stood", *LOAD_FIGURES, "head_impact_m_s", HEAT)


@dataclass(frozen=True, kw_only=True)
class MethodOptions(LimitedOptions):
    """Options of this script."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    ways: tuple[str, ...] = ("plan", "robust")
    """Strategies: plan, nearest, straight, and policies by name or file."""


def main(options: MethodOptions) -> None:
    """Measure, and write the figures of every way."""
    rng = np.random.default_rng(options.seed)
    falls = sample_falls(options.load_world(), dict.fromkeys(BENCH_CLASSES, options.n), rng)
    firsts = range(0, len(falls) - IN_A_ROW + 1, IN_A_ROW)
    rows = [tuple(falls[first : first + IN_A_ROW]) for first in firsts]
    own = [*list_pieces(falls, options.seed).values(), *rows]
    pieces = [(way, piece) for way in options.ways for piece in own]
    found = do_pieces(partial(measure, options), pieces, options)
    cases = {}
    for k, way in enumerate(options.ways):
        results = found[k * len(own) : (k + 1) * len(own)]
        rises = [result for result in results if isinstance(result, MeasuredRise)]
        heat = summarize(result for result in results if isinstance(result, float))
        cases[way] = asdict(RiseSummary.of(rises)) | {HEAT: heat}
    result = options.describe("methods", len(falls)) | {"cases": cases}
    write_results(result, FIGURES, options.json)


def measure(
    options: MethodOptions, piece: tuple[str, RisePiece | tuple[Fall, ...]]
) -> MeasuredRise | float:
    """Rise in one way from a fall; from several, return the hottest servo's temperature [°C]."""
    way, own = piece
    strategy = make_strategies(options)[way]
    if isinstance(own, RisePiece):
        return measure_rise(strategy, own)
    return heat_up(strategy, own, options.seed)


@lru_cache(maxsize=1)
def make_strategies(options: MethodOptions) -> dict[str, Strategy]:
    """Make the strategies by the names of the ways."""
    world = options.load_world()
    limit, database = options.make_limit(world.robot), load_database(world.robot)
    settings = PlannerSettings(torque_limit=limit, threads=options.threads)
    return {way: make_strategy(world, way, settings, database=database) for way in options.ways}


def heat_up(strategy: Strategy, falls: tuple[Fall, ...], seed: int) -> float:
    """Rise and rest repeatedly; return the hottest servo's temperature at the end [°C]."""
    twin = Twin(strategy.world)
    simulation = twin.simulation
    temperature = simulation.temperature.copy()
    for number, fall in enumerate(falls):
        twin.place(fall.posture)
        simulation.temperature[:] = temperature
        session = SessionOptions(start_class=fall.start_class)
        rise_once(twin, strategy, [seed, 1, number], session)
        simulation.release()
        for _ in range(round(REST / twin.period)):
            simulation.step(simulation.steps_per_period)
            simulation.update_sensors(twin.period)
        temperature = simulation.temperature.copy()
    return float(temperature.max())


if __name__ == "__main__":
    main(tyro.cli(MethodOptions, description=__doc__))
