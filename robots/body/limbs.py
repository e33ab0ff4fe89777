"""Limbs: the arms and legs of any robot, found from its joints and soles, and where they point."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from robots.body.joint_view import SMALL, JointView
from robots.body.parts import Link, find_robot_parts
from robots.quaternion import Array
from robots.robot import Robot

LimbName = Literal["left_arm", "right_arm", "left_leg", "right_leg"]
LIMB_NAMES: tuple[LimbName, ...] = ("left_arm", "right_arm", "left_leg", "right_leg")
LEGS: tuple[LimbName, LimbName] = ("left_leg", "right_leg")
ARMS: tuple[LimbName, LimbName] = ("left_arm", "right_arm")


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
    """Joint at whose anchor the lower part ends: ankle or wrist; None where the limb ends there."""
    sole: int | None
    """Site of its sole; None for an arm."""


BEND = 0.6  # rad by which knees are bent before a search
WHOLE = 3  # pitch joints of a leg that can squat: hip, knee, ankle


@dataclass(frozen=True, eq=False)
class Leg:
    """A leg, measured at the angles that the view looked at last, in the torso's frame."""

    view: JointView
    joints: tuple[int, ...]
    """Places of its joints, from the hip down."""
    sole: int
    """Site of its sole."""

    @property
    def hip(self) -> Array:
        """Return the position of its first joint [m], (3,)."""
        return self.view.anchor(self.joints[0])

    @property
    def sole_position(self) -> Array:
        """Return the position of its sole [m], (3,)."""
        return self.view.data.site_xpos[self.sole].copy()

    @property
    def sole_axes(self) -> Array:
        """Return forward, left and up of its sole, in columns, (3, 3)."""
        return self.view.data.site_xmat[self.sole].reshape(3, 3).copy()

    def list_pitch(self) -> list[int]:
        """List the joints that bend it forward and back."""
        return self.view.list_pitch(self.joints)

    def measure_stretched(self) -> float:
        """Measure the way from the hip to the sole through the joints that bend it [m].

        The hip's width does not count.
        """
        points = [self.hip, *map(self.view.anchor, self.list_pitch()), self.sole_position]
        flat = np.array(points)[:, [0, 2]]
        return float(np.linalg.norm(np.diff(flat, axis=0), axis=1).sum())

    def bend_knee(self, angles: Array, way: float) -> None:
        """Bend the knee in joint angles (n,), in place, so that hip, shank and foot follow.

        Args:
            angles: [rad]
            way: 1 for a knee that goes forward, -1 for one that goes back.
        """
        pitch = self.list_pitch()
        if len(pitch) >= WHOLE:
            hip, knee, ankle = pitch[0], pitch[len(pitch) // 2], pitch[-1]
            for k, share in ((hip, -0.5), (knee, 1.0), (ankle, -0.5)):
                angles[k] += way * BEND * share * np.sign(self.view.axis(k)[1])

    def measure_knee_lead(self) -> float:
        """Measure how far the knee is in front of the line from hip to ankle [m]."""
        pitch = self.list_pitch()
        if len(pitch) < WHOLE:
            return 0.0
        hip, knee, ankle = (self.view.anchor(pitch[i]) for i in (0, len(pitch) // 2, -1))
        share = (hip[2] - knee[2]) / max(hip[2] - ankle[2], 1e-6)
        return float(knee[0] - hip[0] - share * (ankle[0] - hip[0]))


SHORT = 0.02  # m; joints nearer to each other than this are one, such as those of an ankle


PARALLEL = np.cos(np.radians(30.0))
OVER_SOLES = 0.35  # leg lengths by which the mass may be beside the soles of a crouching robot


class Limbs(JointView):
    """Arms and legs of a robot, found from its joints and soles.

    Positions and directions are in the torso's frame.
    """

    def __init__(self, robot: Robot) -> None:
        """Find the limbs; a robot without two legs of at least two joints is refused."""
        view = JointView.of(robot)
        super().__init__(view.model, view.ids, robot.passive_joints)
        self.robot = robot
        self._soles = [self.model.site(name).id for name in robot.sole_sites]
        self.look(robot.standing.joint_pos)
        found = sorted(self._list_limbs(), key=lambda each: abs(each[0]))
        self.all: dict[LimbName, Limb] = {limb.name: limb for _, limb in found}
        """Limbs by name, the outermost on each side; a robot may lack arms."""
        if not set(LEGS) <= self.all.keys():
            raise ValueError(
                f"robot '{robot.name}' has no two legs with a knee, expected a left and a right "
                "leg of two joints or more that end in sole_sites"
            )
        leg = self.all["left_leg"]
        ends = [leg.start, leg.middle] + ([] if leg.end is None else [leg.end])
        points = np.array([self.anchor(k) for k in ends])
        self.thigh_and_shank = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        """Length of both [m]."""

    @cached_property
    def rest(self) -> dict[LimbName, LimbPose]:
        """Return the poses of the limbs in the robot's stance."""
        return self.measure(self.robot.standing.joint_pos)

    def measure(self, joint_pos: Array) -> dict[LimbName, LimbPose]:
        """Measure where the limbs point at joint angles (n,)."""
        self.look(joint_pos)
        return {name: self.read_pose(limb) for name, limb in self.all.items()}

    def read_pose(self, limb: Limb) -> LimbPose:
        """Return where a limb points, at the angles looked at last."""
        middle = self.anchor(limb.middle)
        upper = unit(middle - self.anchor(limb.start))
        lower = unit(self.find_end(limb) - middle)
        is_arm = limb.sole is None
        return LimbPose(upper, lower, None if is_arm else self.leg(limb.name).sole_axes)

    def first_body(self, limb: Limb) -> int:
        """Return the body that a limb's first joint moves."""
        return int(self.model.jnt_bodyid[self.ids[limb.joints[0]]])

    def find_end(self, limb: Limb) -> Array:
        """Find where a limb's lower part ends, at the angles looked at last, (3,) [m]."""
        return self.end(limb.middle) if limb.end is None else self.anchor(limb.end)

    def measure_parts(self, limb: Limb) -> tuple[float, float]:
        """Measure the upper and the lower part of a limb in the stance [m]."""
        self.look(self.robot.standing.joint_pos)
        upper = self.anchor(limb.middle) - self.anchor(limb.start)
        lower = self.find_end(limb) - self.anchor(limb.middle)
        return float(np.linalg.norm(upper)), float(np.linalg.norm(lower))

    def leg(self, name: LimbName) -> Leg:
        """Return a leg, to be measured at the angles looked at last."""
        limb = self.all[name]
        assert limb.sole is not None
        return Leg(self, limb.joints, limb.sole)

    @property
    def mass(self) -> float:
        """Return the mass of the robot [kg]."""
        return float(self.model.body_subtreemass[self.torso])

    def measure_balance(self, joint_pos: Array) -> float | None:
        """Measure how far the center of mass is in front of the soles, in leg lengths.

        None where the robot would not stand on them: where they are not parallel, or the mass is
        not above them.
        """
        self.look(joint_pos)
        left, right = (self.leg(name).sole_axes for name in LEGS)
        if left[:, 2] @ right[:, 2] < PARALLEL:
            return None
        ahead, above = self.over_soles()
        return ahead if above > 0.0 and abs(ahead) < OVER_SOLES else None

    def over_soles(self) -> tuple[float, float]:
        """Return the center of mass in front of and above the soles, in leg lengths."""
        legs = [self.leg(name) for name in LEGS]
        middle = np.mean([leg.sole_position for leg in legs], axis=0)
        axes = np.mean([leg.sole_axes for leg in legs], axis=0)
        way = (self.center_of_mass - middle) / self.thigh_and_shank
        return float(way @ axes[:, 0]), float(way @ axes[:, 2])

    # Finding them -------------------------------------------------------------------------------

    def _list_limbs(self) -> list[tuple[float, Limb]]:
        """List the limbs, each with its distance to the left [m]."""
        parts = find_robot_parts(self.robot, self.model)
        found = [("leg", link) for _, link in parts.legs]
        found += [("arm", link) for _, link in parts.arms]
        return [limb for kind, link in found if (limb := self._describe(kind, link)) is not None]

    def _describe(self, kind: str, first: Link) -> tuple[float, Limb] | None:
        """Describe a limb; None if it has no joint that bends it in its middle."""
        chain = self._list_chain(first)
        places = {joint: k for k, joint in enumerate(self.ids)}  # of those with servos
        joints = [places[joint] for link in chain for joint in link.joints if joint in places]
        if len(joints) < 2:
            return None
        anchors = {k: self.anchor(k).copy() for k in joints}
        sites = {site for link in chain for site in link.sites}
        sole = next(s for s in self._soles if s in sites) if kind == "leg" else None
        # The end of a limb: its sole, or the end of what its last joint moves.
        tip = self.end(joints[-1]) if sole is None else self.data.site_xpos[sole]
        tip = tip.copy()
        bending = self._list_bending(joints)
        start, middle = self._find_bends(joints, bending, anchors, tip)
        below = [k for k in bending if joints.index(k) > joints.index(middle)]
        ends = [k for k in below if np.linalg.norm(anchors[k] - anchors[middle]) > SHORT]
        aside = float(anchors[joints[0]][1] + tip[1])
        limb = Limb(
            name=f"{'left' if aside > 0.0 else 'right'}_{kind}",  # type: ignore[arg-type]
            joints=tuple(joints),
            start=start,
            middle=middle,
            end=ends[0] if ends else None,
            sole=sole,
        )
        return aside, limb

    def _find_bends(
        self, joints: list[int], bending: list[int], anchors: dict[int, Array], tip: Array
    ) -> tuple[int, int]:
        """Find where the upper part begins, and where it ends: farthest from both ends."""
        first = anchors[joints[0]]
        middle = max(
            bending,
            key=lambda k: min(np.linalg.norm(anchors[k] - first), np.linalg.norm(anchors[k] - tip)),
        )
        above = joints[: joints.index(middle)]
        bends = [k for k in above if not self.twists(k, anchors[middle] - anchors[k])]
        return (bends[-1] if bends else above[0]), middle

    def _list_bending(self, joints: list[int]) -> list[int]:
        """List the joints after the first that do more than twist the limb at 0; or else all."""
        robot = self.robot
        self.look(np.clip(0.0, robot.lower, robot.upper))
        tip = self.end(joints[-1])
        bending = [k for k in joints[1:] if not self.twists(k, tip - self.anchor(k))]
        self.look(robot.standing.joint_pos)
        return bending or joints[1:]

    def _list_chain(self, first: Link) -> list[Link]:
        """List the links along a limb: to its sole, or else to its longest end."""
        chain = [first]
        while chain[-1].children:
            chain.append(max(chain[-1].children, key=self._rank))
        return chain

    def _rank(self, link: Link) -> tuple[bool, int]:
        below = list(link.walk())
        return any(set(self._soles) & set(part.sites) for part in below), len(below)


def unit(vector: Array) -> Array:
    """Scale a vector (3,) to unit length; one without length stays short."""
    return vector / max(float(np.linalg.norm(vector)), SMALL)
