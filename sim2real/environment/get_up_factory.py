"""Makes a training environment from names and numbers, for Gymnasium."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

from humanoid_getup.policy.action import choose_actions
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.physics_engine import PhysicsEngine, PhysicsName
from robots import load_robot
from sim2real.environment.env_options import PHYSICS_STEP, RANDOMIZATIONS, EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.rewards import REWARDS
from sim2real.environment.starts import make_pool, pool_rng
from sim2real.environment.training_world import build_training_world


@dataclass(frozen=True, kw_only=True)
class GetUpChoices:
    """Choices for a training environment, as names and numbers."""

    robot: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""
    rewards: str = "robust"
    """Name of the rewards."""
    randomization: str = "all"
    """Name of the domain randomization."""
    wide: bool = True
    """Whether mirrored joints may also move in opposite directions, and limbs spread."""
    falls: int = 128
    """Number of settled falls in the pool; their mirror images double it."""
    seed: int = 0
    """Seed of the falls; that of the episodes goes to ``reset``."""
    threads: int = 0
    """Threads that step physics; 0 for one per processor."""
    physics: PhysicsName = "mujoco"
    """Engine that steps physics; mujoco-warp takes a GPU if there is one."""

    def __post_init__(self) -> None:
        for kind, name, known in (
            ("rewards", self.rewards, REWARDS),
            ("randomization", self.randomization, RANDOMIZATIONS),
            ("physics", self.physics, get_args(PhysicsName)),
        ):
            if name not in known:
                raise ValueError(f"unknown {kind} '{name}', expected {', '.join(known)}")


def make_get_up(num_envs: int = 512, **choices: Any) -> GetUpEnv:
    """Build a training environment of some robots; ``choices`` are `GetUpChoices`."""
    chosen = GetUpChoices(**choices)
    robot = load_robot(chosen.robot)
    options = EnvOptions(
        robots=num_envs,
        randomization=RANDOMIZATIONS[chosen.randomization],
        rewards=REWARDS[chosen.rewards],
        threads=chosen.threads,
        physics=PhysicsEngine(chosen.physics),
    )
    world = build_training_world(robot, FLAT_SCENE, PHYSICS_STEP)
    pool = make_pool(world, chosen.falls, pool_rng(chosen.seed))
    return GetUpEnv(robot, choose_actions(robot, chosen.wide), pool, options)
