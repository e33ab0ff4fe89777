"""Drags the torso, a hand or a foot of a robot to where a person wants it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import Literal

import mujoco
import numpy as np

from humanoid_getup.studio.inverse_kinematics import (
    Aim,
    Dofs,
    EndPose,
    InverseKinematics,
    Ranges,
    Solution,
)
from humanoid_getup.studio.pose_robot import mirror_turned
from robots import Posture, Robot, quaternion
from robots.body.limbs import LIMB_NAMES, Limb, LimbName, Limbs
from robots.kinematics import find_carriers, place, read_posture
from robots.quaternion import Array

Handle = Literal["torso", LimbName]
TORSO: Handle = "torso"
SITE = "reach/"
"""Prefix of the sites that are added to a model."""
TURN = 0.003  # m/rad, of a hand or foot: its position counts, then its orientation
TORSO_TURN = 0.5  # standing neck heights a rad, of the torso over feet that stay
AHEAD = 0.3  # standing neck heights by which the target of a torso over its feet is ahead at most
STAY, STAY_TURN = 100.0, 10.0
"""Weights of feet that stay, in m and rad, beside that of the torso's position."""
TORSO_ROUNDS, CORRECTIONS = 8, 2  # rounds for a dragged torso; in each, those for the soles
FREE_TO_TURN = 6  # joints with which a limb can turn its end as well
NEAR = 0.001  # m; farther from its target a limb is tried from other postures, too
LEAP, LEAPS = 0.6, 10
"""Way of a joint from one solution of a drag to the next at most [rad], and leaps to its end."""
NUDGES = (0.0, 0.15), (0.5, 0.0), (1.0, 0.0)
"""Shares of the way to the middle of the ranges, and to the stance, where those begin: a stretched
limb does not know in which direction to bend."""


