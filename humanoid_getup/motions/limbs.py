"""Limbs: what arms and legs of any robot point at, and the joint angles that point them so."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import mujoco
import numpy as np
from scipy.optimize import least_squares

from robots import Robot
from robots.quaternion import Array
from robots.reshaping.skeleton import Link, Skeleton

LimbName = Literal["left_arm", "right_arm", "left_leg", "right_leg"]
LIMB_NAMES: tuple[LimbName, ...] = ("left_arm", "right_arm", "left_leg", "right_leg")
TWIST = 0.8  # cosine between a joint's axis and its limb from which it only twists the limb
BALANCE = 4.0  # weight of the mass center's place over the soles, in leg lengths
HABIT = 0.05  # weight of the way from the angles before, beside unit vectors [1/rad]
FOOT = 0.5  # weight of a foot's axes beside the directions of thigh and shank
SMALL = 1e-9
EDGE = 1e-6  # rad from the end of a range at which a search may begin
LEGS: tuple[LimbName, LimbName] = ("left_leg", "right_leg")
PARALLEL = np.cos(np.radians(30.0))
OVER_SOLES = 0.35  # leg lengths by which the mass may be beside the soles of a crouching robot


@dataclass(frozen=True, eq=False)
class LimbPose:
    """Where the parts of a limb point, in the torso's frame."""

    upper: Array
    """Unit vector along upper arm or thigh, away from the torso, (3,)."""
    lower: Array
    """Unit vector along forearm or shank, (3,)."""
    foot: Array | None = None
    """Forward, left and up of a sole, in columns, (3, 3); None for an arm."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Limb:
    """A limb of a robot; joints are places in the robot's order."""

    name: LimbName
    joints: tuple[int, ...]
    """All of its joints, from the torso on."""
    start: int
    """Joint at whose anchor its upper part begins."""
    middle: int
    """Joint at whose anchor the upper part ends and the lower one begins: elbow or knee."""
    end: int | None
    """Joint at whose anchor the lower part ends: an ankle; None where the limb ends there."""
    body: int
    """Its last body."""
    sole: int | None
    """Site of its sole."""

    @property
    def is_leg(self) -> bool:
        """Return whether it ends in a sole."""
        return self.sole is not None


