"""Ties between hinges by gears, tendons, mimics and loops, the drives and followers among them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.body.parts import list_way_up
from robots.model_import.source import ActuatorFigures, Fold, ModelSource, Tie
from robots.model_import.tree import KinematicTree
from robots.quaternion import Array

NARROW = 0.1  # rad; a tendon that is limited to less couples its joints, with backlash
NOTHING = 1e-6  # of a constraint's rows


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


LIGHT_MOTOR = 0.1  # share of what the output moves, below which a hinge is only its motor's


@dataclass(frozen=True)
class Follower:
    """A hinge without motor that follows another one, as in a parallelogram."""

    joint: str
    leader: str
    ratio: float
    """Turns of the joint per turn of its leader."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """The joints that remain after a reduction of ties."""

    motors: tuple[str, ...]
    """Joints that only turn a motor's shaft, to be welded."""
    actuators: dict[str, ActuatorFigures]
    """Limits of actuators at the remaining joints, by name."""
    followers: tuple[Follower, ...] = ()
    """Joints that remain without servo."""


def reduce_ties(source: ModelSource, tree: KinematicTree, notes: list[str]) -> Reduction:
    """Choose the output of each tie, with its motors' torque and speed there."""
    hinges = {hinge.name: hinge for hinge in tree.hinges}
    motors, followers = list[str](), list[Follower]()
    actuators = dict(source.actuators)
    loops = [loop for bodies in source.loops if (loop := _open_loop(tree, bodies, notes))]
    for tie in (*source.ties, *loops):
        if not set(tie.joints) <= hinges.keys():
            continue
        mass = [float(tree.model.body_subtreemass[hinges[j].body]) for j in tie.joints]
        output = max(range(len(mass)), key=mass.__getitem__)
        drives = [k for k in range(len(mass)) if mass[k] < LIGHT_MOTOR * mass[output]]
        if not drives and tie in source.ties and (follower := _find_follower(tie, source)):
            followers.append(follower)
            continue
        _describe(tie, output, drives, notes)
        motors += [tie.joints[k] for k in drives]
        name = tie.joints[output]
        if name not in source.actuators:
            known = [k for k in drives if tie.joints[k] in source.actuators]
            if known:
                actuators[name] = _combine(tie, output, known, source)
    return Reduction(
        tuple(dict.fromkeys(motors)), actuators, tuple(_sort_out(followers, motors, notes))
    )


def _sort_out(
    followers: Sequence[Follower], motors: Sequence[str], notes: list[str]
) -> Iterator[Follower]:
    known = set(motors)
    for each in followers:
        if {each.joint, each.leader} & {*motors}:
            notes.append(describe_separate((each.joint, each.leader)))
        elif each.joint not in known:
            known.add(each.joint)
            notes.append(
                f"joint {each.joint} follows {each.leader} ({each.ratio:.3g} turns to one) and has "
                "no servo"
            )
            yield each


def _find_follower(tie: Tie, source: ModelSource) -> Follower | None:
    """Find the joint without actuator of a pair whose other one has one."""
    driven = [k for k, joint in enumerate(tie.joints) if joint in source.actuators]
    if len(tie.joints) != 2 or len(driven) != 1:
        return None
    leader, follower = driven[0], 1 - driven[0]
    ratio = -tie.shares[leader] / tie.shares[follower]
    return Follower(tie.joints[follower], tie.joints[leader], ratio)


def _open_loop(tree: KinematicTree, bodies: tuple[int, int], notes: list[str]) -> Tie | None:
    """Open a closed loop; its hinges are assumed to be those of a parallelogram."""
    moved = {*list_way_up(tree.model, bodies[0])} ^ {*list_way_up(tree.model, bodies[1])}
    loop = [hinge.name for hinge in tree.hinges if hinge.body in moved]
    names = [tree.model.body(body).name for body in bodies]
    notes.append(
        f"the closed loop that joins {names[0]} and {names[1]} is open: its joints turn alike, as "
        "in a parallelogram; if the loop is another one, the robot moves differently here"
    )
    return Tie(tuple(sorted(loop)), (1.0,) * len(loop)) if len(loop) > 1 else None


def _describe(tie: Tie, output: int, drives: Sequence[int], notes: list[str]) -> None:
    name = tie.joints[output]
    if drives:
        driven = ", ".join(
            f"{tie.joints[k]} ({abs(tie.shares[output] / tie.shares[k]):.3g} turns to one)"
            for k in drives
        )
        notes.append(f"joint {name} is driven by {driven}, welded here: its servo turns the output")
    else:
        notes.append(describe_separate(tie.joints))


def _combine(tie: Tie, output: int, drives: Sequence[int], source: ModelSource) -> ActuatorFigures:
    """Convert the limits of motors to the output; the weakest motor limits it."""
    gears = [abs(tie.shares[output] / tie.shares[k]) for k in drives]
    figures = [source.actuators[tie.joints[k]] for k in drives]
    rows = list(zip(figures, gears, strict=True))
    efforts = [f.effort * gear for f, gear in rows if f.effort is not None]
    speeds = [f.speed / gear for f, gear in rows if f.speed is not None]
    return ActuatorFigures(effort=min(efforts, default=None), speed=min(speeds, default=None))
