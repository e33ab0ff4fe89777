"""Rises of a robot that is weaker, stickier and badly wired, planned for it as described or known.

The true robot has 0.8 of the strength (`--strength`), 1.6 of the dry friction, friction by load of
0.1, and its battery and wires have 0.15 Ω. It is identified from two flights. Each fall is planned
and judged by the preflight for the robot as described, and as identified; every plan is played by
the true robot, also a refused one. A policy rises beside them.

    python benchmarks/rise_identified.py --n 10 --seed 65 --json identified.json
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import tyro
from disturbed_worlds import SamePlan
from identify_robots import FITTED, HELD_OUT, fly
from script import LimitedOptions, do_pieces, write_results

from drivers import Twin
from humanoid_getup.benchmarks.rise import BENCH_CLASSES, rise_once
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.falls import Fall, sample_falls
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.playback.estimation import estimate_posture
from humanoid_getup.playback.preflight import preflight
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import make_strategy
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots.individual import Individual
from sim2real.identification.flight_fit import identify

TRUTH = Individual(strength=0.8, friction=1.6, load_friction=0.1, supply_resistance=0.15)
FIGURES = ("n", "planned", "passed", "passed_stood", "false_passes", "false_refusals", "stood_95")


@dataclass(frozen=True, kw_only=True)
class IdentifiedOptions(LimitedOptions):
    """Options of this script."""

    n: int = 20
    """Falls of each class: supine, prone, lateral."""
    policy: str = "robust"
    """Policy beside the plans."""
    strength: float = 0.8
    """Share of torque and gain that the true robot has."""

    @property
    def truth(self) -> Individual:
        """Return the true robot."""
        return replace(TRUTH, strength=self.strength)


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A rise of the true robot."""

    known: str
    fall: int
    start_class: str
    planned: bool = False
    passed: bool = False
    stood: bool = False


def main(options: IdentifiedOptions) -> None:
    """Identify the robot, and rise from every fall in every way."""
    world = options.load_world()
    true = make_world(world, options.truth)
    flights = [fly(world, options.truth, motion) for motion in (FITTED, HELD_OUT)]
    fit = identify(world, flights[:1], flights[1:])
    known = {"as described": Individual(), "as identified": fit.individual}
    rng = np.random.default_rng(options.seed)
    falls = sample_falls(true, dict.fromkeys(BENCH_CLASSES, options.n), rng)
    rise = partial(rise_from, options, known)
    trials = [trial for group in do_pieces(rise, [*enumerate(falls)], options) for trial in group]
    ways = dict.fromkeys(trial.known for trial in trials)
    cases = {way: summarize([trial for trial in trials if trial.known == way]) for way in ways}
    result = options.describe("rise_identified", len(falls)) | {"cases": cases, "fit": fit}
    write_results(result | {"trials": trials}, FIGURES, options.json)


def make_world(world: World, individual: Individual) -> World:
    """Make the world of an individual."""
    return World(world.robot.with_individual(individual), world.scene)


def summarize(trials: Sequence[Trial]) -> dict[str, Any]:
    """Count what the preflight passed and refused, and what stood."""
    passed, stood = (np.array([getattr(t, name) for t in trials]) for name in ("passed", "stood"))
    low, high = wilson_interval(int(np.sum(passed & stood)), max(int(passed.sum()), 1))
    return {
        "n": len(trials),
        "planned": sum(trial.planned for trial in trials),
        "passed": int(passed.sum()),
        "passed_stood": int(np.sum(passed & stood)),
        "false_passes": int(np.sum(passed & ~stood)),
        "false_refusals": int(np.sum(~passed & stood)),
        "stood_95": f"{low:.0%} to {high:.0%}",
    }


def rise_from(
    options: IdentifiedOptions, known: dict[str, Individual], piece: tuple[int, Fall]
) -> list[Trial]:
    """Rise from a fall, by its number, as planned for each robot that is known."""
    number, fall = piece
    true = make_world(options.load_world(), options.truth)
    with Twin(true, fall.posture) as twin:
        start = estimate_posture(true, twin.read())

    def play(strategy: Strategy) -> bool:
        session = SessionOptions(start_class=fall.start_class, preflight=False)
        return rise_once(Twin(true, fall.posture), strategy, [number], session).stood

    trials = []
    for name, individual in known.items():
        planner = make_planner(options, individual)
        world, limit = planner.world, planner.torque_limit
        plan = planner.plan(start, np.random.default_rng([options.seed, number]))
        trial = Trial(known=name, fall=number, start_class=fall.start_class)
        if plan.motion is not None:
            voltage = world.robot.supply_voltage
            verdict = preflight(
                world, plan.motion, voltage=voltage, torque_limit=limit, start=start
            )
            stood = play(SamePlan(world=world, torque_limit=limit, rise=plan))
            trial = replace(trial, planned=True, passed=verdict.passed, stood=stood)
        trials.append(trial)
    stood = play(make_policy(options))
    policy = Trial(known=options.policy, fall=number, start_class=fall.start_class)
    return [*trials, replace(policy, planned=True, passed=True, stood=stood)]


@lru_cache
def make_planner(options: IdentifiedOptions, individual: Individual) -> PlannedRise:
    """Make the planner of an individual."""
    world = make_world(options.load_world(), individual)
    limit = options.make_limit(world.robot)
    settings = PlannerSettings(torque_limit=limit, threads=options.threads)
    return PlannedRise(world, load_database(world.robot), settings)


@lru_cache
def make_policy(options: IdentifiedOptions) -> Strategy:
    """Make the policy beside the plans, for the true robot."""
    world = make_world(options.load_world(), options.truth)
    return make_strategy(world, options.policy, PlannerSettings(threads=options.threads))


if __name__ == "__main__":
    main(tyro.cli(IdentifiedOptions, description=__doc__))