class Limbs:
    """Arms and legs of a robot, found from its joints and soles."""

    def __init__(self, robot: Robot) -> None:
        """Find the limbs.

        Raises:
            ValueError: if it does not have two legs of at least two joints.
        """
        self.robot, self.model = robot, robot.spec().compile()
        self.data = mujoco.MjData(self.model)
        self._layout = robot.layout(self.model)
        self._ids = [self.model.joint(name).id for name in robot.joint_names]
        self._look(robot.standing.joint_pos)
        self.all: dict[LimbName, Limb] = {}
        """Limbs by name; a robot may lack arms."""
        for limb in self._list_limbs():
            self.all.setdefault(limb.name, limb)
        if not {"left_leg", "right_leg"} <= self.all.keys():
            raise ValueError(f"robot '{robot.name}' has no two legs with a knee, expected those")

    @cached_property
    def rest(self) -> dict[LimbName, LimbPose]:
        """Return the poses of the limbs in the robot's stance."""
        return self.measure(self.robot.standing.joint_pos)

    def measure(self, joint_pos: Array) -> dict[LimbName, LimbPose]:
        """Measure where the limbs point at joint angles (n,)."""
        self._look(joint_pos)
        return {name: self._measure(limb) for name, limb in self.all.items()}

    def solve(self, poses: dict[LimbName, LimbPose], before: Array) -> Array:
        """Find the joint angles (n,) that bring the limbs nearest to poses.

        Joints that are in no limb, and those that no pose concerns, stay as before.

        Args:
            poses: Of the limbs to be moved; those that the robot lacks are left out.
            before: Angles from which the way should be short [rad], (n,).
        """
        angles = before.copy()
        for name, pose in poses.items():
            if name in self.all:
                angles = self._solve_limb(self.all[name], pose, angles)
        return angles

    def measure_balance(self, joint_pos: Array) -> float | None:
        """Measure how far the center of mass is in front of the soles, in leg lengths.

        None where the robot would not stand on them: where they are not parallel, or the mass is
        not above them.
        """
        self._look(joint_pos)
        soles = [self.all[name].sole for name in LEGS]
        frames = [self.data.site_xmat[sole].reshape(3, 3) for sole in soles]
        if frames[0][:, 2] @ frames[1][:, 2] < PARALLEL:
            return None
        ahead, above = self._over_soles()
        return ahead if above > 0.0 and abs(ahead) < OVER_SOLES else None

    def solve_balance(self, ahead: float, before: Array) -> Array:
        """Shift the mass over the soles by hips, knees and ankles; see `measure_balance`."""
        robot = self.robot
        joints = [k for name in LEGS for k in self._list_pitch_joints(self.all[name])]
        lower, upper = robot.lower[joints], robot.upper[joints]
        start = np.clip(before[joints], lower + EDGE, upper - EDGE)
        self._look(before)
        feet = [self.data.site_xmat[self.all[name].sole].copy() for name in LEGS]

        def residuals(values: Array) -> Array:
            angles = before.copy()
            angles[joints] = values
            self._look(angles)
            turned = [
                self.data.site_xmat[self.all[name].sole] - foot
                for name, foot in zip(LEGS, feet, strict=True)
            ]
            change = HABIT * (values - start)
            off = BALANCE * (self._over_soles()[0] - ahead)
            return np.concatenate([[off], *turned, change])

        angles = before.copy()
        angles[joints] = least_squares(residuals, start, bounds=(lower, upper)).x
        return angles

    def _over_soles(self) -> tuple[float, float]:
        """Return how far the mass is in front of the soles and above them, in leg lengths."""
        soles = [self.all[name].sole for name in LEGS]
        middle = np.mean([self.data.site_xpos[sole] for sole in soles], axis=0)
        axes = np.mean([self.data.site_xmat[sole].reshape(3, 3) for sole in soles], axis=0)
        way = (self.data.subtree_com[self._layout.torso] - middle) / self.leg_length
        return float(way @ axes[:, 0]), float(way @ axes[:, 2])

    @cached_property
    def leg_length(self) -> float:
        """Return the length of thigh and shank [m]."""
        leg = self.all["left_leg"]
        self._look(self.robot.standing.joint_pos)
        ends = [leg.start, leg.middle] + ([] if leg.end is None else [leg.end])
        points = np.array([self.anchor(k) for k in ends])
        return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())

    @property
    def mass(self) -> float:
        """Return the mass of the robot [kg]."""
        return float(self.model.body_subtreemass[self._layout.torso])

    def _list_pitch_joints(self, limb: Limb) -> list[int]:
        self._look(self.robot.standing.joint_pos)
        return [k for k in limb.joints if abs(self.data.xaxis[self._ids[k]][1]) > TWIST]

    def _solve_limb(self, limb: Limb, pose: LimbPose, before: Array) -> Array:
        joints, robot = list(limb.joints), self.robot
        lower, upper = robot.lower[joints], robot.upper[joints]
        start = np.clip(before[joints], lower, upper)

        def residuals(values: Array) -> Array:
            angles = before.copy()
            angles[joints] = values
            self._look(angles)
            found = self._measure(limb)
            errors = [found.upper - pose.upper, found.lower - pose.lower, HABIT * (values - start)]
            if pose.foot is not None and found.foot is not None:
                errors.append(FOOT * (found.foot - pose.foot).ravel())
            return np.concatenate(errors)

        tries = [start, 0.5 * (lower + upper), robot.standing.joint_pos[joints]]
        inner = np.maximum(upper - lower, SMALL) * 1e-6
        solved = [
            least_squares(
                residuals, np.clip(t, lower + inner, upper - inner), bounds=(lower, upper)
            )
            for t in tries
        ]
        angles = before.copy()
        angles[joints] = min(solved, key=lambda found: found.cost).x
        return angles

    def _look(self, joint_pos: Array) -> None:
        data, layout = self.data, self._layout
        data.qpos[:] = self.model.qpos0
        data.qpos[layout.root_position] = 0.0
        data.qpos[layout.root_orientation] = [1.0, 0.0, 0.0, 0.0]
        data.qpos[layout.qpos] = joint_pos
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_comPos(self.model, data)

    def _measure(self, limb: Limb) -> LimbPose:
        middle = self.anchor(limb.middle)
        upper = _unit(middle - self.anchor(limb.start))
        lower = _unit(self.end(limb) - middle)
        if limb.sole is None:
            return LimbPose(upper, lower)
        return LimbPose(upper, lower, self.data.site_xmat[limb.sole].reshape(3, 3).copy())

    def anchor(self, joint: int) -> Array:
        """Return a point on a joint's axis in the torso's frame, at the angles measured last."""
        return self.data.xanchor[self._ids[joint]]

    def end(self, limb: Limb) -> Array:
        """Return where a limb's lower part ends, at the angles measured last, (3,) [m]."""
        if limb.end is not None:
            return self.anchor(limb.end)
        # An arm ends about as far beyond its mass center as its last joint is before it.
        return 2.0 * self.data.subtree_com[limb.body] - self.anchor(limb.middle)

    def _list_limbs(self) -> list[Limb]:
        robot = self.robot
        skeleton = Skeleton(
            robot.spec(),
            torso=robot.torso,
            sole_sites=robot.sole_sites,
            head_joints=[joint.name for joint in robot.joints if joint.segment == "head"],
        )
        found = [("leg", link) for _, link in skeleton.legs]
        found += [("arm", link) for _, link in skeleton.arms]
        limbs = [self._describe(kind, link) for kind, link in found]
        return [limb for limb in limbs if limb is not None]

    def _describe(self, kind: str, first: Link) -> Limb | None:
        """Describe a limb; None if it has no joint that bends it in its middle."""
        joints = self._list_joints(first)
        if len(joints) < 2:
            return None
        anchors = {k: self.anchor(k).copy() for k in joints}
        body = int(self.model.jnt_bodyid[self._ids[joints[-1]]])
        sole = self._find_sole(first) if kind == "leg" else None
        side = "left" if anchors[joints[0]][1] > 0.0 else "right"
        far = self._tip(body, joints, sole)
        hip = anchors[joints[0]]
        middle = max(
            self._list_bending(joints, body, sole) or joints[1:],
            key=lambda k: min(np.linalg.norm(anchors[k] - hip), np.linalg.norm(anchors[k] - far)),
        )
        above = joints[: joints.index(middle)]
        bends = [k for k in above if not self._twists(k, anchors[middle] - anchors[k])]
        below = joints[joints.index(middle) + 1 :]
        ends = [k for k in below if np.linalg.norm(anchors[k] - anchors[middle]) > 0.02]
        return Limb(
            name=f"{side}_{kind}",  # type: ignore[arg-type]
            joints=tuple(joints),
            start=bends[-1] if bends else above[0],
            middle=middle,
            end=ends[0] if sole is not None and ends else None,
            body=int(self.model.jnt_bodyid[self._ids[middle]]),
            sole=sole,
        )

    def _list_bending(self, joints: list[int], body: int, sole: int | None) -> list[int]:
        """List the joints beyond the first that do not only twist a limb, all joints at 0."""
        robot = self.robot
        self._look(np.clip(0.0, robot.lower, robot.upper))
        far = self._tip(body, joints, sole)
        bending = [k for k in joints[1:] if not self._twists(k, far - self.anchor(k))]
        self._look(robot.standing.joint_pos)
        return bending

    def _list_joints(self, first: Link) -> list[int]:
        """List the joints along a limb, to its longest end, in the robot's order of places."""
        chain, names = [first], self.robot.joint_names
        while chain[-1].children:
            chain.append(max(chain[-1].children, key=lambda link: len(list(link.walk()))))
        found = [joint.name for link in chain for body in link.bodies for joint in body.joints]
        return [names.index(name) for name in found if name in names]

    def _find_sole(self, first: Link) -> int | None:
        own = frozenset[str]().union(*(link.site_names for link in first.walk()))
        return next((self.model.site(s).id for s in self.robot.sole_sites if s in own), None)

    def _tip(self, body: int, joints: list[int], sole: int | None) -> Array:
        if sole is not None:
            return self.data.site_xpos[sole].copy()
        return 2.0 * self.data.subtree_com[body] - self.anchor(joints[-1])

    def _twists(self, joint: int, way: Array) -> bool:
        axis = self.data.xaxis[self._ids[joint]]
        return bool(abs(axis @ way) > TWIST * max(float(np.linalg.norm(way)), SMALL))


def turn_to_rest(pose: LimbPose, source: LimbPose, target: LimbPose) -> LimbPose:
    """Take a foot's attitude relative to its own robot's stance to that of another robot."""
    if pose.foot is None or source.foot is None or target.foot is None:
        return pose
    return replace(pose, foot=pose.foot @ source.foot.T @ target.foot)


def _unit(vector: Array) -> Array:
    return vector / max(float(np.linalg.norm(vector)), SMALL)
