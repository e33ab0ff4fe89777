"""Gears and couplings between servos and joints: angles, speeds, torques and gains on each side."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robots.quaternion import Array


@dataclass(frozen=True, eq=False)
class Coupling:
    """Two joints that two servos turn together: a differential, or the rods of an ankle.

    Turns of the servos are ``matrix @`` angles of the joints. Power is the same on both sides, so
    that torques at the joints are ``matrix.T @`` torques of the servos.
    """

    joints: tuple[int, int]
    """Places of the joints, whose servos these are, in the robot's order."""
    matrix: Array
    """Turns of each servo (rows) per turn of each joint (columns), invertible, (2, 2)."""

    @property
    def columns(self) -> list[int]:
        """Return the places of the joints as an index of arrays."""
        return list(self.joints)

    @cached_property
    def inverse(self) -> Array:
        """Return the turns of each joint (rows) per turn of each servo (columns), (2, 2)."""
        return np.asarray(np.linalg.inv(self.matrix), dtype=float)


@dataclass(frozen=True, eq=False)
class Transmission:
    """What lies between servos and joints.

    An actuator is a servo with its gear, ``q_servo = gear * q_actuator``, the directions aside.
    It turns its own joint, ``q_actuator = q_joint``, or with a second one the two joints of a
    coupling. Power is the same on all sides, so that a torque grows by what an angle shrinks. A
    gain is a torque per angle or per speed, and an inertia a torque per acceleration: they grow by
    the square. Directions and zeros are in each `robots.servo.Servo`.
    """

    gear: Array
    """Turns of the servo per turn of the actuator, above 0, (n,)."""
    couplings: tuple[Coupling, ...] = ()

    # Servos and actuators ---------------------------------------------------------------------

    def motion_at_actuator(self, servo_motion: Array) -> Array:
        """Convert angles [rad] or speeds [rad/s] of servos to those of actuators, (..., n)."""
        return servo_motion / self.gear

    def torque_at_actuator(self, servo_torque: Array | float) -> Array:
        """Convert torques of servos to those behind their gears [N·m], (..., n)."""
        return servo_torque * self.gear

    def gain_at_actuator(self, servo_gain: Array) -> Array:
        """Convert stiffness, damping or inertia at servos to those behind the gears, (..., n)."""
        return servo_gain * self.gear**2

    # Actuators and joints ---------------------------------------------------------------------

    def to_actuator(self, joint_motion: Array) -> Array:
        """Convert angles [rad] or speeds [rad/s] of joints to those of actuators, (..., n)."""
        return self._couple(joint_motion, [c.matrix for c in self.couplings])

    def to_joint(self, actuator_motion: Array) -> Array:
        """Convert angles [rad] or speeds [rad/s] of actuators to those of joints, (..., n)."""
        return self._couple(actuator_motion, [c.inverse for c in self.couplings])

    def torque_for_joint(self, joint_torque: Array) -> Array:
        """Convert torques at joints to those that actuators must make for them [N·m], (..., n)."""
        return self._couple(joint_torque, [c.inverse.T for c in self.couplings])

    def torque_at_joint(self, actuator_torque: Array) -> Array:
        """Convert torques of actuators to those that they make at joints [N·m], (..., n)."""
        return self._couple(actuator_torque, [c.matrix.T for c in self.couplings])

    def to_servo(self, joint_motion: Array) -> Array:
        """Convert angles [rad] or speeds [rad/s] of joints to those of servos, (..., n)."""
        return self.to_actuator(joint_motion) * self.gear

    # Ranges -----------------------------------------------------------------------------------

    def range_at_actuator(self, lower: Array, upper: Array) -> tuple[Array, Array]:
        """Compute the ranges of actuators that cover all ranges of joints [rad], (n,) each."""
        middle = self.to_actuator((lower + upper) / 2.0)
        reach = self._couple((upper - lower) / 2.0, [np.abs(c.matrix) for c in self.couplings])
        is_coupled = self.is_coupled
        return (
            np.where(is_coupled, middle - reach, lower),
            np.where(is_coupled, middle + reach, upper),
        )

    def speed_at_joint(self, actuator_speed: Array) -> Array:
        """Compute speeds that all joints can have at once within their actuators' [rad/s], (n,).

        Each of two coupled joints gets half of what the slower actuator can do for it alone:
        whatever the other one does, none is too fast.
        """
        out = np.array(actuator_speed, dtype=float)
        for c in self.couplings:
            needed = 2.0 * np.abs(c.matrix) / actuator_speed[c.columns][:, None]  # s/rad
            out[c.columns] = 1.0 / needed.max(axis=0)
        return out

    def error_at_joint(self, actuator_error: Array) -> Array:
        """Compute the largest errors of joints from errors of actuators [rad], (n,)."""
        return self._couple(actuator_error, [np.abs(c.inverse) for c in self.couplings])

    @property
    def is_coupled(self) -> np.ndarray:
        """Return whether each joint is one of a coupling, (n,)."""
        flags = np.zeros(len(self.gear), dtype=bool)
        for c in self.couplings:
            flags[c.columns] = True
        return flags

    def _couple(self, values: Array, matrices: list[Array]) -> Array:
        """Multiply the values of each coupling's pair, (..., n); the others stay as they are."""
        if not self.couplings:
            return values
        out = np.array(values, dtype=float)
        for c, matrix in zip(self.couplings, matrices, strict=True):
            # Term by term: the bits of a matrix product depend on how many rows it has.
            first, second = (values[..., k] for k in c.joints)
            for k, (a, b) in zip(c.joints, matrix, strict=True):
                out[..., k] = a * first + b * second
        return out
