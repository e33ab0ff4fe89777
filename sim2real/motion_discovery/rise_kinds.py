"""Kinds of learned rises: groups that take the same way from lying to a stand."""

from __future__ import annotations

from collections.abc import Sequence

from humanoid_getup.posture_chains.rise_kind import KindNamer, label_ways, sample_rows
from humanoid_getup.simulation.world import World
from robots.quaternion import Array
from sim2real.motion_discovery.replay import Replay


def group_rises(world: World, rises: Sequence[Replay]) -> list[list[Replay]]:
    """Group rises that pass the same postures with similar joint angles."""
    groups: dict[tuple[str, int], list[Replay]] = {}
    namer, joints = KindNamer(world), world.robot.layout(world.model).qpos
    labels = label_ways([sample_rows(_until_stand(world, each)[:, joints]) for each in rises])
    for each, label in zip(rises, labels, strict=True):
        groups.setdefault((_name(namer, world, each), label), []).append(each)
    return list(groups.values())


def name_kind(world: World, rise: Replay) -> str:
    """Name the postures that a robot passes on its way up."""
    return _name(KindNamer(world), world, rise)


def _name(namer: KindNamer, world: World, rise: Replay) -> str:
    passed = namer.name(_until_stand(world, rise), rise.rise.start_class)
    return "learned" + (f", over {passed}" if passed else "")


def _until_stand(world: World, rise: Replay) -> Array:
    return rise.qpos[: max(round(rise.stand_time / world.robot.control_period), 1)]
