"""Reshaping a model: its torso, shoulders, arms and legs become longer or shorter."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np

from robots.body.links import Link
from robots.body.parts import list_head_joints
from robots.proportions import Body, BodyError
from robots.reshaping.limb_directions import find_directions
from robots.reshaping.shoulders import stretch_shoulders
from robots.reshaping.skeleton import Skeleton
from robots.reshaping.stretch import AxialStretch
from robots.reshaping.stretching import make_explicit, stretch_link
from robots.robot import Robot

UPWARDS = np.array([0.0, 0.0, 1.0])


def reshape_model(spec: mujoco.MjSpec, robot: Robot, body: Body) -> None:
    """Give a robot's model, without servos, the lengths of a body.

    Raises:
        BodyError: if the robot lacks a part, or a part cannot be stretched.
    """
    make_explicit(spec)
    for part, change in _CHANGES.items():
        factor = getattr(body, part)
        if factor == 1.0:
            continue
        skeleton = Skeleton(
            spec,
            torso=robot.torso,
            sole_sites=robot.sole_sites,
            head_joints=list_head_joints(robot),
        )
        if part in ("shoulders", "arms") and not skeleton.parts.arms:
            raise BodyError(
                f"body '{body}': robot '{robot.name}' has no arms, expected torso or legs alone"
            )
        change(skeleton, factor)


def _stretch_torso(skeleton: Skeleton, factor: float) -> None:
    """Stretch the trunk upwards; what is below the hips stays."""
    torso = skeleton.torso
    legs = [leg.root for _, leg in skeleton.parts.legs]
    hips = [skeleton.anchor_in(leg, torso) for owner, leg in skeleton.parts.legs if owner is torso]
    for link in skeleton.parts.trunk:
        up = skeleton.turn(UPWARDS, torso, link)
        at_hips = link is torso and hips
        origin = np.mean(hips, axis=0) if at_hips else link.anchor()
        stretch_link(skeleton, link, AxialStretch(origin, up, factor, beyond=True), kept=legs)


def _stretch_arms(skeleton: Skeleton, factor: float) -> None:
    for _, arm in skeleton.parts.arms:
        _stretch_limb(skeleton, arm, factor)


def _stretch_legs(skeleton: Skeleton, factor: float) -> None:
    for _, leg in skeleton.parts.legs:
        _stretch_limb(skeleton, leg, factor)


def _stretch_limb(skeleton: Skeleton, limb: Link, factor: float) -> None:
    for link, direction in find_directions(skeleton, limb).items():
        stretch_link(skeleton, link, AxialStretch(link.anchor(), direction, factor))


_CHANGES: dict[str, Callable[[Skeleton, float], None]] = {
    "torso": _stretch_torso,
    "shoulders": stretch_shoulders,
    "arms": _stretch_arms,
    "legs": _stretch_legs,
}
"""In this order, because shoulders are as thick as the unstretched first links of the arms."""