class Reach:
    """The handles of a robot: its torso, and the ends of the limbs that it has."""

    def __init__(self, robot: Robot) -> None:
        """Find the limbs; without two legs with knees, only the torso can be dragged."""
        self.robot = robot
        try:
            self._view = Limbs(robot)
        except ValueError:
            self._view = None
        found = {} if self._view is None else self._view.all
        self._limbs: dict[LimbName, Limb] = {n: found[n] for n in LIMB_NAMES if n in found}
        self._sites = self._add_sites()

    @property
    def handles(self) -> tuple[Handle, ...]:
        """Return the names of what can be dragged."""
        return (TORSO, *self._limbs)

    def locate(self, posture: Posture, handle: Handle) -> EndPose:
        """Locate a handle in a posture."""
        return self._locate_site(posture, self._sites[handle])

    def list_joints(self, limb: LimbName) -> tuple[int, ...]:
        """List the joints of a limb, as places in the robot's order."""
        return self._limbs[limb].joints

    def turns(self, handle: Handle) -> bool:
        """Return whether a handle has an orientation of its own to be dragged to."""
        limb = None if handle == "torso" else self._limbs[handle]
        return limb is None or len(limb.joints) >= FREE_TO_TURN

    def move_limb(
        self,
        start: Posture,
        limb: LimbName,
        target: EndPose,
        before: Posture | None = None,
        *,
        bounds: Ranges | None = None,
        retries: bool = True,
    ) -> Posture:
        """Move the end of a limb to a target, or as near as it reaches; nothing else moves.

        Args:
            start: Posture that is changed.
            limb: Its name.
            target: Pose of its hand or sole; the position comes first.
            before: Posture to which redundant joints return; by default the start.
            bounds: Least and greatest joint angles [rad], (n,) each; by default the limits.
            retries: Whether other ways to bend are tried where the target is missed.
        """
        joints = list(self._limbs[limb].joints)
        aim = Aim(self._sites[limb], target, turn=TURN if self.turns(limb) else 0.0)
        habit, dofs = self._place(before or start), self._layout.dof[joints]

        def solve(posture: Posture) -> Solution:
            qpos = self._place(posture)
            return self._solver.solve(qpos, [aim], dofs, habit, bounds=bounds)

        others = self._list_nudged(start, joints, bounds) if retries else ()
        best = _choose(solve(start), map(solve, others))
        return replace(start, joint_pos=read_posture(self.robot, self._model, best.qpos).joint_pos)

    def move_torso(
        self,
        start: Posture,
        target: EndPose,
        soles: dict[str, EndPose],
        *,
        bounds: Ranges | None = None,
        retries: bool = True,
    ) -> Posture:
        """Move the torso to a target, or as near as the legs permit, over soles that stay.

        Without soles, of `locate_soles`, the whole robot moves; for the rest see `move_limb`.
        """
        if not soles:
            return replace(start, position=target.position, orientation=target.orientation)
        solver, dofs = self._solver, self._leg_dofs
        torso = self._layout.root_dof + np.arange(6)
        habit, whole = self._place(start), np.concatenate([torso, dofs])
        stay = [Aim(name, at, weight=STAY, turn=STAY_TURN) for name, at in soles.items()]
        height = self.robot.standing_neck_height
        near = _shorten(start, target, AHEAD * height)
        aims = [Aim(self._sites[TORSO], near, turn=TORSO_TURN * height), *stay]

        def put_back(qpos: Array) -> Array:
            return solver.solve(qpos, stay, dofs, qpos, bounds=bounds, rounds=CORRECTIONS).qpos

        def solve(qpos: Array) -> Solution:
            return solver.solve(
                qpos, aims, whole, habit, bounds=bounds, rounds=TORSO_ROUNDS, correct=put_back
            )

        def solve_from(posture: Posture) -> Solution:
            qpos = self._place(posture)
            return solve(solver.solve(qpos, stay, whole, qpos, bounds=bounds).qpos)

        joints = np.flatnonzero(np.isin(self._layout.dof, dofs)).tolist()
        others = self._list_nudged(start, joints, bounds) if retries else ()
        best = _choose(solve(habit), map(solve_from, others))
        return read_posture(self.robot, self._model, best.qpos)

    def locate_soles(self, posture: Posture) -> dict[str, EndPose]:
        """Locate the soles in a posture, by the names of their sites."""
        return {name: self._locate_site(posture, name) for name in self.robot.sole_sites}

    def mirror_limb(self, posture: Posture, limb: LimbName) -> Posture:
        """Give the other side's limb the angles of this one's, mirrored."""
        return mirror_turned(self.robot, posture, self._limbs[limb].joints)

    def _add_sites(self) -> dict[Handle, str]:
        """Compile a model with a site for each handle; return their names."""
        robot = self.robot
        sites: dict[Handle, str] = {TORSO: SITE + TORSO}
        spec = robot.read_model()
        spec.body(robot.torso).add_site(name=sites[TORSO])
        for name, limb in self._limbs.items():
            sites[name] = self._add_end(spec, name, limb)
        for equality in spec.equalities:
            equality.active = True
        self._model = spec.compile()
        self._layout = robot.layout(self._model)
        return sites

    def _add_end(self, spec: mujoco.MjSpec, name: str, limb: Limb) -> str:
        """Return the site of a sole, or add one to the far end of a limb's last body."""
        view, last = self._view, limb.joints[-1]
        assert view is not None
        if limb.sole is not None:
            return view.model.site(limb.sole).name
        view.look(self.robot.standing.joint_pos)
        body = int(view.model.jnt_bodyid[view.ids[last]])
        way = view.end(last) - view.data.xpos[body]
        at = view.data.xmat[body].reshape(3, 3).T @ way
        spec.joint(self.robot.joint_names[last]).parent.add_site(name=SITE + name, pos=at)
        return SITE + name

    @cached_property
    def _solver(self) -> InverseKinematics:
        return InverseKinematics(self.robot, self._model)

    def _locate_site(self, posture: Posture, site: str) -> EndPose:
        now = self._solver.look(self._place(posture))
        pose = now.get_transform_frame_to_world(site, "site").wxyz_xyz
        return EndPose(position=pose[4:].copy(), orientation=pose[:4].copy())

    def _list_nudged(
        self, start: Posture, joints: list[int], bounds: Ranges | None
    ) -> Iterator[Posture]:
        """List postures in which joints are nearer to the middle of their ranges, or the stance."""
        robot = self.robot
        ranges = (robot.lower, robot.upper) if bounds is None else bounds
        goals = np.array([0.5 * (robot.lower + robot.upper), robot.standing.joint_pos])[:, joints]
        for shares in NUDGES:
            angles = start.joint_pos.copy()
            angles[joints] += shares @ (goals - angles[joints])
            yield replace(start, joint_pos=np.clip(angles, *ranges))

    @cached_property
    def _leg_dofs(self) -> Dofs:
        """Return the degrees of freedom of all joints that carry a sole."""
        carries = find_carriers(self.robot, self._model)
        bodies = [self._model.site(name).bodyid[0] for name in self.robot.sole_sites]
        return self._layout.dof[carries[bodies].any(axis=0)]

    def _place(self, posture: Posture) -> Array:
        return place(self.robot, self._model, posture)


