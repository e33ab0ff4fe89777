"""What differs between simulated robots besides where they lie."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.simulation.scene import Scene
from robots import Robot
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Conditions:
    """Body, servos, sensors and ground of each of N robots."""

    mass: Array
    """Share of each link's mass and inertia that it has, (N, bodies)."""
    com_shift: Array
    """Shift of the torso's center of mass [m], (N, 3)."""
    friction: Array
    """Sliding friction of every contact, (N,)."""
    voltage: Array
    """Supply [V], (N,)."""
    torque_limit: Array
    """Cap on every servo [N·m], (N,)."""
    pwm_limited: NDArray[np.bool_]
    """Whether the cap is a PWM limit, as servos in position mode have it, (N,)."""
    strength: Array
    """Share of its torque and gain that each servo has, (N, n)."""
    armature: Array
    """Share of the rotors' inertia, (N,)."""
    friction_loss: Array
    """Share of the servos' dry friction, (N,)."""
    action_delay: Array
    """Age of targets when the servos get them [s], (N,)."""
    sensor_delay: Array
    """Age of measurements when they are used [s], (N,)."""
    joint_offset: Array
    """What encoders tell too much [rad], (N, n)."""
    backlash: Array
    """Free play of each gear, from end to end [rad], (N,)."""
    imu_tilt: Array
    """How the IMU is turned against where it should be [rad], a small rotation, (N, 3)."""
    gyro_bias: Array
    """[rad/s], (N, 3)"""

    @property
    def n(self) -> int:
        """Return the number of robots."""
        return len(self.friction)

    @staticmethod
    def nominal(
        robot: Robot,
        bodies: int,
        n: int,
        *,
        friction: float = Scene.friction,
        torque_limit: float | None = None,
    ) -> Conditions:
        """Make the conditions of ``n`` robots that are as their description says.

        Args:
            robot: Robot.
            bodies: Number of bodies in its compiled world.
            n: How many.
            friction: Sliding friction of every contact.
            torque_limit: Cap on every servo [N·m]; ``None`` for all that they have.
        """
        limit = float(robot.max_torque.max()) if torque_limit is None else torque_limit
        return Conditions(
            mass=np.ones((n, bodies)),
            com_shift=np.zeros((n, 3)),
            friction=np.full(n, friction),
            voltage=np.full(n, robot.supply_voltage),
            torque_limit=np.full(n, limit),
            pwm_limited=np.zeros(n, dtype=bool),
            strength=np.ones((n, robot.n)),
            armature=np.ones(n),
            friction_loss=np.ones(n),
            action_delay=np.zeros(n),
            sensor_delay=np.zeros(n),
            joint_offset=np.zeros((n, robot.n)),
            backlash=np.zeros(n),
            imu_tilt=np.zeros((n, 3)),
            gyro_bias=np.zeros((n, 3)),
        )

    def put(self, ids: NDArray[np.int_], others: Conditions) -> None:
        """Overwrite the conditions of some robots, in place."""
        for field in fields(self):
            getattr(self, field.name)[ids] = getattr(others, field.name)


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations of the sensors' white noise."""

    joint_pos: float = 0.0
    """[rad]"""
    joint_vel: float = 0.0
    """[rad/s]"""
    gyro: float = 0.0
    """[rad/s]"""
    gravity: float = 0.0
    """Of each component of the direction of gravity."""
