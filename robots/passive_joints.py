"""Hinges without servos: springs, and outputs that equality constraints couple to other joints."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from robots.quaternion import Array


def rest_passive_joints(model: mujoco.MjModel, names: Sequence[str], qpos: Array) -> None:
    """Put passive joints into their rest positions in MuJoCo positions (..., nq), in place.

    A joint that an equality follows from another one is there; any other is where its spring is at
    rest or, without stiffness, at ``qpos0``.
    """
    if not names:
        return
    passive = [model.joint(name).id for name in names]
    addresses, has_spring = model.jnt_qposadr[passive], model.jnt_stiffness[passive] > 0.0
    rest = np.where(has_spring, model.qpos_spring[addresses], model.qpos0[addresses])
    qpos[..., addresses] = rest
    couple_passive_joints(model, names, qpos)


def couple_passive_joints(model: mujoco.MjModel, names: Sequence[str], qpos: Array) -> None:
    """Set passive joints from the joints that they are coupled to, in place.

    An equality of joints states the first one as a polynomial of the second. Where a joint follows
    one that follows another, the equalities stand in that order.
    """
    passive = {model.joint(name).id for name in names}
    couples = (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_active0 > 0)
    for k in np.flatnonzero(couples) if passive else ():
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if follower not in passive:
            continue
        at, coefficients = model.jnt_qposadr[follower], model.eq_data[k, :5]
        moved = np.zeros(qpos.shape[:-1])
        if leader >= 0:
            address = model.jnt_qposadr[leader]
            moved = qpos[..., address] - model.qpos0[address]
        qpos[..., at] = model.qpos0[at] + np.polynomial.polynomial.polyval(moved, coefficients)
