"""Roles of joints: body segments, joints of learned rises, joints that spread legs."""

from __future__ import annotations

from collections.abc import Sequence

from robots.body.body_plan import BodyPlan
from robots.body.leg import WHOLE
from robots.quaternion import Array

BENDING = 3  # joints of an arm that a learned rise moves


def list_segments(body: BodyPlan, angles: Array) -> tuple[str, ...]:
    """List the segment of each joint: head, foot for those below the knee, or other.

    Which ones bend the legs is seen at joint angles (n,) [rad].
    """
    body.view.look(angles)
    segments = ["other"] * len(angles)
    for k in body.head:
        segments[k] = "head"
    for leg in body.legs:
        across = body.view.list_pitch(leg)
        for k in leg[leg.index(_middle(across)) + 1 :] if len(across) >= WHOLE else ():
            segments[k] = "foot"
    return tuple(segments)


def list_rising(body: BodyPlan, stance: Array) -> tuple[str, ...]:
    """List hips, knees and ankles, and the three joints of an arm that do not twist it.

    Args:
        body: What the hinges are.
        stance: Joint angles [rad], (n,).
    """
    view = body.view
    view.look(stance)
    rising: list[int] = []
    for left, _ in body.arms[:1]:
        end = view.end(left[-1])
        rising += [k for k in left if not view.twists(k, end - view.anchor(k))][:BENDING]
    return _list_paired(body, [*rising, *body.left_leg.list_pitch()])


def list_spreading(body: BodyPlan, stance: Array) -> tuple[str, ...]:
    """List the hinge of the leg above the knee that rolls it most, at joint angles [rad], (n,)."""
    body.view.look(stance)
    leg, across = body.legs[0], body.left_leg.list_pitch()
    knee = _middle(across) if across else leg[-1]
    hip = [k for k in leg if k < knee and k not in across] or [leg[0]]
    return _list_paired(body, [max(hip, key=lambda k: abs(body.view.axis(k)[0]))])


def _list_paired(body: BodyPlan, hinges: Sequence[int]) -> tuple[str, ...]:
    """List hinges that have a mirror image; the two sides of a robot may differ."""
    return tuple(body.joint_names[k] for k in hinges if body.mirror.index[k] != k)


def _middle(hinges: Sequence[int]) -> int:
    return hinges[len(hinges) // 2]
