"""Ties between hinges by gears, tendons, mimics and loops, and the drives found among them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.body.parts import list_way_up
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
    ties = []
    for row, is_loop in rows:
        shares = row[model.jnt_dofadr[hinges]]
        members = np.flatnonzero(np.abs(shares) > NOTHING)
        own = tuple(names[k] for k in members)
        if own and all(own):
            ties.append(Tie(own, tuple(shares[members].tolist()), is_loop))
    return ties


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
    """The hinges that they drive, each mainly by the motor with the same index."""
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


def find_folds(model: mujoco.MjModel, ties: Iterable[Tie]) -> list[Fold]:
    """Find the drives of a model among the ties of its hinges."""
    folds = [_fold(model, group) for group in group_ties(ties)]
    return [each for each in folds if each is not None]


def fold(spec: mujoco.MjSpec, folds: Sequence[Fold]) -> None:
    """Fix the hinges of motors and rods in a specification; remove all that refers to them."""
    groups = (spec.actuators, spec.sensors, spec.equalities, spec.tendons, spec.keys)
    for element in [element for group in groups for element in group]:
        spec.delete(element)
    for name in {name for each in folds for name in (*each.motors, *each.rods)}:
        spec.delete(spec.joint(name))


def _fold(model: mujoco.MjModel, ties: Sequence[Tie]) -> Fold | None:
    """Fold joints that are tied together, if as many motors as joints drive them."""
    is_loop = any(tie.is_loop for tie in ties)
    joints, rows = _read_rows(model, ties)
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


def _read_rows(model: mujoco.MjModel, ties: Sequence[Tie]) -> tuple[list[int], Array]:
    """Return the joints that are tied, (j,), and their shares in each tie, (r, j)."""
    joints = sorted({model.joint(name).id for tie in ties for name in tie.joints})
    rows = np.zeros((len(ties), len(joints)))
    for row, tie in zip(rows, ties, strict=True):
        row[[joints.index(model.joint(name).id) for name in tie.joints]] = tie.shares
    return joints, rows


def _is_light(model: mujoco.MjModel, fixed: list[int], outputs: list[int]) -> bool:
    """Tell whether hinges carry little mass and no output."""
    bodies = {int(model.jnt_bodyid[joint]) for joint in fixed}
    if any(bodies & {*list_way_up(model, int(model.jnt_bodyid[each]))} for each in outputs):
        return False
    carried = sum(float(model.body_subtreemass[body]) for body in bodies)
    return carried <= LIGHT * float(model.body_subtreemass[0])
