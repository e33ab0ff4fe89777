"""Servos: the figures of a servo type, and one servo on its joint."""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

import numpy as np

from robots.quaternion import Array
from robots.storage.validation import Sign, between, positive, whole

TICKS_PER_TURN = 4096
MAX_TICKS = 1_048_575  # either way, the servos' extended position range (e-manual)
RAD_PER_TICK = 2.0 * math.pi / TICKS_PER_TURN

PWM_FULL_SCALE = 885  # counts at 100 % of the supply (e-manual, PWM limit)
COUNT_ROUNDING = 1e-9  # of a count: what was rounded once stays the same
D_GAIN_DIVISOR = 16  # the same of the D gain, per change of the error in one sample (e-manual)
SAMPLE_TIME = 0.001  # s between two samples of the position loop; not published
MAX_GAIN = 16_383  # of the gains' registers (e-manual)
VOLTAGE_ROUNDING = 1e-6  # V: a supply that was averaged or multiplied is still in its range

# Bounds that a wrong unit breaks, such as N·mm, mA, rev/min or g·cm²; every servo is far within.
MAX_VOLTAGE = 60.0  # V
Volts = Annotated[float, positive(MAX_VOLTAGE, "V")]

PGain = Annotated[int, whole(1, MAX_GAIN)]

Protocol = Literal["dynamixel", "dynamixel 1.0", "feetech"]

LimitMode = Literal["current", "pwm", "ideal"]
"""What a torque limit acts on; see :class:`robots.torque_limit.TorqueLimit`."""
LIMIT_MODES: tuple[LimitMode, ...] = get_args(LimitMode)
CURRENT, PWM, IDEAL = range(len(LIMIT_MODES))
"""Places of the modes in that order, for arrays of modes."""


@dataclass(frozen=True, kw_only=True)
class ServoModel:
    """A servo type's figures at its nominal voltage."""

    name: str
    nominal_voltage: Volts
    """Supply at which the figures hold [V]."""
    stall_torque: Annotated[float, positive(200.0, "N·m")]
    """[N·m]"""
    stall_current: Annotated[float, positive(50.0, "A")]
    """[A]"""
    no_load_speed: Annotated[float, positive(100.0, "rad/s")]
    """[rad/s]"""
    armature: Annotated[float, positive(1.0, "kg·m²")]
    """Rotor inertia seen at the horn [kg·m²]."""
    friction: Annotated[float, between(0.0, 50.0, "N·m")]
    """Dry friction at the horn without load [N·m]."""
    viscous_friction: Annotated[float, between(0.0, 50.0, "N·m·s/rad")] = 0.0
    """Friction per speed at the horn [N·m·s/rad]."""
    load_friction: Annotated[float, between(0.0, 1.0)] = 0.0
    """Dry friction of the gears per torque of the motor."""
    load_friction_slope: Annotated[float, between(0.0, 100.0, "1/(N·m)")] = 0.0
    """Growth of that share per torque of the motor [1/(N·m)]."""
    stiction: Annotated[float, between(0.0, 1.0)] = 0.0
    """Further friction per torque of the motor at standstill."""
    stiction_speed: Annotated[float, positive(100.0, "rad/s")] = 0.1
    """Speed at which the stiction is down to 37 % [rad/s]."""
    current_step: Annotated[float, between(0.0, 0.1, "A")]
    """Current of a count, measured and limited [A]; 0 for a servo without current sensor."""
    min_voltage: Volts
    """[V]"""
    max_voltage: Volts
    """[V]"""
    mass: Annotated[float, positive(5.0, "kg")]
    """[kg]"""
    temperature_limit: Annotated[float, between(40.0, 150.0, "°C")]
    """Temperature above which it switches itself off, as shipped [°C]."""
    p_gain: PGain = 800
    """Position P gain as shipped."""
    gain_divisor: Annotated[float, positive(65_536.0)] = 128.0
    """Register value of the P gain per PWM count and 1/4096 turn of error."""
    damping: Annotated[float, positive(1000.0, "N·m·s/rad")] | None = None
    """Of current-based position mode [N·m·s/rad]; that of back-EMF in the other if left out."""
    trips: bool = True
    """Whether its overload protection may switch it off after a while at all its torque."""
    protocol: Protocol = "dynamixel"
    """What it speaks on its bus: Dynamixel Protocol 2.0 or 1.0, or Feetech's."""
    ticks_per_turn: Annotated[float, positive(65_536.0)] = TICKS_PER_TURN
    """Counts of its position in a whole turn, measured or not."""
    last_tick: Annotated[int, whole(1, 65_535)] = TICKS_PER_TURN - 1
    """Highest position that it measures and takes as a goal; the lowest is 0."""

    @property
    def rad_per_tick(self) -> float:
        """Return the angle of a count of its position [rad]."""
        return 2.0 * math.pi / self.ticks_per_turn

    @property
    def max_id(self) -> int:
        """Return the highest id that it may have."""
        return 252 if self.protocol == "dynamixel" else 253

    @property
    def middle_tick(self) -> int:
        """Return the middle of its positions."""
        return (self.last_tick + 1) // 2

    @property
    def ends(self) -> tuple[float, float]:
        """Return the ends of its positions about their middle [rad]."""
        middle, step = self.middle_tick, self.rad_per_tick
        return -middle * step, (self.last_tick - middle) * step

    @property
    def motor_constant(self) -> float:
        """Return volts per rad/s, which is also N·m per ampere of the ideal motor."""
        return self.nominal_voltage / self.no_load_speed

    @property
    def resistance(self) -> float:
        """Return the winding resistance of the ideal motor [ohm]."""
        return self.motor_constant * self.nominal_voltage / self.stall_torque

    @property
    def top_speed(self) -> float:
        """Return the speed of the horn without load at nominal voltage [rad/s].

        That of the ideal motor, unless the friction of its gears is known.
        """
        if not (self.loads_gears or self.viscous_friction):
            return self.no_load_speed
        low, high = 0.0, self.no_load_speed
        for _ in range(40):
            speed = 0.5 * (low + high)
            motor = self.stall_torque - self.torque_speed_slope * speed
            lost = motor * (self.load_friction + self.load_friction_slope * motor)
            is_driven = motor - lost > self.friction + self.viscous_friction * speed
            low, high = (speed, high) if is_driven else (low, speed)
        return low

    @property
    def torque_speed_slope(self) -> float:
        """Return the torque lost per speed to back-EMF [N·m·s/rad]."""
        return self.stall_torque / self.no_load_speed

    @property
    def torque_per_ampere(self) -> float:
        """Return the torque per motor current at the stall point, friction included [N·m/A]."""
        return self.stall_torque / self.stall_current

    @property
    def loads_gears(self) -> bool:
        """Return whether the friction of its gears grows with the torque of its motor."""
        return max(self.load_friction, self.load_friction_slope, self.stiction) > 0.0

    @property
    def has_current_mode(self) -> bool:
        """Return whether it can limit its current, in current-based position mode."""
        return self.current_step > 0.0

    @property
    def d_gain(self) -> int:
        """Return the D gain that damps current-based position mode as back-EMF damps the other.

        The current loop makes up for back-EMF, so that without a D gain only friction is left. A
        type may state another damping.
        """
        damping = self.torque_speed_slope if self.damping is None else self.damping
        return round(damping / self.damping_gain(1))

    def damping_gain(self, d_gain: int) -> float:
        """Compute the damping of a D gain in current-based position mode [N·m·s/rad].

        The scale of the gains is taken to be that of position mode, where a count of PWM gives
        about the torque that a count of current gives: the manual does not state it.
        """
        stiffness = self.position_gain(self.gain_divisor)  # of a P gain of one
        return stiffness * d_gain / D_GAIN_DIVISOR * SAMPLE_TIME

    def position_gain(self, p_gain: float) -> float:
        """Compute the stiffness of position mode at nominal voltage [N·m/rad].

        The servo drives ``p_gain / gain_divisor`` PWM counts per tick of error, and full
        PWM gives the stall torque at standstill.
        """
        counts_per_rad = p_gain / self.gain_divisor / RAD_PER_TICK
        return counts_per_rad / PWM_FULL_SCALE * self.stall_torque

    def accepts_supply(self, voltage: float) -> bool:
        """Return whether a supply [V] is within its range."""
        slack = VOLTAGE_ROUNDING
        return self.min_voltage - slack <= voltage <= self.max_voltage + slack


