"""Settings of a training environment, and the domain randomization of its robots."""

from __future__ import annotations

from dataclasses import dataclass, replace

from humanoid_getup.experiments.disturbances import (
    Disturbance,
    LogUniform,
    Mixture,
    Normal,
    Uniform,
)
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from robots.ground import GROUND_FRICTION
from sim2real.environment.rewards import QUICK, Reward


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


def _symmetric(largest: float) -> Uniform:
    """Return a distribution of errors between minus and plus a bound."""
    return Uniform(-largest, largest)


ALL = Disturbance(
    mass=Uniform(0.85, 1.15),
    link_mass=Uniform(0.95, 1.05),
    com_shift=_symmetric(0.01),
    friction=Uniform(0.3, 1.2),
    supply=Uniform(0.875, 1.05),  # of the OP3's 12 V, 10.5 to 12.6 V
    torque_share=Mixture(0.35, 1.0, Uniform(0.42, 1.0)),  # 1.7 N·m of the OP3's 4.1 N·m
    by_pwm=0.5,
    weak_servo=Uniform(0.55, 1.0),
    weak_share=0.15,
    strength=Uniform(0.92, 1.08),
    # Published rotor inertias of one servo differ 18-fold.
    armature=Mixture(0.2, LogUniform(1.5, 20.0), Uniform(0.7, 1.5)),
    friction_loss=Uniform(0.3, 1.6),
    split_delay=Uniform(0.0, 0.06),
    joint_offset=_symmetric(0.026),  # 1.5 degrees
    backlash=Uniform(0.0, 0.018),  # the XM430's data sheet says 0.25 degrees, worn gears have more
    imu_tilt=Normal(0.05),  # mounting, and errors of the filter in motion
    gyro_bias=Normal(0.03),
)
MILD = replace(
    ALL,
    mass=Uniform(0.93, 1.07),
    com_shift=_symmetric(0.005),
    friction=Uniform(0.5, 1.0),
    supply=Uniform(0.94, 1.05),
    torque_share=Mixture(0.7, 1.0, Uniform(0.42, 1.0)),
    weak_share=0.05,
    armature=Mixture(0.1, LogUniform(1.5, 20.0), Uniform(0.8, 1.25)),
    friction_loss=Uniform(0.6, 1.3),
    split_delay=Uniform(0.0, 0.04),
    joint_offset=_symmetric(0.013),
    backlash=Uniform(0.0, 0.009),
    imu_tilt=Normal(0.025),
    gyro_bias=Normal(0.015),
)
"""About half of each range: for robots without a reserve of torque."""
TORQUE = Disturbance(friction=GROUND_FRICTION, torque_share=Mixture(0.7, 1.0, Uniform(0.6, 1.0)))


@dataclass(frozen=True, kw_only=True)
class DomainRandomization:
    """Differences between the robots of training, drawn for every episode and during it."""

    disturbance: Disturbance
    push_interval: float = 2.5
    """Mean time between pushes [s]."""
    push_speed: float = 0.4
    """Largest change of the torso's velocity by a push, along each axis [m/s]."""
    noise: ObservationNoise = NOISE


RANDOMIZATIONS = {
    "none": None,
    "torque": DomainRandomization(disturbance=TORQUE, push_speed=0.0, noise=ObservationNoise()),
    "mild": DomainRandomization(disturbance=MILD, push_speed=0.2),
    "all": DomainRandomization(disturbance=ALL),
}
"""Domain randomization by name: none; torque limits alone, which policies observe; all
parameters, mildly or fully."""


PHYSICS_STEP = 0.006  # s; evaluation takes 0.002


@dataclass(frozen=True, kw_only=True)
class EnvOptions:
    """Settings of a training environment."""

    robots: int = 512
    """Number of robots that are simulated at once."""
    randomization: DomainRandomization | None = None
    """``None``: every robot has its nominal parameters."""
    rewards: tuple[Reward, ...] = QUICK
    falls: float = 0.8
    """Fraction of episodes that start with a settled fall."""
    motions: float = 0.1
    """Fraction that starts at a frame of a stored motion; the rest starts standing."""
    assistive_force: float = 0.0
    """Initial upper limit of the assistive force, as a fraction of the weight; fades with
    success."""
    restarts: float = 0.0
    """Fraction of episodes after a deviation from style curves that start where the last ended."""
    ends_early: float = 0.5
    """Fraction of episodes that end once the robot has stood for ``episodes.HELD``."""
    scene: Scene = FLAT_SCENE
    origin: tuple[float, float] = (0.0, 0.0)
    """Position on flat ground of robots that start along motions [m]."""
    physics_step: float = PHYSICS_STEP
    """[s]"""
    threads: int = 0
    """Threads that step physics; 0 for one per processor."""
    physics: PhysicsEngine = MUJOCO
    """Engine that steps physics, and its device."""
