"""Benchmark of the way down: sit and lie down from many disturbed stands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from drivers import Twin
from humanoid_getup.benchmarks.bench_result import CaseBench
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
    report: Callable[[AfterStand], None] = lambda _: None,
) -> CaseBench[SitSummary]:
    """Sit and lie down from the same stands under each torque limit, as `getup sit` does.

    Joints are disturbed by 3 deg (standard deviation), the heading is anywhere, friction is 0.4
    to 1.2 and the supply 11.0 to 12.6 V (uniform). Stands that fall over while their joints are
    held are drawn again.
    """
    rng = np.random.default_rng(seed)
    stands = [_sample_stand(world, rng) for _ in range(each)]
    cases = {}
    for name, limit in LIMITS.items():
        results = []
        for stand in stands:
            results.append(_sit(world, stand, limit))
            report(results[-1])
        cases[name] = _summarize(results)
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


def _sit(world: World, stand: DisturbedStand, limit: TorqueLimit) -> AfterStand:
    place = world.vary(ground_friction=stand.friction)
    twin = Twin(place, stand.posture, voltage=stand.voltage)
    options = SessionOptions(preflight=False)
    return keep_stand(twin, place, torque_limit=limit, options=options)


def _summarize(results: list[AfterStand]) -> SitSummary:
    succeeded = sum(result.succeeded for result in results)
    judged = [r.way_down.outcome for r in results if r.way_down and r.way_down.outcome]
    head = [float(outcome.head_impact or 0.0) for outcome in judged]
    torso = [float(outcome.torso_impact or 0.0) for outcome in judged]
    return SitSummary(
        n=len(results),
        succeeded=succeeded,
        interval_95=wilson_interval(succeeded, len(results)),
        head_impact_m_s=summarize(head),
        head_impact_max_m_s=max(head, default=None),
        torso_impact_m_s=summarize(torso),
        torso_impact_max_m_s=max(torso, default=None),
        peak_torque_nm=summarize(float(outcome.peak_torque) for outcome in judged),
        rms_torque_nm=summarize(float(outcome.rms_torque) for outcome in judged),
        failures=[result.reason for result in results if not result.succeeded],
    )
