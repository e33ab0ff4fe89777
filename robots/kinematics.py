"""Kinematics of a robot in a compiled world: positions, gravity, and which way its limbs move."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots import quaternion
from robots.posture import Posture
from robots.quaternion import Array
from robots.robot import Robot


def rest_passive_joints(model: mujoco.MjModel, names: Sequence[str], qpos: Array) -> None:
    """Put passive joints into their rest positions in MuJoCo positions (..., nq), in place.

    A joint that an equality follows from another one is there; any other is where its spring is at
    rest or, without stiffness, at ``qpos0``.
    """
    if not names:
        return
    passive = [model.joint(name).id for name in names]
    addresses, has_spring = model.jnt_qposadr[passive], model.jnt_stiffness[passive] > 0.0
    rest = np.where(has_spring, model.qpos_spring[addresses], model.qpos0[addresses])
    qpos[..., addresses] = rest
    couple_passive_joints(model, names, qpos)


def couple_passive_joints(model: mujoco.MjModel, names: Sequence[str], qpos: Array) -> None:
    """Set passive joints from the joints that they are coupled to, in place.

    An equality of joints states the first one as a polynomial of the second. Where a joint follows
    one that follows another, the equalities stand in that order.
    """
    passive = {model.joint(name).id for name in names}
    couples = (model.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (model.eq_active0 > 0)
    for k in np.flatnonzero(couples) if passive else ():
        follower, leader = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        if follower not in passive:
            continue
        at, coefficients = model.jnt_qposadr[follower], model.eq_data[k, :5]
        moved = np.zeros(qpos.shape[:-1])
        if leader >= 0:
            address = model.jnt_qposadr[leader]
            moved = qpos[..., address] - model.qpos0[address]
        qpos[..., at] = model.qpos0[at] + np.polynomial.polynomial.polyval(moved, coefficients)


def lowest_point(model: mujoco.MjModel, qpos: Array) -> float:
    """Measure the height of the robot's lowest point [m] at MuJoCo positions (nq,)."""
    return float(lowest_points(model, qpos[np.newaxis])[0])


def lowest_points(model: mujoco.MjModel, qpos: Array) -> Array:
    """Measure the height of the robot's lowest point [m], (T,), at MuJoCo positions (T, nq)."""
    data, reach = mujoco.MjData(model), GeomReach(model)
    own = reach.geoms
    height, up = np.zeros((len(qpos), len(own))), np.zeros((len(qpos), len(own), 3))
    for k, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        height[k] = data.geom_xpos[own, 2]
        up[k] = data.geom_xmat[own, 6:9]
    return np.min(height - reach(up), axis=-1)


class GeomReach:
    """Reach of each geom of a robot from its center, the same in opposite directions.

    Exact for boxes, spheres, capsules, cylinders and ellipsoids; a mesh counts as its box.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.geoms = np.flatnonzero(model.body_weldid[model.geom_bodyid] != 0)
        """The geoms that are the robot's, not the world's, (g,)."""
        kind, self._size = model.geom_type[self.geoms], model.geom_size[self.geoms]
        shape = mujoco.mjtGeom
        is_ball = (kind == shape.mjGEOM_SPHERE) | (kind == shape.mjGEOM_CAPSULE)
        is_long = (kind == shape.mjGEOM_CAPSULE) | (kind == shape.mjGEOM_CYLINDER)
        self._extent = np.where((is_ball | is_long)[:, np.newaxis], 0.0, self._size)
        self._extent[is_long, 2] = self._size[is_long, 1]
        self._radius = np.where(is_ball, self._size[:, 0], 0.0)
        self._is_cylinder = kind == shape.mjGEOM_CYLINDER
        self._is_ellipsoid = kind == shape.mjGEOM_ELLIPSOID

    def __call__(self, direction: Array) -> Array:
        """Measure how far the geoms reach along directions [m], (..., g).

        The directions are unit vectors in each geom's frame, (..., g, 3): for the world's z axis
        the last row of its rotation matrix.
        """
        along = np.abs(direction) * self._extent
        reach = along[..., 0] + along[..., 1] + along[..., 2] + self._radius
        if self._is_cylinder.any():
            across = self._size[:, 0] * np.hypot(direction[..., 0], direction[..., 1])
            reach = reach + self._is_cylinder * across
        if self._is_ellipsoid.any():
            round_ = np.linalg.norm(direction * self._size, axis=-1)
            reach = np.where(self._is_ellipsoid, round_, reach)
        return reach


def imu_in_torso(robot: Robot, model: mujoco.MjModel) -> Array:
    """Return the orientation of the IMU in the torso, (4,)."""
    return model.site(robot.require_imu_site()).quat


def torso_orientation(robot: Robot, model: mujoco.MjModel, orientation: Array) -> Array:
    """Compute the torso's orientation (..., 4) from that of the IMU mounted on it."""
    return quaternion.multiply(orientation, quaternion.inverse(imu_in_torso(robot, model)))


class GravitySense:
    """The direction of gravity in the torso: a fast `torso_orientation` for every cycle."""

    def __init__(self, imu_in_torso: Array) -> None:
        """Prepare for an IMU with this orientation in the torso, (4,)."""
        self.torso_from_imu = quaternion.to_matrix(imu_in_torso)

    def __call__(self, orientation: Array) -> Array:
        """Convert the IMU's orientation (4,) to a unit vector in the torso's frame, (3,)."""
        w, x, y, z = orientation.tolist()
        length = w * w + x * x + y * y + z * z
        # The last row of the rotation matrix is the world's z axis in the IMU's frame.
        down = np.array(
            [2.0 * (w * y - x * z), -2.0 * (y * z + w * x), x * x + y * y - w * w - z * z]
        )
        return self.torso_from_imu @ down / length


