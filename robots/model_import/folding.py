"""Drives in a model: hinges of motors that turn others by gears, differentials and rods.

A model may have a hinge for the motor and one for what it drives, tied by constraints. Servos turn
joints here through a gear or a coupling: the driven hinges are kept as joints, and those of
motors and rods are fixed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.quaternion import Array

NARROW = 0.1  # rad; a tendon that is limited to less couples its joints, with backlash
NOTHING = 1e-6  # of a constraint's rows
LOOSE = 0.02  # share by which constraints may miss each other
LIGHT = 0.05  # share of the robot's mass that motors and rods may carry
LOOP_STEP = 0.01  # to which the turns of a closed loop are rounded: they change with the pose
SINGULAR = 1e-3
MOST_JOINTS = 2  # that servos turn together
Names = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Fold:
    """Motors that drive other hinges: one through a gear, or two through a coupling."""

    motors: Names
    """Hinges with actuators, one or two."""
    joints: Names
    """As many hinges that they drive, each mainly by the motor in its place."""
    rods: Names
    """Hinges between them."""
    matrix: Array
    """Turns of the motors (rows) per turn of the joints (columns), (1, 1) or (2, 2)."""
    is_loop: bool
    """Whether rods close a loop, so that the matrix holds only near the model's pose."""

    @property
    def gear(self) -> float:
        """Return the turns of a single motor per turn of its joint, negative if it reverses."""
        return float(self.matrix[0, 0])

    def describe(self) -> str:
        """Describe it in a line."""
        joints, motors = " and ".join(self.joints), " and ".join(self.motors)
        by = "rods" if self.is_loop else "gears"
        measured = "; its ratio was measured in one pose and holds near it" if self.is_loop else ""
        fixed = ", ".join((*self.motors, *self.rods))
        return f"{joints} driven by {motors} through {by}: {fixed} fixed{measured}"


def find_folds(model: mujoco.MjModel, qpos: Array) -> list[Fold]:
    """Find the drives of a model, by its constraints at MuJoCo positions (nq,)."""
    if not model.neq + model.ntendon:
        return []
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_fwdPosition(model, data)
    equalities, rows = _list_rows(model, data)
    hinges = model.jnt_dofadr[model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE]
    rows = rows[:, hinges]
    folds = []
    for members, own in _list_components(rows):
        dofs = [int(hinges[k]) for k in members]
        is_loop = any(equalities[r] for r in own)
        fold = _fold(model, [int(model.dof_jntid[d]) for d in dofs], rows[own][:, members], is_loop)
        folds += [fold] if fold else []
    return folds


def fold(spec: mujoco.MjSpec, folds: Sequence[Fold]) -> None:
    """Fix the hinges of motors and rods in a specification; all that names them goes."""
    groups = (spec.actuators, spec.sensors, spec.equalities, spec.tendons, spec.keys)
    for element in [element for group in groups for element in group]:
        spec.delete(element)
    for name in {name for each in folds for name in (*each.motors, *each.rods)}:
        spec.delete(spec.joint(name))


def _list_rows(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[list[bool], Array]:
    """List linear relations between speeds, (r, nv), and whether each is of a closed loop."""
    jacobian = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        mujoco.mju_sparse2dense(
            jacobian, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    else:
        jacobian[:] = data.efc_J.reshape(data.nefc, model.nv)
    ties = np.flatnonzero(data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    loops = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    kinds = np.isin(model.eq_type[data.efc_id[ties]], [int(kind) for kind in loops]).tolist()
    tendons = np.array(list(_list_narrow_tendons(model))).reshape(-1, model.nv)
    return kinds + [False] * len(tendons), np.concatenate([jacobian[ties], tendons])


def _list_narrow_tendons(model: mujoco.MjModel) -> Iterator[Array]:
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


def _list_components(rows: Array) -> Iterator[tuple[list[int], list[int]]]:
    """List columns that rows tie together, and those rows."""
    left = [set(np.flatnonzero(np.abs(row) > NOTHING).tolist()) for row in rows]
    open_rows = [r for r, members in enumerate(left) if members]
    while open_rows:
        members, own = set(left[open_rows[0]]), [open_rows.pop(0)]
        while found := [r for r in open_rows if left[r] & members]:
            members |= set().union(*(left[r] for r in found))
            own += found
            open_rows = [r for r in open_rows if r not in found]
        yield sorted(members), own


def _fold(model: mujoco.MjModel, joints: list[int], rows: Array, is_loop: bool) -> Fold | None:
    """Fold joints that rows (r, len(joints)) tie together, if motors drive as many of them."""
    driven = set(model.actuator_trnid[model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT, 0])
    motors = [k for k, joint in enumerate(joints) if joint in driven]
    others = [k for k, joint in enumerate(joints) if joint not in driven]
    if not 1 <= len(motors) <= min(MOST_JOINTS, len(others)):
        return None
    follow = -np.linalg.pinv(rows[:, others]) @ rows[:, motors]  # (others, motors)
    missed = np.abs(rows[:, others] @ follow + rows[:, motors]).max() / np.abs(rows).max()
    if missed > LOOSE or np.linalg.matrix_rank(rows[:, others], tol=NOTHING) < len(others):
        return None
    mass = [float(model.body_subtreemass[model.jnt_bodyid[joints[k]]]) for k in others]
    heaviest = sorted(np.argsort(mass)[-len(motors) :].tolist())
    outputs = [joints[others[k]] for k in heaviest]
    fixed = [joint for joint in joints if joint not in outputs]
    share = follow[heaviest]
    if not _is_light(model, fixed, outputs) or abs(np.linalg.det(share)) < SINGULAR:
        return None
    matrix = np.asarray(np.linalg.inv(share), dtype=float)
    if is_loop:
        matrix = np.round(matrix / LOOP_STEP) * LOOP_STEP
    motors = [joints[k] for k in motors]
    if len(motors) == MOST_JOINTS and abs(matrix[0, 1] * matrix[1, 0]) > abs(
        matrix[0, 0] * matrix[1, 1]
    ):
        motors, matrix = motors[::-1], matrix[::-1]
    names = [model.joint(joint).name for joint in range(model.njnt)]
    return Fold(
        motors=tuple(names[j] for j in motors),
        joints=tuple(names[j] for j in outputs),
        rods=tuple(names[j] for j in fixed if j not in motors),
        matrix=matrix,
        is_loop=is_loop,
    )


def _is_light(model: mujoco.MjModel, fixed: list[int], outputs: list[int]) -> bool:
    """Tell whether hinges carry little, and none of the outputs."""
    bodies = {int(model.jnt_bodyid[joint]) for joint in fixed}
    for output in outputs:
        body = int(model.jnt_bodyid[output])
        while body > 0:
            if body in bodies:
                return False
            body = int(model.body_parentid[body])
    carried = sum(float(model.body_subtreemass[body]) for body in bodies)
    return carried <= LIGHT * float(model.body_subtreemass[0])