@dataclass(frozen=True, kw_only=True)
class Servo:
    """One servo on the bus and how its ticks map to its joint's angle."""

    id: int
    model: ServoModel
    sign: Sign
    """+1 when more ticks turn the joint in its positive direction, else -1."""
    zero_ticks: int
    """Ticks at joint angle 0."""
    own_p_gain: int | None = None
    """Position P gain on this joint; None for the one that its type is shipped with."""

    gear: float = 1.0
    """Turns of the servo per turn of the joint, above 0."""

    keeps_limits: bool = False
    """Whether the position limits in its EEPROM stay as they are: those of its joint's range."""

    @property
    def rad_per_tick(self) -> float:
        """Return the angle by which a tick turns the joint [rad]."""
        return self.model.rad_per_tick / self.gear

    @property
    def p_gain(self) -> int:
        """Return the position P gain at full gain scale."""
        return self.model.p_gain if self.own_p_gain is None else self.own_p_gain

    @property
    def position_gain(self) -> float:
        """Return the stiffness of position mode at the horn, at nominal voltage [N·m/rad]."""
        return self.model.position_gain(self.p_gain)

    def __post_init__(self) -> None:
        if self.sign not in (-1, 1):
            raise ValueError(f"servo {self.id}: sign is {self.sign}, expected -1 or 1")
        if not 0.0 < self.gear < math.inf:
            raise ValueError(f"servo {self.id}: gear is {self.gear:g}, expected above 0")
        if not 0 <= self.id <= self.model.max_id:
            raise ValueError(f"servo id is {self.id}, expected 0 to {self.model.max_id}")

    def to_rad(self, ticks: int) -> float:
        """Convert encoder ticks to the joint angle [rad]."""
        return self.sign * (ticks - self.zero_ticks) * self.rad_per_tick

    def to_ticks(self, angle: float) -> int:
        """Convert a joint angle [rad] to the nearest encoder tick."""
        return round(self.sign * angle / self.rad_per_tick) + self.zero_ticks


def count_pwm(share: Array | float, full_scale: Array | float = PWM_FULL_SCALE) -> Array:
    """Convert shares of the supply to whole counts of the PWM, from none to all of them, (...)."""
    counts = np.floor(full_scale * share + COUNT_ROUNDING)
    return np.minimum(np.maximum(counts, 0.0), full_scale)


def round_pwm(share: Array | float) -> Array:
    """Round shares of the supply down to whole counts of the PWM, (...)."""
    return count_pwm(share) / PWM_FULL_SCALE
