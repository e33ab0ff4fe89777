"""What a servo makes its motor do."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.dynamixel.control_table import OperatingMode


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorCommand:
    """Command to the motor, in the horn's own direction."""

    torque_on: bool
    mode: OperatingMode
    target_ticks: float
    """Target of the position loop, turns included, without homing offset."""
    p_gain: int
    """Register value of the position loop's gain, as is the next."""
    d_gain: int
    velocity_p_gain: int
    """Register value of the velocity loop's gain, as is the next."""
    velocity_i_gain: int
    pwm_limit: float
    """Largest share of the supply, 0 to 1."""
    current_limit: float
    """[A]; infinite for a model without current limit."""
    goal_current: float
    """For current mode [A]."""
    goal_velocity: float
    """For velocity mode, after its ramp [rad/s]."""
    goal_pwm: float
    """For PWM mode, share of the supply, -1 to 1."""
