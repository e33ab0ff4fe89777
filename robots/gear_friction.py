"""Friction of gears, which grows with the torque of the motor that they carry."""

from __future__ import annotations

import mujoco
import numpy as np

from robots.quaternion import Array
from robots.robot import Robot

LEAST_FRICTION = 1e-3  # share of the friction, by which that under load is divided


class GearFriction:
    """Dry friction of a robot's gears by the torques of their motors.

    A servo's friction at its horn is ``c0 + |t| (a + b |t| + c exp(-|v| / vs))``, with the torque t
    of its motor and its speed v. MuJoCo has a constant dry friction, which is set to this after
    each step. Joints with other servos keep theirs.
    """

    def __init__(self, robot: Robot, model: mujoco.MjModel) -> None:
        """Find the servos of a robot in its compiled world."""
        self._robot = robot
        servos = [joint.servo for joint in robot.joints]
        own = robot.individual
        loaded = np.array([s.model.loads_gears or own.load_friction > 0.0 for s in servos])
        coupled = np.zeros(robot.n, dtype=bool)
        coupled[[i for coupling in robot.couplings for i in coupling.joints]] = True
        self.in_joints = np.flatnonzero(loaded & ~coupled)
        """Servos whose friction is that of a joint."""
        self.in_tendons = np.flatnonzero(loaded & coupled)
        """Servos whose friction is that of the tendon of coupled joints."""
        self.dofs = robot.layout(model).dof[self.in_joints]
        self.tendons = np.array(
            [model.tendon(robot.joint_names[i]).id for i in self.in_tendons], dtype=int
        )
        self._gear = np.array([servo.gear for servo in servos])
        self.added_share: Array | float = own.load_friction / max(own.friction, LEAST_FRICTION)
        """Further friction of all gears per torque of the motor, that broadcasts with (..., n)."""
        names = ("friction", "load_friction", "load_friction_slope", "stiction", "stiction_speed")
        self._figures = np.array([[getattr(s.model, name) for name in names] for s in servos]).T

    @property
    def is_constant(self) -> bool:
        """Return whether no servo has friction that depends on its load."""
        return not (len(self.dofs) or len(self.tendons))

    def compute(self, torque: Array, joint_vel: Array) -> Array:
        """Compute the friction where each servo acts [N·m], (..., n).

        Torques [N·m] and joint speeds [rad/s] are (..., n), of actuators and of joints.
        """
        friction, share, slope, stiction, fading = self._figures
        share = share + self.added_share
        load = np.abs(torque) / self._gear
        speed = np.abs(self._robot.transmission.to_servo(joint_vel))
        loss = load * (share + slope * load + stiction * np.exp(-speed / fading))
        own = max(self._robot.individual.friction, LEAST_FRICTION)
        return self._gear * own * (friction + loss)
