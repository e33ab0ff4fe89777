"""Finds the arms and legs of any robot from its joints and soles."""

from __future__ import annotations

import numpy as np

from robots.body.joint_view import JointView
from robots.body.limb import LEGS, Limb, LimbName
from robots.body.links import Link
from robots.body.parts import find_robot_parts
from robots.quaternion import Array
from robots.robot import Robot

SHORT = 0.02  # m; joints nearer to each other than this are one, such as those of an ankle


def find_limbs(robot: Robot, view: JointView) -> dict[LimbName, Limb]:
    """Find a robot's limbs; it may lack arms.

    Of several arms or legs on a side, the outermost counts.

    Args:
        robot: Robot.
        view: Of its joints, in the stance.

    Raises:
        ValueError: if it does not have two legs of at least two joints.
    """
    found = [*_LimbFinder(robot, view).list_limbs()]
    limbs: dict[LimbName, Limb] = {
        limb.name: limb for _, limb in sorted(found, key=lambda each: abs(each[0]))
    }
    if not set(LEGS) <= limbs.keys():
        raise ValueError(
            f"robot '{robot.name}' has no two legs with a knee, expected a left and a right leg "
            "of two joints or more that end in sole_sites"
        )
    return limbs


class _LimbFinder:
    def __init__(self, robot: Robot, view: JointView) -> None:
        self._robot, self._view = robot, view
        self._soles = [view.model.site(name).id for name in robot.sole_sites]

    def list_limbs(self) -> list[tuple[float, Limb]]:
        """List the limbs, each with its distance to the left [m]."""
        parts = find_robot_parts(self._robot, self._view.model)
        found = [("leg", link) for _, link in parts.legs]
        found += [("arm", link) for _, link in parts.arms]
        return [limb for kind, link in found if (limb := self._describe(kind, link)) is not None]

    def _describe(self, kind: str, first: Link) -> tuple[float, Limb] | None:
        """Describe a limb; None if it has no joint that bends it in its middle."""
        chain = self._list_chain(first)
        joints = self._list_joints(chain)
        if len(joints) < 2:
            return None
        anchors = {k: self._view.anchor(k).copy() for k in joints}
        sole = self._find_sole(chain) if kind == "leg" else None
        tip = self._locate_tip(joints, sole)
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
        bends = [k for k in above if not self._view.twists(k, anchors[middle] - anchors[k])]
        return (bends[-1] if bends else above[0]), middle

    def _list_bending(self, joints: list[int]) -> list[int]:
        """List the joints after the first that do more than twist the limb, all joints at 0.

        Where all of them only twist it, these are all.
        """
        robot, view = self._robot, self._view
        view.look(np.clip(0.0, robot.lower, robot.upper))
        tip = view.end(joints[-1])
        bending = [k for k in joints[1:] if not view.twists(k, tip - view.anchor(k))]
        view.look(robot.standing.joint_pos)
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

    def _list_joints(self, chain: list[Link]) -> list[int]:
        """List the joints with servos along a chain, as places in the robot's order."""
        places = {joint: k for k, joint in enumerate(self._view.ids)}
        return [places[joint] for link in chain for joint in link.joints if joint in places]

    def _find_sole(self, chain: list[Link]) -> int:
        sites = {site for link in chain for site in link.sites}
        return next(sole for sole in self._soles if sole in sites)

    def _locate_tip(self, joints: list[int], sole: int | None) -> Array:
        """Locate the end of a limb: its sole, or the end of what its last joint moves."""
        tip = self._view.end(joints[-1]) if sole is None else self._view.data.site_xpos[sole]
        return tip.copy()
