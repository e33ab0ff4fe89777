"""Play every stored motion: time, load, lowest torque limit, and robustness.

Each from its own start: undisturbed, under falling torque limits, and disturbed (start angles by 3°
and the root by 5°, standard deviations; friction 0.4 to 1.2, supply 11.0 to 12.6 V, uniform).

    python benchmarks/play_motions.py --n 50 --json motions.json
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import msgspec
import numpy as np
import tyro
from script import LOAD_FIGURES, Options, do_pieces, write_results

from drivers import RunReport, SafetyGuard, Twin
from humanoid_getup.experiments.disturbances import USUAL, Scenarios
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.motion import MIRRORED_SUFFIX, Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.play import MotionPlayer, hold_time
from humanoid_getup.playback.simulated_play import has_succeeded, play_in_simulation
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots.kinematics import read_posture
from robots.quaternion import Array

FIGURES = (*LOAD_FIGURES, "lowest_torque_limit_nm", "disturbed_succeeded", "disturbed_n")


@dataclass(frozen=True, kw_only=True)
class MotionOptions(Options):
    """Options of this script."""

    n: int = 50
    """Disturbed plays of each motion."""
    motions: tuple[str, ...] = ()
    """Names of motions; default: all but mirror images."""


def main(options: MotionOptions) -> None:
    """Measure, and write the figures of every motion."""
    stored = load_database(options.load_robot()).motions
    own = [motion for motion in stored if not motion.name.endswith(MIRRORED_SUFFIX)]
    pieces = [
        MotionPiece(motion=motion, number=number, seed=options.seed, each=options.n)
        for number, motion in enumerate(own)
        if not options.motions or motion.name in options.motions
    ]
    found = do_pieces(partial(play_motion, options), pieces, options)
    cases = {piece.motion.name: figures for piece, figures in zip(pieces, found, strict=True)}
    result = options.describe("motions", options.n) | {"cases": cases}
    write_results(result, FIGURES, options.json)


def play_motion(options: MotionOptions, piece: MotionPiece) -> MotionSummary:
    """Play a motion undisturbed and disturbed."""
    return measure_motion(load_world(options), piece, threads=options.threads)


LIMITS = np.array([4.1, 3.5, 3.0, 2.5, 2.2, 2.0, 1.8, 1.6, 1.5, 1.4, 1.3, 1.2, 1.1, 1.0])
"""Torque limits on servos with the first as their stall torque [N·m]; others get the same
shares."""


class MotionSummary(msgspec.Struct, frozen=True, kw_only=True):
    """Outcome of a motion undisturbed, and its success under disturbances."""

    start_class: str
    end_class: str
    strategy: str
    succeeded: bool
    stand_time_s: float | None
    head_impact_m_s: float | None
    torso_impact_m_s: float | None
    peak_torque_nm: float
    rms_torque_nm: float
    peak_velocity_rad_s: float
    self_collisions: int
    limit_violations: int
    clips: int
    lowest_torque_limit_nm: float | None
    disturbed_n: int
    disturbed_succeeded: int
    disturbed_interval_95: tuple[float, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionPiece:
    """One of several motions."""

    motion: Motion
    number: int
    seed: int
    each: int
    """Disturbed plays."""


def measure_motion(world: World, piece: MotionPiece, *, threads: int = 0) -> MotionSummary:
    """Measure one of several motions; 0 threads of its physics are one per processor."""
    motion, each = piece.motion, piece.each
    start = settle_posture(world, motion.posture(0))
    twin = Twin(world)
    twin.place(read_posture(world.robot, world.model, start))
    run, outcome = _play(twin, world, motion)
    rng = np.random.default_rng([piece.seed, piece.number])
    succeeded = sum(_play_disturbed(world, motion, start, each, rng))
    make = partial(
        MotionSummary,
        start_class=motion.start_class,
        end_class=motion.end_class,
        strategy=motion.strategy,
        succeeded=bool(has_succeeded(motion, outcome)),
        clips=run.clips.total,
        lowest_torque_limit_nm=find_lowest_limit(world, motion, start, threads=threads),
        disturbed_n=each,
        disturbed_succeeded=succeeded,
        disturbed_interval_95=wilson_interval(succeeded, each),
    )
    return outcome.figures(make)


def find_lowest_limit(
    world: World, motion: Motion, start: Array, *, threads: int = 0
) -> float | None:
    """Find the lowest torque limit [N·m] such that the motion succeeds under it and all above.

    The limits are `LIMITS`, as shares of the servos' own stall torque; 0 threads are one per
    processor.
    """
    limits = LIMITS * (world.robot.max_torque.max() / LIMITS[0])
    n, period = len(limits), world.robot.control_period
    hold = round(hold_time(motion) / period)
    targets = motion.sample(np.arange(motion.time[0], motion.time[-1] + 0.5 * period, period))
    targets = np.concatenate([targets, np.repeat(targets[-1:], hold, axis=0)])
    scenarios = Scenarios(
        starts=np.tile(start, (n, 1)),
        parameters=DomainParameters.nominal(world, n, torque_limit=limits),
    )
    record = Experiment(world, threads=threads).play(scenarios, [targets] * n)
    outcome = Outcome(record, world.robot)
    unbroken = np.cumprod(has_succeeded(motion, outcome)).astype(bool)
    return float(limits[unbroken][-1]) if unbroken.any() else None


def _play_disturbed(
    world: World, motion: Motion, start: Array, plays: int, rng: np.random.Generator
) -> list[bool]:
    scenarios = USUAL.sample(world, start, plays + 1, rng)
    starts, parameters = scenarios.starts, scenarios.parameters
    succeeded = []
    for i in range(1, plays + 1):  # the first is the undisturbed one
        place = world.vary(ground_friction=parameters.friction[i])
        twin = Twin(place, voltage=float(parameters.voltage[i]))
        twin.place(read_posture(world.robot, world.model, starts[i]))
        succeeded.append(bool(has_succeeded(motion, _play(twin, world, motion)[1])))
    return succeeded


def _play(twin: Twin, world: World, motion: Motion) -> tuple[RunReport, Outcome]:
    """Play a motion without monitors, which would end a failing one early."""
    player = MotionPlayer(twin.robot, motion, hold=hold_time(motion))
    return play_in_simulation(player, SafetyGuard(twin), twin.simulation, world.scene)


load_world = lru_cache(maxsize=1)(MotionOptions.load_world)


if __name__ == "__main__":
    main(tyro.cli(MotionOptions, description=__doc__))
