"""Gears between servos and joints: angles, speeds, torques and gains on either side."""

from __future__ import annotations

from dataclasses import dataclass

from robots.quaternion import Array


@dataclass(frozen=True, eq=False)
class Transmission:
    """One gear for each joint: ``q_servo = gear * q_joint``, the directions aside.

    Power is the same on both sides, so that a torque grows by what an angle shrinks. A gain is a
    torque per angle or per speed, and an inertia a torque per acceleration: they grow by the
    square. Directions and zeros are in each `robots.servo.Servo`.
    """

    gear: Array
    """Turns of the servo per turn of the joint, above 0, (n,)."""

    def to_servo(self, joint_motion: Array) -> Array:
        """Convert angles [rad] or speeds [rad/s] of joints to those of servos, (..., n)."""
        return joint_motion * self.gear

    def to_joint(self, servo_motion: Array) -> Array:
        """Convert angles [rad] or speeds [rad/s] of servos to those of joints, (..., n)."""
        return servo_motion / self.gear

    def torque_at_joint(self, servo_torque: Array | float) -> Array:
        """Convert torques of servos to those that they make at the joints [N·m], (..., n)."""
        return servo_torque * self.gear

    def gain_at_joint(self, servo_gain: Array) -> Array:
        """Convert stiffness, damping or inertia at servos to those at the joints, (..., n)."""
        return servo_gain * self.gear**2