def place(robot: Robot, model: mujoco.MjModel, posture: Posture) -> Array:
    """Convert a posture to MuJoCo positions, shape (nq,)."""
    return place_postures(robot, model, posture.position, posture.orientation, posture.joint_pos)


def place_postures(
    robot: Robot, model: mujoco.MjModel, position: Array, orientation: Array, joint_pos: Array
) -> Array:
    """Convert postures, (..., 3) [m], (..., 4), (..., n) [rad], to MuJoCo positions, (..., nq).

    The world's other bodies are placed as in ``qpos0``; passive joints rest.
    """
    layout = robot.layout(model)
    qpos = np.empty((*joint_pos.shape[:-1], model.nq))
    qpos[...] = model.qpos0
    qpos[..., layout.root_position] = position
    qpos[..., layout.root_orientation] = orientation
    qpos[..., layout.qpos] = joint_pos
    rest_passive_joints(model, robot.passive_joints, qpos)
    return qpos


def transfer_positions(
    robot: Robot, source: mujoco.MjModel, target: mujoco.MjModel, qpos: Array
) -> Array:
    """Convert MuJoCo positions (..., nq) of the robot in one model to those in another."""
    own = robot.layout(source)
    posture = (qpos[..., at] for at in (own.root_position, own.root_orientation, own.qpos))
    return place_postures(robot, target, *posture)


def read_posture(robot: Robot, model: mujoco.MjModel, qpos: Array) -> Posture:
    """Convert MuJoCo positions (nq,) to a posture; joints are clipped to their limits."""
    layout = robot.layout(model)
    return Posture(
        position=qpos[layout.root_position].copy(),
        orientation=quaternion.normalize(qpos[layout.root_orientation]),
        joint_pos=np.clip(qpos[layout.qpos], robot.lower, robot.upper),
    )


def mirror_positions(robot: Robot, model: mujoco.MjModel, qpos: Array) -> Array:
    """Exchange left and right in MuJoCo positions, (..., nq)."""
    layout = robot.layout(model)
    mirrored = qpos.copy()
    mirrored[..., layout.root_qpos + 1] *= -1.0
    mirrored[..., layout.root_orientation] = quaternion.mirror(qpos[..., layout.root_orientation])
    mirrored[..., layout.qpos] = robot.mirror_joints(qpos[..., layout.qpos])
    couple_passive_joints(model, robot.passive_joints, mirrored)
    return mirrored


def find_carriers(robot: Robot, model: mujoco.MjModel) -> NDArray[np.bool_]:
    """Find which of a robot's joints carry each body of a compiled world, (nbody, n)."""
    moved = [int(model.jnt_bodyid[model.joint(name).id]) for name in robot.joint_names]
    carries = np.arange(model.nbody)[:, np.newaxis] == np.array(moved)
    for body in range(1, model.nbody):  # parents come first
        carries[body] |= carries[model.body_parentid[body]]
    return carries


def center_of_mass(
    robot: Robot, model: mujoco.MjModel, position: Array, orientation: Array, joint_pos: Array
) -> Array:
    """Compute the center of mass of postures (T, ...) in the world [m], (T, 3)."""
    data, torso = mujoco.MjData(model), model.body(robot.torso).id
    out = np.zeros((len(joint_pos), 3))
    for k, qpos in enumerate(place_postures(robot, model, position, orientation, joint_pos)):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        out[k] = data.subtree_com[torso]
    return out


def site_positions(model: mujoco.MjModel, qpos: Array, site: str) -> Array:
    """Compute the position of a site in the world [m], (T, 3), at MuJoCo positions (T, nq)."""
    data, number = mujoco.MjData(model), model.site(site).id
    positions = np.zeros((len(qpos), 3))
    for k, row in enumerate(qpos):
        data.qpos[:] = row
        mujoco.mj_kinematics(model, data)
        positions[k] = data.site_xpos[number]
    return positions


VERTICAL_AXIS = 0.8  # vertical share of a joint axis above which its motion is called a turn
DIRECTIONS = (("backward", "forward"), ("to its right", "to its left"), ("down", "up"))
"""Negative and positive of the robot's x, y and z when it stands."""


@dataclass(frozen=True, kw_only=True)
class JointDirection:
    """Which way a limb moves as the angle of its joint grows, for a standing robot."""

    way: str
    """Way of the far end of the limb, or of a turn about the vertical seen from above."""
    is_turn: bool

    def __str__(self) -> str:
        """Describe the motion of the limb."""
        if self.is_turn:
            return f"seen from above, its limb turns {self.way}"
        return f"the far end of its limb goes {self.way}"


def find_directions(robot: Robot) -> dict[str, JointDirection]:
    """Find the direction of every joint, by its name."""
    spec = robot.spec()
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_kinematics(model, data)
    found = {}
    for name in robot.joint_names:
        number = model.joint(name).id
        limb = [geom.id for geom in spec.joint(name).parent.find_all("geom")]
        levers = data.geom_xpos[limb] - data.xanchor[number]
        lever = max(levers, key=lambda v: math.hypot(*v), default=np.array([0.0, 0.0, -1.0]))
        found[name] = _name_direction(data.xaxis[number], lever)
    return found


def _name_direction(axis: Array, lever: Array) -> JointDirection:
    """Name the motion of a limb's far end, at ``lever`` from its joint, x forward and y left."""
    if abs(axis[2]) > VERTICAL_AXIS:
        way = "counter-clockwise" if axis[2] > 0.0 else "clockwise"
        return JointDirection(way=way, is_turn=True)
    motion = np.cross(axis, lever)
    largest = int(np.abs(motion).argmax())
    return JointDirection(way=DIRECTIONS[largest][int(motion[largest] > 0.0)], is_turn=False)
