"""Settings of a training environment."""

from __future__ import annotations

from dataclasses import dataclass

from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from sim2real.environment.physics.randomization import DomainRandomization
from sim2real.environment.rewards import QUICK, Reward

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
    scene: str | Scene = "flat"
    origin: tuple[float, float] = (0.0, 0.0)
    """Position on flat ground of robots that start along motions [m]."""
    physics_step: float = PHYSICS_STEP
    """[s]"""
    threads: int = 0
    """Threads that step physics; 0 for one per processor."""
    physics: PhysicsEngine = MUJOCO
    """Engine that steps physics, and its device."""
