"""What a servo's registers ask of its motor."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.dynamixel.control_table import OperatingMode

POSITION_MODES = frozenset(
    (
        OperatingMode.POSITION,
        OperatingMode.EXTENDED_POSITION,
        OperatingMode.CURRENT_BASED_POSITION,
    )
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorCommand:
    """What the motor shall do now, in the horn's own direction."""

    torque_on: bool
    mode: OperatingMode
    target_ticks: float
    """Where the position loop aims, turns included, as if the homing offset were 0."""
    p_gain: int
    """Register value of the position loop's gain, as are the next two."""
    i_gain: int
    d_gain: int
    velocity_p_gain: int
    """Register value of the velocity loop's gain, as is the next."""
    velocity_i_gain: int
    pwm_limit: float
    """Largest share of the supply, 0 to 1."""
    current_limit: float
    """[A]; infinite for a model that cannot limit it."""
    goal_current: float
    """For current mode [A]."""
    goal_velocity: float
    """For velocity mode, its ramp applied [rad/s]."""
    goal_pwm: float
    """For PWM mode, share of the supply, -1 to 1."""
