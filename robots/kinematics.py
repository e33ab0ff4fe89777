"""Kinematics of a robot in a compiled world: positions, heights, center of mass, gravity."""

from __future__ import annotations

import mujoco
import numpy as np

from robots import Posture, Robot, quaternion
from robots.quaternion import Array


def lowest_point(model: mujoco.MjModel, qpos: Array) -> float:
    """Measure the height of the robot's lowest point [m] at MuJoCo positions (nq,).

    Exact for boxes, spheres, capsules, cylinders and ellipsoids; a mesh counts as its box.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    own = model.body_weldid[model.geom_bodyid] != 0
    kind, size = model.geom_type[own], model.geom_size[own]
    down = data.geom_xmat[own][:, 6:9]  # the world's z axis in each geom's frame
    along, radius = np.abs(down[:, 2]) * size[:, 1], size[:, 0]
    reaches = {
        mujoco.mjtGeom.mjGEOM_SPHERE: radius,
        mujoco.mjtGeom.mjGEOM_CAPSULE: radius + along,
        mujoco.mjtGeom.mjGEOM_CYLINDER: radius * np.hypot(down[:, 0], down[:, 1]) + along,
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: np.linalg.norm(down * size, axis=1),
    }
    reach = np.sum(np.abs(down) * size, axis=1)  # of a box
    for shape, of_shape in reaches.items():
        reach = np.where(kind == shape, of_shape, reach)
    return float(np.min(data.geom_xpos[own][:, 2] - reach))


def torso_orientation(robot: Robot, model: mujoco.MjModel, orientation: Array) -> Array:
    """Compute the torso's orientation from the IMU's (..., 4), by how it sits in the torso."""
    imu_in_torso = model.site(robot.imu_site).quat
    return quaternion.multiply(orientation, quaternion.inverse(imu_in_torso))


class GravitySense:
    """The direction of gravity in the torso, cycle by cycle: `torso_orientation` in haste."""

    def __init__(self, imu_in_torso: Array) -> None:
        """Prepare for an IMU that sits in the torso as a quaternion says, (4,)."""
        matrix = np.zeros(9)
        mujoco.mju_quat2Mat(matrix, imu_in_torso)
        self.torso_from_imu = matrix.reshape(3, 3)

    def __call__(self, orientation: Array) -> Array:
        """Turn the IMU's orientation (4,) into a unit vector in the torso, (3,)."""
        w, x, y, z = orientation.tolist()
        length = w * w + x * x + y * y + z * z
        # The last row of the rotation matrix is the world's z axis in the IMU's frame.
        down = np.array(
            [2.0 * (w * y - x * z), -2.0 * (y * z + w * x), x * x + y * y - w * w - z * z]
        )
        return self.torso_from_imu @ down / length


def place(robot: Robot, model: mujoco.MjModel, posture: Posture) -> Array:
    """Lay a posture out as MuJoCo positions, shape (nq,)."""
    layout = robot.layout(model)
    qpos = np.array(model.qpos0)
    root = layout.root_qpos
    qpos[root : root + 3] = posture.position
    qpos[root + 3 : root + 7] = posture.orientation
    qpos[layout.qpos] = posture.joint_pos
    return qpos


def read_posture(robot: Robot, model: mujoco.MjModel, qpos: Array) -> Posture:
    """Read a posture out of MuJoCo positions (nq,)."""
    layout = robot.layout(model)
    root = layout.root_qpos
    return Posture(
        position=qpos[root : root + 3].copy(),
        orientation=quaternion.normalize(qpos[root + 3 : root + 7]),
        joint_pos=np.clip(qpos[layout.qpos], robot.lower, robot.upper),
    )


def center_of_mass(
    robot: Robot, model: mujoco.MjModel, position: Array, orientation: Array, joint_pos: Array
) -> Array:
    """Compute the center of mass of postures (T, ...) in the world [m], (T, 3)."""
    data = mujoco.MjData(model)
    layout = robot.layout(model)
    root, out = layout.root_qpos, np.zeros((len(joint_pos), 3))
    for k in range(len(joint_pos)):
        data.qpos[root : root + 3] = position[k]
        data.qpos[root + 3 : root + 7] = orientation[k]
        data.qpos[layout.qpos] = joint_pos[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        out[k] = data.subtree_com[layout.torso]
    return out
