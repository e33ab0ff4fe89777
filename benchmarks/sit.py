"""Sit and lie down from many disturbed stands, at full torque and under limits by PWM.

As `getup sit` does it. Joints are disturbed by 3° (standard deviation), the heading is anywhere,
friction is 0.4 to 1.2 and the supply 11.0 to 12.6 V (uniform); the same stands for every limit.
Stands that fall over while their joints are held are drawn again.

    python benchmarks/sit.py --n 60 --json sit.json
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import tyro
from script import Options, do_pieces, write_results

from drivers import Twin
from humanoid_getup.execution.get_up import keep_stand
from humanoid_getup.execution.session import SessionOptions
from humanoid_getup.experiments.disturbances import USUAL, draw
from humanoid_getup.experiments.falls import find_rest
from humanoid_getup.experiments.judging.standing import StanceMeter, is_upright
from humanoid_getup.experiments.judging.summary import summarize, wilson_interval
from humanoid_getup.simulation.world import World
from robots import FULL_TORQUE, Posture, TorqueLimit, quaternion

LIMITS = {
    "full torque": FULL_TORQUE,
    "2.5 N·m by PWM": TorqueLimit(2.5, "pwm"),
    "2.0 N·m by PWM": TorqueLimit(2.0, "pwm"),
}
IMPACTS = ("head_impact_m_s", "torso_impact_m_s")
TORQUES = ("peak_torque_nm", "rms_torque_nm")
FIGURES = ("n", "succeeded", "interval_95", "head_impact_max_m_s", "torso_impact_max_m_s")


@dataclass(frozen=True, kw_only=True)
class SitOptions(Options):
    """Options of this script."""

    n: int = 60
    """Stands; each is played under every torque limit."""


@dataclass(frozen=True, kw_only=True)
class Stand:
    """A disturbed stand, with friction and supply."""

    posture: Posture
    friction: float
    voltage: float
    """[V]"""


@dataclass(frozen=True, kw_only=True)
class WayDown:
    """Figures of a way down; those of load are None if it did not begin."""

    succeeded: bool
    reason: str
    head_impact_m_s: float | None = None
    torso_impact_m_s: float | None = None
    peak_torque_nm: float | None = None
    rms_torque_nm: float | None = None


def main(options: SitOptions) -> None:
    """Measure, and write the figures of every limit."""
    world, rng = options.load_world(), np.random.default_rng(options.seed)
    stands = [sample_stand(world, rng) for _ in range(options.n)]
    pieces = [(name, stand) for name in LIMITS for stand in stands]
    ways = do_pieces(partial(sit_down, options), pieces, options)
    cases = {
        name: summarize_ways(ways[k * options.n : (k + 1) * options.n])
        for k, name in enumerate(LIMITS)
    }
    result = options.describe("sit", options.n) | {"cases": cases}
    write_results(result, FIGURES, options.json)


def sample_stand(world: World, rng: np.random.Generator) -> Stand:
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
            return Stand(posture=posture, friction=friction, voltage=voltage)


def sit_down(options: SitOptions, piece: tuple[str, Stand]) -> WayDown:
    """Sit and lie down from a stand, under the torque limit of a name, on the twin."""
    limit, stand = piece
    place = load_world(options).vary(ground_friction=stand.friction)
    twin = Twin(place, stand.posture, voltage=stand.voltage)
    session = SessionOptions(preflight=False)
    after = keep_stand(twin, place, torque_limit=LIMITS[limit], options=session)
    make = partial(WayDown, succeeded=after.succeeded, reason=after.reason)
    down = after.way_down
    return down.outcome.figures(make) if down and down.outcome else make()


load_world = lru_cache(maxsize=1)(SitOptions.load_world)


def summarize_ways(ways: Sequence[WayDown]) -> dict[str, Any]:
    """Summarize success, impacts and torques of the ways down under one limit."""
    succeeded = sum(way.succeeded for way in ways)
    judged = [way for way in ways if way.peak_torque_nm is not None]
    figures: dict[str, Any] = {
        "n": len(ways),
        "succeeded": succeeded,
        "interval_95": wilson_interval(succeeded, len(ways)),
    }
    for key in IMPACTS:
        speeds = [getattr(way, key) or 0.0 for way in judged]
        figures[key] = summarize(speeds)
        figures[key.replace("_m_s", "_max_m_s")] = max(speeds, default=None)
    for key in TORQUES:
        figures[key] = summarize(getattr(way, key) for way in judged)
    return figures | {"failures": [way.reason for way in ways if not way.succeeded]}


if __name__ == "__main__":
    main(tyro.cli(SitOptions, description=__doc__))
