"""Both legs of a robot: their joints and bounds, and their feet as in the stance."""

from __future__ import annotations

import numpy as np

from robots.body.flat_soles import MARGIN, Foot
from robots.body.limb import ARMS, LEGS
from robots.body.limbs import Limbs
from robots.body.links import list_way_up
from robots.body.overlap import find_overlaps
from robots.quaternion import Array


class BothLegs:
    """Both legs of a robot, which stand on flat soles."""

    def __init__(self, limbs: Limbs) -> None:
        """Measure the stance."""
        self.limbs, robot = limbs, limbs.robot
        self.joints = np.array([k for name in LEGS for k in limbs.all[name].joints])
        """Their joints, (j,)."""
        lower, upper = robot.lower[self.joints], robot.upper[self.joints]
        margin = np.minimum(MARGIN, 0.25 * (upper - lower))
        self.bounds = (lower + margin, upper - margin)
        """Least and greatest angles of these [rad], (j,) each."""
        limbs.look(robot.standing.joint_pos)
        self.legs = [limbs.leg(name) for name in LEGS]
        """As the limbs were looked at last."""
        self.feet = [Foot.stand(leg) for leg in self.legs]
        """Where the soles are in the stance."""
        self.length = self.legs[0].measure_stretched()
        """Of a stretched leg [m]."""
        left, right = (leg.sole_position[0] for leg in self.legs)
        self.stride = float(left - right)
        """By which the left sole is in front of the right one in the stance [m]."""

    def look(self, base: Array, values: Array) -> Array:
        """Look at angles (n,) with others of the legs (j,); return all, (n,)."""
        angles = base.copy()
        angles[self.joints] = values
        self.limbs.look(angles)
        return angles

    def bend_knees(self, base: Array, way: float) -> Array:
        """Bend the knees of angles (n,) forward, 1, or back, -1; return those of the legs, (j,)."""
        bent = base.copy()
        self.limbs.look(base)
        for leg in self.legs:
            leg.bend_knee(bent, way)
        return bent[self.joints]


def find_overlaps_but_arms(limbs: Limbs, joint_pos: Array) -> set[tuple[int, int]]:
    """Find bodies that penetrate each other, except arms, which can be moved away."""
    limbs.look(joint_pos)
    arms = {limbs.first_body(limbs.all[name]) for name in ARMS if name in limbs.all}
    return {
        pair
        for pair in find_overlaps(limbs.model, limbs.data.qpos)
        if not any(arms & {*list_way_up(limbs.model, body)} for body in pair)
    }
