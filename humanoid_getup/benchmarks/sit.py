"""Benchmark of the way down: sit and lie down from many disturbed stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Self, TypeAlias

import msgspec
import numpy as np

from drivers import Twin
from humanoid_getup.benchmarks.bench_result import CaseBench
from humanoid_getup.benchmarks.pieces import RunPieces, collect, one_by_one
from humanoid_getup.execution.after_stand import AfterStand
from humanoid_getup.execution.keep_stand import keep_stand
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.disturbances.distributions import draw
from humanoid_getup.experiments.disturbances.disturbance import USUAL
from humanoid_getup.experiments.judging.standing import StanceMeter, is_upright
from humanoid_getup.experiments.judging.summary import Quantiles, summarize, wilson_interval
from humanoid_getup.experiments.starts.falls import find_rest
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Posture, TorqueLimit, quaternion

LIMITS = {
    "full torque": FULL_TORQUE,
    "2.5 N·m by PWM": TorqueLimit(2.5, "pwm"),
    "2.0 N·m by PWM": TorqueLimit(2.0, "pwm"),
}


@dataclass(frozen=True, kw_only=True)
class DisturbedStand:
    """A disturbed stand, with friction and supply."""

    posture: Posture
    friction: float
    voltage: float
    """[V]"""


@dataclass(frozen=True, kw_only=True)
class SitPiece:
    """One disturbed stand, under one of the torque limits."""

    limit: str
    """Its name in `LIMITS`."""
    stand: DisturbedStand


@dataclass(frozen=True, kw_only=True)
class WayDown:
    """Figures of a way down, by report.json's keys; those of load are None if it did not begin."""

    succeeded: bool
    reason: str
    head_impact_m_s: float | None = None
    torso_impact_m_s: float | None = None
    peak_torque_nm: float | None = None
    rms_torque_nm: float | None = None

    @classmethod
    def of(cls, after: AfterStand) -> Self:
        """Take the figures of what a robot did after its stand."""
        make = partial(cls, succeeded=after.succeeded, reason=after.reason)
        down = after.way_down
        return down.outcome.figures(make) if down and down.outcome else make()


RunSits: TypeAlias = RunPieces[SitPiece, WayDown]


class SitSummary(msgspec.Struct, frozen=True, kw_only=True):
    """Success of the ways down, and their impacts."""

    n: int
    succeeded: int
    interval_95: tuple[float, float]
    head_impact_m_s: Quantiles
    head_impact_max_m_s: float | None
    torso_impact_m_s: Quantiles
    torso_impact_max_m_s: float | None
    peak_torque_nm: Quantiles
    rms_torque_nm: Quantiles
    failures: list[str]


def bench_sit(
    world: World,
    *,
    seed: int,
    each: int,
    report: Callable[[WayDown], object] = lambda _: None,
    run: RunSits | None = None,
) -> CaseBench[SitSummary]:
    """Sit and lie down from the same stands under each torque limit, as `getup sit` does.

    Joints are disturbed by 3 deg (standard deviation), the heading is anywhere, friction is 0.4
    to 1.2 and the supply 11.0 to 12.6 V (uniform). Stands that fall over while their joints are
    held are drawn again.

    Args:
        world: Robot and scene.
        seed: Of the stands.
        each: Number of stands.
        report: Called after each way down.
        run: Does the ways down; None: one after another, here.
    """
    rng = np.random.default_rng(seed)
    stands = [_sample_stand(world, rng) for _ in range(each)]
    pieces = {
        f"{limit}: {number}": SitPiece(limit=limit, stand=stand)
        for limit in LIMITS
        for number, stand in enumerate(stands)
    }
    found = collect(pieces, run or one_by_one(partial(sit_down, world)), report)
    cases = {
        limit: _summarize([found[key] for key, piece in pieces.items() if piece.limit == limit])
        for limit in LIMITS
    }
    return CaseBench(name="sit", seed=seed, n=each, robot=world.robot.name, cases=cases)


def _sample_stand(world: World, rng: np.random.Generator) -> DisturbedStand:
    """Sample a stand at rest, disturbed."""
    robot = world.robot
    friction = float(draw(USUAL.ground_friction, rng))
    voltage = float(draw(USUAL.supply, rng)) * robot.supply_voltage
    meter = StanceMeter(robot, world.model)
    while True:
        angles = robot.standing.joint_pos + draw(USUAL.joints, rng, robot.n)
        disturbed = replace(
            robot.standing,
            orientation=quaternion.from_yaw(float(rng.uniform(-np.pi, np.pi))),
            joint_pos=np.clip(angles, robot.lower, robot.upper),
        )
        posture = find_rest(world, disturbed)
        stance = meter.estimate(posture.orientation[None], posture.joint_pos[None])
        if is_upright(stance, robot)[0]:
            return DisturbedStand(posture=posture, friction=friction, voltage=voltage)


def sit_down(world: World, piece: SitPiece) -> WayDown:
    """Sit and lie down from a disturbed stand on the twin."""
    stand = piece.stand
    place = world.vary(ground_friction=stand.friction)
    twin = Twin(place, stand.posture, voltage=stand.voltage)
    options = SessionOptions(preflight=False)
    after = keep_stand(twin, place, torque_limit=LIMITS[piece.limit], options=options)
    return WayDown.of(after)


def _summarize(results: list[WayDown]) -> SitSummary:
    succeeded = sum(result.succeeded for result in results)
    judged = [result for result in results if result.peak_torque_nm is not None]
    head = [result.head_impact_m_s or 0.0 for result in judged]
    torso = [result.torso_impact_m_s or 0.0 for result in judged]
    return SitSummary(
        n=len(results),
        succeeded=succeeded,
        interval_95=wilson_interval(succeeded, len(results)),
        head_impact_m_s=summarize(head),
        head_impact_max_m_s=max(head, default=None),
        torso_impact_m_s=summarize(torso),
        torso_impact_max_m_s=max(torso, default=None),
        peak_torque_nm=summarize(result.peak_torque_nm for result in judged),
        rms_torque_nm=summarize(result.rms_torque_nm for result in judged),
        failures=[result.reason for result in results if not result.succeeded],
    )
