"""Mirror images of postures."""

import numpy as np

from robots import Posture, Robot, quaternion


def mirror_posture(robot: Robot, posture: Posture) -> Posture:
    """Exchange left and right in a posture."""
    return Posture(
        position=posture.position * np.array([1.0, -1.0, 1.0]),
        orientation=quaternion.mirror(posture.orientation),
        joint_pos=robot.mirror_joints(posture.joint_pos),
    )
