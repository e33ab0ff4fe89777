"""Records of runs that never were, for tests of what is read from them."""

from __future__ import annotations

from typing import Any

import numpy as np

from humanoid_getup.experiments.judging.record import Record
from humanoid_getup.experiments.judging.standing import Stance
from robots import Robot
from robots.robot import Layout


def make_record(robot: Robot, shape: tuple[int, ...], period: float, **changes: Any) -> Record:
    """Make a record of robots that stand still, (..., T), except for what is changed."""
    leading = shape[:-1]
    joints = np.zeros((*shape, robot.n))
    height = np.full(shape, robot.standing_neck_height)
    stance = Stance(
        neck_height=height,
        tilt=np.zeros(shape),
        sole_rise=np.zeros(shape),
        non_foot_contact=np.zeros(shape, dtype=bool),
    )
    values: dict[str, Any] = {
        "layout": Layout(
            qpos=7 + np.arange(robot.n), dof=np.arange(robot.n), root_qpos=0, root_dof=0, torso=1
        ),
        "period": period,
        "voltage": np.full(leading, robot.supply_voltage),
        "upright": np.ones(shape, dtype=bool),
        "stance": stance,
        "qpos": np.tile([*np.zeros(3), 1.0, *np.zeros(3 + robot.n)], (*shape, 1)),
        "joint_vel": joints,
        "neck": np.zeros((*shape, 3)),
        "torque": joints,
        "actuator_vel": joints,
        "overlap": np.zeros(shape),
        "diverged": np.zeros(leading, dtype=bool),
        "cycles": np.full(leading, shape[-1]),
        "settled": np.zeros(leading, dtype=bool),
        "failed": np.zeros(leading, dtype=bool),
    }
    return Record(**(values | changes))
