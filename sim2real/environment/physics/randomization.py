"""Domain randomization of training: distributions of the domain parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots.ground import GROUND_FRICTION
from robots.quaternion import Array
from robots.servo import LIMIT_MODES, PWM

Bounds = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class ObservationNoise:
    """Standard deviations of white noise on what a policy observes."""

    joint_pos: float = 0.0
    """[rad]"""
    joint_vel: float = 0.0
    """[rad/s]"""
    gyro: float = 0.0
    """[rad/s]"""
    gravity: float = 0.0
    """Each component of the gravity direction."""


# The resolution of the encoder is 0.0015 rad, that of its speed 0.024 rad/s.
NOISE = ObservationNoise(joint_pos=0.003, joint_vel=0.08, gyro=0.05, gravity=0.02)
MOST_DELAY = 0.04  # s


@dataclass(frozen=True, kw_only=True)
class DomainRandomization:
    """Distributions of domain parameters, uniform unless noted; drawn for every episode."""

    mass: Bounds = (0.85, 1.15)
    """Factor on the mass of the robot."""
    link_mass: Bounds = (0.95, 1.05)
    """Further factor on the mass of each link."""
    com_shift: float = 0.01
    """Largest shift of the torso's center of mass along each axis, both ways [m]."""
    friction: Bounds = (0.3, 1.2)
    voltage: Bounds = (0.875, 1.05)
    """Fraction of the nominal supply; of the OP3's 12 V, 10.5 to 12.6 V."""
    torque_share: Bounds = (0.42, 1.0)
    """Torque limit as a fraction of stall torque; 0.42 is 1.7 N·m of the OP3's 4.1 N·m."""
    full_torque: float = 0.35
    """Probability that there is no torque limit."""
    by_pwm: float = 0.5
    """Probability that the torque limit acts on the PWM; else as the robot's own does."""
    weak_servo: Bounds = (0.55, 1.0)
    """Factor on the strength of one weak servo."""
    weak_share: float = 0.15
    """Probability of a weak servo."""
    strength: Bounds = (0.92, 1.08)
    """Factor on gain and torque of every servo."""
    armature: Bounds = (0.7, 1.5)
    """Factor on the rotor inertia of all servos."""
    heavy_armature: Bounds = (1.5, 20.0)
    """The same for heavy rotors, log-uniform: published figures of one servo differ 18-fold."""
    heavy_share: float = 0.2
    """Probability of heavy rotors."""
    friction_loss: Bounds = (0.3, 1.6)
    """Factor on the dry friction of all joints."""
    delay: Bounds = (0.0, 0.06)
    """Delay of targets plus that of measurements, split at random, each at most 0.04 s [s]."""
    joint_offset: float = 0.026
    """Largest calibration error, both ways [rad]: 1.5 degrees."""
    backlash: Bounds = (0.0, 0.018)
    """[rad]; the XM430's datasheet states 0.25 degrees, worn gears have more."""
    imu_tilt: float = 0.05
    """Standard deviation about each axis [rad]: mounting, and errors of the filter in motion."""
    gyro_bias: float = 0.03
    """Standard deviation [rad/s]."""
    push_interval: float = 2.5
    """Mean time between pushes [s]."""
    push_speed: float = 0.4
    """Largest change of the torso's velocity by a push, along each axis [m/s]."""
    noise: ObservationNoise = NOISE

    def sample(self, world: World, n: int, rng: np.random.Generator) -> DomainParameters:
        """Draw the domain parameters of ``n`` robots."""
        robot = world.robot

        def within(bounds: Bounds, *shape: int) -> Array:
            return rng.uniform(*bounds, shape)

        own = float(robot.max_torque.max())
        share = np.where(rng.random(n) < self.full_torque, 1.0, within(self.torque_share, n))
        strength = within(self.strength, n, robot.n)
        weak = rng.random(n) < self.weak_share
        which = rng.integers(0, robot.n, n)
        strength[weak, which[weak]] *= within(self.weak_servo, int(weak.sum()))
        heavy = rng.random(n) < self.heavy_share
        armature = np.where(
            heavy, np.exp(within(tuple(np.log(self.heavy_armature)), n)), within(self.armature, n)
        )
        delay, part = within(self.delay, n), rng.random(n)
        body = within(self.mass, n, 1) * within(self.link_mass, n, world.model.nbody)
        return DomainParameters(
            mass=body,
            com_shift=within((-self.com_shift, self.com_shift), n, 3),
            friction=within(self.friction, n),
            voltage=robot.supply_voltage * within(self.voltage, n),
            torque_limit=own * share,
            limit_by=np.where(rng.random(n) < self.by_pwm, PWM, LIMIT_MODES.index(robot.limit_by)),
            strength=strength,
            armature=armature,
            friction_loss=within(self.friction_loss, n),
            action_delay=np.minimum(delay * part, MOST_DELAY),
            sensor_delay=np.minimum(delay * (1.0 - part), MOST_DELAY),
            joint_offset=within((-self.joint_offset, self.joint_offset), n, robot.n),
            backlash=within(self.backlash, n),
            imu_tilt=rng.normal(0.0, self.imu_tilt, (n, 3)),
            gyro_bias=rng.normal(0.0, self.gyro_bias, (n, 3)),
        )


ONE = (1.0, 1.0)
TORQUE = DomainRandomization(
    mass=ONE,
    link_mass=ONE,
    com_shift=0.0,
    friction=(GROUND_FRICTION, GROUND_FRICTION),
    voltage=ONE,
    torque_share=(0.6, 1.0),
    full_torque=0.7,
    by_pwm=0.0,
    weak_share=0.0,
    strength=ONE,
    armature=ONE,
    heavy_share=0.0,
    friction_loss=ONE,
    delay=(0.0, 0.0),
    joint_offset=0.0,
    backlash=(0.0, 0.0),
    imu_tilt=0.0,
    gyro_bias=0.0,
    push_speed=0.0,
    noise=ObservationNoise(),
)
MILD = DomainRandomization(
    mass=(0.93, 1.07),
    com_shift=0.005,
    friction=(0.5, 1.0),
    voltage=(0.94, 1.05),
    full_torque=0.7,
    weak_share=0.05,
    armature=(0.8, 1.25),
    heavy_share=0.1,
    friction_loss=(0.6, 1.3),
    delay=(0.0, 0.04),
    joint_offset=0.013,
    backlash=(0.0, 0.009),
    imu_tilt=0.025,
    gyro_bias=0.015,
    push_speed=0.2,
)
"""About half of each range: for robots without a reserve of torque."""
RANDOMIZATIONS = {"none": None, "torque": TORQUE, "mild": MILD, "all": DomainRandomization()}
"""Domain randomization by name: none; torque limits alone, which policies observe; all
parameters, mildly or fully."""
