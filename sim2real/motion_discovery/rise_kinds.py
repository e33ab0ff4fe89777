"""Kinds of rises: groups that take the same way from lying to a stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from humanoid_getup.experiments.starts.falls import classify
from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from sim2real.motion_discovery.replay import Replay

SAMPLES = 24  # of each rise, from lying to the stand
SAME_WAY = 0.35  # rad RMS between the joint angles of rises that take the same way
SEEN_TIME = 0.15  # s for which a robot must lie on a side that its kind is named after
UPRIGHT = "upright"


def group_rises(world: World, rises: Sequence[Replay]) -> list[list[Replay]]:
    """Group rises that pass over the same sides with similar joint angles."""
    groups: dict[tuple[str, int], list[Replay]] = {}
    ways = [_sample_angles(world, each).ravel() for each in rises]
    for each, label in zip(rises, _cluster(ways), strict=True):
        groups.setdefault((name_kind(world, each), label), []).append(each)
    return list(groups.values())


def name_kind(world: World, rise: Replay) -> str:
    """Name the sides on which a robot lies in turn on its way up."""
    layout, period = world.robot.layout(world.model), world.robot.control_period
    sides = [classify(q) or UPRIGHT for q in _until_stand(world, rise)[:, layout.root_orientation]]
    passed: list[str] = []
    run = 0
    for before, side in zip([None, *sides], sides, strict=False):
        run = run + 1 if side == before else 1
        if run == round(SEEN_TIME / period) and side != UPRIGHT and side not in passed[-1:]:
            passed.append(side)
    over = [side for side in passed if side != rise.rise.start_class]
    return "learned" + (f", over {' and '.join(over)}" if over else "")


def _cluster(ways: Sequence[Array]) -> list[int]:
    """Label rises, (d,) each; those with the same label differ little on average."""
    if len(ways) < 2:
        return [1] * len(ways)
    distance = SAME_WAY * np.sqrt(len(ways[0]))
    return fcluster(linkage(np.array(ways), "average"), distance, "distance").tolist()


def _sample_angles(world: World, rise: Replay) -> Array:
    """Sample the joint angles of a rise at equal shares of its time, (SAMPLES, n)."""
    qpos = _until_stand(world, rise)
    rows = np.linspace(0, len(qpos) - 1, SAMPLES).round().astype(int)
    return qpos[rows][:, world.robot.layout(world.model).qpos]


def _until_stand(world: World, rise: Replay) -> Array:
    return rise.qpos[: max(round(rise.stand_time / world.robot.control_period), 1)]
