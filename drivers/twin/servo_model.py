"""Currents and temperatures of the twin's servos, and the resolution of their sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


@dataclass(frozen=True, kw_only=True)
class SensorNoise:
    """Standard deviations of white noise, added before each sensor's resolution."""

    joint_pos: float = 0.0
    """[rad]"""
    joint_vel: float = 0.0
    """[rad/s]"""
    joint_current: float = 0.0
    """[A]"""
    gyro: float = 0.0
    """[rad/s]"""
    accelerometer: float = 0.0
    """[m/s²]"""


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

    def compute_power(self, current: Array, torque: Array, velocity: Array) -> float:
        """Compute the electrical power [W] that all servos draw; braking gives none back."""
        return float(np.maximum(current**2 * self._resistance + torque * velocity, 0.0).sum())

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
