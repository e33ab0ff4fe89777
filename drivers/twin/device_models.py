"""The twin's servos and its IMU: currents, temperatures, and the resolution of all sensors."""

from __future__ import annotations

import mujoco
import numpy as np

from drivers.imu.fusion import ACCELEROMETER_STEP, GYRO_STEP, MOST_COUNTS
from robots import Robot
from robots.quaternion import Array

VELOCITY_STEP = 0.229 * 2.0 * np.pi / 60.0  # rad/s a count, X series (e-manual)
CURRENT_STEP = 2.69e-3  # A a count, X430 and X540 (e-manual)
VOLTAGE_STEP = 0.1  # V a count (e-manual)

AMBIENT_TEMPERATURE = 25.0  # °C
# Estimates, not published figures: mostly aluminium, gears and copper, cooled by still air at
# 10 W/(m²·K) over the case, which is 78 cm² for the 82 g of an XM430. Cases of another size have
# the same shape and density, so that their surface grows with mass to the power of 2/3.
SPECIFIC_HEAT = 500.0  # J/(kg·K)
REFERENCE_MASS, REFERENCE_RESISTANCE = 0.082, 13.0  # kg, K/W


class Windings:
    """Current and heat of the servos' motors."""

    def __init__(self, robot: Robot) -> None:
        models = [joint.servo.model for joint in robot.joints]
        self._torque_per_ampere = robot.torque_per_ampere
        self._motor_constant = robot.motor_constant
        self._volts_per_torque = np.array([m.resistance for m in models]) / self._motor_constant
        self._resistance = np.array([m.nominal_voltage / m.stall_current for m in models])
        mass = np.array([m.mass for m in models])
        self.heat_capacity = SPECIFIC_HEAT * mass
        """[J/K], (n,)"""
        self.heat_resistance = REFERENCE_RESISTANCE * (REFERENCE_MASS / mass) ** (2.0 / 3.0)
        """To the air [K/W], (n,)."""
        self.cool()

    def cool(self) -> None:
        """Bring every servo to the ambient temperature."""
        self.temperature = np.full(len(self._resistance), AMBIENT_TEMPERATURE)

    def compute_current(self, torque: Array) -> Array:
        """Compute the motor currents [A] that make torques [N·m], shape (n,)."""
        return torque / self._torque_per_ampere

    def compute_voltage(self, torque: Array, velocity: Array) -> Array:
        """Compute the voltages [V] at which ideal motors make torques [N·m] at speeds, (n,)."""
        return torque * self._volts_per_torque + self._motor_constant * velocity

    def compute_warming(self, current: Array) -> Array:
        """Compute the final temperatures of servos over the air's at currents [A], (n,) [K]."""
        return current**2 * self._resistance * self.heat_resistance

    def heat(self, current: Array, duration: float) -> None:
        """Warm the servos by their copper losses and cool them by the air."""
        loss = current**2 * self._resistance
        cooling = (self.temperature - AMBIENT_TEMPERATURE) / self.heat_resistance
        self.temperature += (loss - cooling) * (duration / self.heat_capacity)


def quantize(value: Array, step: Array | float) -> Array:
    """Round to whole steps of a sensor's resolution."""
    return np.rint(value / step) * step


class TwinImu:
    """Measures angular velocity and specific force at a site of a simulation.

    Both sensors give their mean over a period, as their low-pass filters do. The gyro's
    is exact: sampled at 125 Hz without a filter, impacts would cost two degrees of tilt.
    """

    def __init__(self, model: mujoco.MjModel, site: str) -> None:
        self._model, self._site = model, model.site(site).id
        self._pose = np.zeros(4)  # true orientation at the last sample
        self._velocity = np.zeros(6)  # true velocity there: angular, linear, in the world
        self.gyro = np.zeros(3)
        """Angular velocity in the sensor frame [rad/s], shape (3,)."""
        self.accelerometer = np.zeros(3)
        """Specific force in the sensor frame [m/s²], shape (3,)."""

    def start(self, data: mujoco.MjData) -> None:
        """Start at the simulation's present pose, at rest."""
        self._sample_pose(data)
        self.gyro = np.zeros(3)
        self.accelerometer = self._sense_force(data, np.zeros(3))

    def advance(self, data: mujoco.MjData, period: float) -> None:
        """Take one sample, ``period`` seconds after the last."""
        pose, velocity = self._pose.copy(), self._velocity[3:].copy()
        self._sample_pose(data)
        turn_b = np.zeros(3)
        mujoco.mju_subQuat(turn_b, self._pose, pose)
        self.gyro = _measure(turn_b / period, GYRO_STEP)
        self.accelerometer = self._sense_force(data, (self._velocity[3:] - velocity) / period)

    def _sample_pose(self, data: mujoco.MjData) -> None:
        site = mujoco.mjtObj.mjOBJ_SITE
        mujoco.mj_objectVelocity(self._model, data, site, self._site, self._velocity, 0)
        mujoco.mju_mat2Quat(self._pose, data.site_xmat[self._site])

    def _sense_force(self, data: mujoco.MjData, acceleration: Array) -> Array:
        R = data.site_xmat[self._site].reshape(3, 3)
        force_b = (acceleration - self._model.opt.gravity) @ R
        return _measure(force_b, ACCELEROMETER_STEP)


def _measure(value: Array, step: float) -> Array:
    """Round to whole steps, as many as a register holds."""
    most = MOST_COUNTS * step
    return quantize(np.minimum(np.maximum(value, -most), most), step)
