"""Drives in a model: hinges of motors that turn others by gears, differentials and rods.

A model may have a hinge for the motor and one for what it drives, tied by constraints. Servos turn
joints here through a gear or a coupling: the driven hinges are kept as joints, and those of
motors and rods are fixed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from robots.body.links import list_way_up
from robots.model_import.ties import NOTHING, Tie, group_ties
from robots.quaternion import Array

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
