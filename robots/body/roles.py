"""What joints are for: segments of the body, joints of a learned rise, joints that spread legs."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from robots.model_import.body import Body
from robots.model_import.rebuilt import RebuiltModel
from robots.quaternion import Array

TWIST = 0.8  # cosine between a hinge and its limb from which it only twists it
WHOLE_LEG = 3  # pitch joints: hip, knee, ankle
BENDING = 3  # joints of an arm that a learned rise moves


def list_segments(rebuilt: RebuiltModel, body: Body) -> tuple[str, ...]:
    """List the segment of each joint: head, foot for those below the knee, or other."""
    data = rebuilt.look(rebuilt.start_angles())
    segments = ["other"] * len(rebuilt.joint_names)
    for k in rebuilt.find(rebuilt.anatomy.head):
        segments[k] = "head"
    for leg in body.legs:
        across = _list_pitch(leg, data)
        for k in leg[leg.index(_middle(across)) + 1 :] if len(across) >= WHOLE_LEG else ():
            segments[k] = "foot"
    return tuple(segments)


def list_rising(rebuilt: RebuiltModel, body: Body, stance: Array) -> tuple[str, ...]:
    """List hips, knees and ankles, and of an arm the three that do not twist it.

    Args:
        rebuilt: Model.
        body: What its hinges are.
        stance: Joint angles [rad], (n,).
    """
    data, rising = rebuilt.look(stance), []
    for left, _ in body.arms[:1]:
        rising += [k for k in left if not _twists(k, left, rebuilt.model, data)][:BENDING]
    rising += _list_pitch(body.legs[0], data)
    return tuple(rebuilt.joint_names[k] for k in rising)


def list_spreading(rebuilt: RebuiltModel, body: Body, stance: Array) -> tuple[str, ...]:
    """List the hinge of the leg above the knee that rolls it most, at joint angles [rad], (n,)."""
    data, leg = rebuilt.look(stance), body.legs[0]
    across = _list_pitch(leg, data)
    knee = _middle(across) if across else leg[-1]
    hip = [k for k in leg if k < knee and k not in across] or [leg[0]]
    return (rebuilt.joint_names[max(hip, key=lambda k: abs(data.xaxis[k + 1][0]))],)


def _list_pitch(leg: Sequence[int], data: mujoco.MjData) -> list[int]:
    return [k for k in leg if abs(data.xaxis[k + 1][1]) > TWIST]


def _middle(hinges: Sequence[int]) -> int:
    return hinges[len(hinges) // 2]


def _twists(hinge: int, limb: Sequence[int], model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Return whether a hinge only turns the rest of its limb about itself."""
    anchor = data.xanchor[hinge + 1]
    end = model.jnt_bodyid[limb[-1] + 1]
    way = 2.0 * data.subtree_com[end] - data.xanchor[limb[-1] + 1] - anchor
    return bool(abs(way @ data.xaxis[hinge + 1]) > TWIST * np.linalg.norm(way))