def _shorten(start: Posture, target: EndPose, longest: float) -> EndPose:
    """Move a target of the torso nearer to where it is, if it is farther away [m]."""
    way = target.position - start.position
    share = min(1.0, longest / max(float(np.linalg.norm(way)), longest))
    turned = quaternion.slerp(start.orientation, target.orientation, share)
    return EndPose(position=start.position + share * way, orientation=turned)


def _choose(best: Solution, others: Iterable[Solution]) -> Solution:
    """Choose a solution that misses by less than the others, if it does so clearly."""
    for other in others if best.miss > NEAR else ():
        if np.sqrt(other.error) < np.sqrt(best.error) - NEAR:
            best = other
        if best.miss <= NEAR:
            break
    return best


class Drag:
    """A handle that is dragged from a posture, and what follows from its way."""

    def __init__(
        self, reach: Reach, start: Posture, handle: Handle, *, mirrored: bool, feet_stay: bool
    ) -> None:
        """Begin; the other side's limb may mirror a dragged one, the soles stay under the torso."""
        self._reach, self._start = reach, start
        self._handle: Handle = handle
        self._mirrored = mirrored
        self._soles = reach.locate_soles(start) if feet_stay and handle == TORSO else {}
        self._posture, self._missed = start, False

    def to(self, target: EndPose) -> Posture:
        """Drag towards a target; return the posture, whose joints turned by `LEAP` at most."""
        target = replace(target, orientation=quaternion.normalize(target.orientation))
        self._posture = self._move(target)
        reached = self._reach.locate(self._posture, self._handle)
        self._missed = bool(np.linalg.norm(reached.position - target.position) > NEAR)
        return self._posture

    def finish(self, target: EndPose) -> Posture:
        """Drag to a target in several leaps, until the robot has come as near as it can."""
        for _ in range(LEAPS):
            before = self._posture.joint_pos
            if np.abs(self.to(target).joint_pos - before).max() < LEAP / 2.0:
                break
        return self._posture

    def _move(self, target: EndPose) -> Posture:
        """Move to a target; while it is out of reach, other ways to bend are tried once."""
        before, reach, retries = self._posture, self._reach, not self._missed
        if self._handle == "torso":
            bounds = self._bound()
            return reach.move_torso(before, target, self._soles, bounds=bounds, retries=retries)
        moved = reach.move_limb(
            before, self._handle, target, self._start, bounds=self._bound(), retries=retries
        )
        return reach.mirror_limb(moved, self._handle) if self._mirrored else moved

    def _bound(self) -> Ranges:
        """Bound the next joint angles."""
        robot, angles = self._reach.robot, self._posture.joint_pos
        return np.maximum(robot.lower, angles - LEAP), np.minimum(robot.upper, angles + LEAP)
