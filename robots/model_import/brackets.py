"""Brackets of an imported model: pairs of bodies whose shapes overlap by construction."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.body.joint_view import JointView
from robots.body.links import list_way_up
from robots.body.overlap import Pair, find_overlaps
from robots.quaternion import Array

POSES = 60
ALWAYS = 0.5  # share of random poses from which on a pair is said to overlap always
NEAR = 3  # hinges between bodies up to which shapes that overlap are brackets of each other
COMPACT = 0.1  # of the robot's extent by which such hinges may be apart, as those of a hip are


def find_own_overlaps(view: JointView, joint_pos: Array) -> dict[Pair, float]:
    """Find bodies that penetrate each other, and how deep [m], at joint angles (n,)."""
    view.look(joint_pos)
    return find_overlaps(view.model, view.data.qpos.copy())


def find_brackets(view: JointView, stance: Array, rng: np.random.Generator) -> list[Pair]:
    """Find pairs of bodies whose shapes overlap by construction.

    They overlap in most of random poses; or, with only a few hinges in one place between them, with
    all joints at zero or in the stance. A forearm that touches the torso is none.
    """
    count: dict[Pair, int] = {}
    lower, upper = view.model.jnt_range[view.ids].T
    for _ in range(POSES):
        pose = stance + 0.5 * rng.uniform(-1.0, 1.0, len(stance)) * (upper - lower) / 2.0
        for pair in find_own_overlaps(view, np.clip(pose, lower, upper)):
            count[pair] = count.get(pair, 0) + 1
    always = {pair for pair, times in count.items() if times >= ALWAYS * POSES}
    for pose in (np.clip(np.zeros(len(stance)), lower, upper), stance):
        found = find_own_overlaps(view, pose)
        always |= {pair for pair in found if _is_joined(view.model, *pair)}
    return sorted(always)


def exclude_brackets(spec: mujoco.MjSpec, view: JointView, stance: Array) -> str:
    """Switch off the contacts that `find_brackets` finds; return their names, or ""."""
    model = view.model
    pairs = [
        (model.body(first).name, model.body(second).name)
        for first, second in find_brackets(view, stance, np.random.default_rng(0))
    ]
    for first, second in pairs:
        spec.add_exclude(bodyname1=first, bodyname2=second)
    return ", ".join(f"{first} with {second}" for first, second in pairs)


def _is_joined(model: mujoco.MjModel, first: int, second: int) -> bool:
    """Tell whether only a few hinges at one place join two bodies."""
    hinges = list_hinges_between(model, first, second)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    size = np.ptp(data.xanchor[hinges], axis=0)
    return len(hinges) <= NEAR and bool(np.linalg.norm(size) < COMPACT * model.stat.extent)


def list_hinges_between(model: mujoco.MjModel, first: int, second: int) -> list[int]:
    """List the hinges on the way from one body to another."""
    moved = {*list_way_up(model, first)} ^ {*list_way_up(model, second)}
    return np.flatnonzero(np.isin(model.jnt_bodyid, [*moved])).tolist()
