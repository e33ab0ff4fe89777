"""Inverse kinematics: brings sites of a robot to poses, within the limits of its joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mink
import mujoco
import numpy as np
import qpsolvers
from numpy.typing import NDArray

from robots import Robot
from robots.kinematics import couple_passive_joints
from robots.quaternion import Array

ROUNDS = 40
STEP = 0.3  # rad or m, of every degree of freedom in a round
STRICTER, LOOSER = 8.0, 0.2  # factors on the damping after a round in vain, and after a good one
DAMPING = (1e-8, 1e2)  # least and greatest
SETTLED = 1e-5  # relative gain of a round below which the search ends
EXACT = 1e-11  # weighed square error below which it does [m²]
HABIT = 0.0005  # m/rad by which joints return to where they were before

Dofs = NDArray[np.int_]
Ranges = tuple[Array, Array]


@dataclass(frozen=True, eq=False, kw_only=True)
class EndPose:
    """Where the end of a limb, or the torso, is in the world."""

    position: Array
    """[m], (3,)"""
    orientation: Array
    """Unit quaternion w x y z, (4,)."""


class Aim:
    """A site that should be at a pose, with weights of the errors."""

    def __init__(self, site: str, pose: EndPose, *, weight: float = 1.0, turn: float = 0.0) -> None:
        """Weigh position and orientation [m/rad]; 0 if the latter does not matter."""
        self._site, self._pose = site, pose
        self._place = mink.FrameTask(site, "site", position_cost=weight, orientation_cost=0.0)
        self._turn = mink.FrameTask(site, "site", position_cost=0.0, orientation_cost=turn)

    def list_tasks(self, now: mink.Configuration) -> list[mink.FrameTask]:
        """Return the tasks of a round: straight to the position, and a turn on the spot.

        mink's error of a whole pose is a twist, whose way to a position is a screw.
        """
        frame = now.get_transform_frame_to_world(self._site, "site").wxyz_xyz
        pose = self._pose
        self._place.set_target(mink.SE3(np.concatenate([frame[:4], pose.position])))
        self._turn.set_target(mink.SE3(np.concatenate([pose.orientation, frame[4:]])))
        return [self._place, self._turn] if self._turn.cost.any() else [self._place]


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """Positions, and the errors that are left there."""

    qpos: Array
    """MuJoCo positions, (nq,)."""
    error: float
    """Weighed square error [m²]."""
    away: Array
    """Way of the degrees of freedom from where they were before, (nv,); 0 for the torso."""
    residual: Array
    """Weighed errors of the aims, (k,)."""
    jacobian: Array
    """How these fall with the degrees of freedom, (k, nv)."""
    ties: Array
    """Change of what passive joints follow with the degrees of freedom, (p, nv)."""

    @property
    def miss(self) -> float:
        """Return the weighed distance of the first site from its position [m]."""
        return float(np.linalg.norm(self.residual[:3]))


class InverseKinematics:
    """Damped least squares of mink's tasks, in which every accepted round comes nearer."""

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        """Prepare for a model of the robot, and of nothing else."""
        self._model, self._robot, self._layout = model, robot, robot.layout(model)
        self._now = mink.Configuration(model)
        followers = _find_followers(robot, model)
        self._followers = model.jnt_dofadr[model.eq_obj1id[followers]]
        self._ties = [mink.EqualityConstraintTask(model, 1.0, followers)] if followers else []

    def look(self, qpos: Array) -> mink.Configuration:
        """Compute the kinematics at MuJoCo positions (nq,)."""
        self._now.update(qpos)
        return self._now

    def solve(
        self,
        start: Array,
        aims: Sequence[Aim],
        free: Dofs,
        before: Array,
        *,
        bounds: Ranges | None = None,
        rounds: int = ROUNDS,
        correct: Callable[[Array], Array] = lambda qpos: qpos,
    ) -> Solution:
        """Find positions near a start where the weighed errors of aims are least.

        Args:
            start: MuJoCo positions within the joints' limits, (nq,).
            aims: What is to be reached.
            free: Degrees of freedom that may move; passive joints follow.
            before: Positions to which redundant joints return, (nq,).
            bounds: Least and greatest joint angles [rad], (n,) each; by default the limits.
            rounds: Their largest number.
            correct: Corrects the positions of a round.
        """
        free, damping = np.union1d(free, self._followers), DAMPING[0]
        ranges = (self._robot.lower, self._robot.upper) if bounds is None else bounds
        best = self._measure(start, aims, before)
        for _ in range(rounds):
            if best.error < EXACT or damping > DAMPING[1]:
                break
            moved = correct(
                self._move(best.qpos, self._find_step(best, free, damping, ranges), ranges)
            )
            found = self._measure(moved, aims, before)
            if found.error >= best.error:
                damping *= STRICTER
                continue
            gain, best = 1.0 - found.error / best.error, found
            damping = max(damping * LOOSER, DAMPING[0])
            if gain < SETTLED:
                break
        return best

    def _measure(self, qpos: Array, aims: Sequence[Aim], before: Array) -> Solution:
        now = self.look(qpos)
        tasks = [task for aim in aims for task in aim.list_tasks(now)]
        jacobians, residuals, _ = zip(
            *(task.compute_qp_residual(now) for task in tasks), strict=True
        )
        residual, away = np.concatenate(residuals), np.zeros(self._model.nv)
        mujoco.mj_differentiatePos(self._model, away, 1.0, before, qpos)
        root = self._layout.root_dof
        away[root : root + 6] = 0.0
        return Solution(
            qpos=qpos,
            error=float(residual @ residual + HABIT**2 * (away @ away)),
            away=away,
            residual=residual,
            jacobian=np.concatenate(jacobians),
            ties=np.concatenate(
                [np.zeros((0, len(away))), *(t.compute_jacobian(now) for t in self._ties)]
            ),
        )

    def _find_step(self, at: Solution, free: Dofs, damping: float, ranges: Ranges) -> Array:
        """Solve the quadratic program of a round for the free degrees of freedom, (nv,)."""
        jacobian, ties, step = at.jacobian[:, free], at.ties[:, free], np.zeros(len(at.away))
        lower, upper = self._bound_step(at.qpos, ranges)
        found = qpsolvers.solve_qp(
            jacobian.T @ jacobian + (HABIT**2 + damping) * np.eye(len(free)),
            HABIT**2 * at.away[free] - at.residual @ jacobian,
            A=ties if len(ties) else None,
            b=np.zeros(len(ties)) if len(ties) else None,
            lb=lower[free],
            ub=upper[free],
            solver="daqp",
        )
        if found is not None:
            step[free] = found
        return step

    def _bound_step(self, qpos: Array, ranges: Ranges) -> tuple[Array, Array]:
        """Bound the step of every degree of freedom, (nv,) each."""
        lower, upper = np.full(self._model.nv, -STEP), np.full(self._model.nv, STEP)
        at, dof = qpos[self._layout.qpos], self._layout.dof
        lower[dof] = np.minimum(np.maximum(ranges[0] - at, -STEP), 0.0)
        upper[dof] = np.maximum(np.minimum(ranges[1] - at, STEP), 0.0)
        return lower, upper

    def _move(self, qpos: Array, step: Array, ranges: Ranges) -> Array:
        """Move positions (nq,) by a step (nv,); passive joints follow."""
        moved, at = qpos.copy(), self._layout.qpos
        mujoco.mj_integratePos(self._model, moved, step, 1.0)
        moved[at] = np.clip(moved[at], *ranges)
        couple_passive_joints(self._model, self._robot.passive_joints, moved)
        return moved


def _find_followers(robot: Robot, model: mujoco.MjModel) -> list[int]:
    """Find the equalities that passive joints follow."""
    passive = {model.joint(name).id for name in robot.passive_joints}
    is_joint = model.eq_type == mujoco.mjtEq.mjEQ_JOINT
    return [int(k) for k in np.flatnonzero(is_joint) if int(model.eq_obj1id[k]) in passive]
