"""Ties between hinges: gears, tendons, mimics and closed loops couple them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.quaternion import Array

NARROW = 0.1  # rad; a tendon that is limited to less couples its joints, with backlash
NOTHING = 1e-6  # of a constraint's rows


@dataclass(frozen=True)
class Tie:
    """Hinges that turn together: the sum of share times angle is constant."""

    joints: tuple[str, ...]
    shares: tuple[float, ...]
    is_loop: bool = False
    """Whether a closed loop ties them, so that the shares hold only near the model's pose."""

    @classmethod
    def follow(cls, follower: str, leader: str, ratio: float) -> Tie:
        """Tie a joint to another one by their ratio of turns."""
        return cls((follower, leader), (1.0, -ratio))


def list_ties(model: mujoco.MjModel, qpos: Array) -> list[Tie]:
    """List the ties of a model's hinges, from its constraints at MuJoCo positions (nq,)."""
    if not model.neq + model.ntendon:
        return []
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    names = [model.joint(joint).name for joint in hinges]
    rows = [*_list_equalities(model, data), *((row, False) for row in _list_tendons(model))]
    ties = [_tie(row[model.jnt_dofadr[hinges]], names, is_loop) for row, is_loop in rows]
    return [tie for tie in ties if tie.joints and all(tie.joints)]


def group_ties(ties: Iterable[Tie]) -> Iterator[list[Tie]]:
    """Group ties that share hinges."""
    left = list(ties)
    while left:
        group = [left.pop(0)]
        members = set(group[0].joints)
        while found := [tie for tie in left if members & {*tie.joints}]:
            members.update(*(tie.joints for tie in found))
            group += found
            left = [tie for tie in left if tie not in found]
        yield group


def describe_separate(joints: Iterable[str]) -> str:
    """Describe joints whose tie is not kept."""
    return f"joints {', '.join(joints)} are coupled in the model, and separate here"


def _tie(row: Array, names: list[str], is_loop: bool) -> Tie:
    """Make a tie of a row (h,) of shares, which may hold none."""
    members = np.flatnonzero(np.abs(row) > NOTHING)
    shares = tuple(row[members].tolist())
    return Tie(tuple(names[k] for k in members), shares, is_loop)


def _list_equalities(model: mujoco.MjModel, data: mujoco.MjData) -> Iterator[tuple[Array, bool]]:
    """List equalities between speeds, (nv,), and whether each is of a closed loop."""
    jacobian = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(
            jacobian, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    else:
        # The array may be longer: MuJoCo drops the rows of a loop that holds nothing.
        jacobian[:] = data.efc_J[: jacobian.size].reshape(jacobian.shape)
    loops = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    for k in np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY):
        yield jacobian[k], mujoco.mjtEq(int(model.eq_type[data.efc_id[k]])) in loops


def _list_tendons(model: mujoco.MjModel) -> Iterator[Array]:
    """List fixed tendons that can hardly change their length, as rows (nv,)."""
    for tendon in range(model.ntendon):
        first = int(model.tendon_adr[tendon])
        own = slice(first, first + int(model.tendon_num[tendon]))
        is_fixed = np.all(model.wrap_type[own] == mujoco.mjtWrap.mjWRAP_JOINT)
        if not (is_fixed and model.tendon_limited[tendon]):
            continue
        row = np.zeros(model.nv)
        row[model.jnt_dofadr[model.wrap_objid[own]]] = model.wrap_prm[own]
        if np.ptp(model.tendon_range[tendon]) <= NARROW * np.abs(row).max():
            yield row
