"""Leg length: scenes, durations and motions of other robots are scaled by it."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.body.parts import find_robot_parts
from robots.robot import Robot, RobotError


def leg_length(robot: Robot) -> float:
    """Measure the distance of a leg's first joint from its sole, all joints at 0 [m].

    Two other lengths serve other ends: `Leg.measure_stretched` goes through the joints that bend a
    leg, and says how deep it crouches; `Limbs.thigh_and_shank` leaves the foot out.

    Raises:
        RobotError: if its first sole is on no leg.
    """
    model = robot.spec().compile()
    sole = model.site(robot.sole_sites[0]).id
    legs = [leg for _, leg in find_robot_parts(robot, model).legs]
    leg = next((leg for leg in legs if any(sole in link.sites for link in leg.walk())), None)
    if leg is None:
        raise RobotError(
            f"robot '{robot.name}' has no leg that ends in site '{robot.sole_sites[0]}', expected "
            "sole_sites on feet that hang on joints"
        )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return float(np.linalg.norm(data.xanchor[leg.joints[0]] - data.site_xpos[sole]))
