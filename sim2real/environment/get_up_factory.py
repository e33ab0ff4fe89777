"""Makes a training environment from names and numbers, for Gymnasium."""

from __future__ import annotations

from typing import get_args

from humanoid_getup.policy.action import choose_actions
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.physics_engine import PhysicsEngine, PhysicsName
from robots import load_robot
from sim2real.environment.env_options import PHYSICS_STEP, RANDOMIZATIONS, EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.rewards import REWARDS
from sim2real.environment.starts import make_pool, pool_rng
from sim2real.environment.training_world import build_training_world


def make_get_up(
    num_envs: int = 512,
    *,
    robot: str = "op3",
    rewards: str = "robust",
    randomization: str = "all",
    wide: bool = True,
    falls: int = 128,
    seed: int = 0,
    threads: int = 0,
    physics: PhysicsName = "mujoco",
) -> GetUpEnv:
    """Build a training environment of some robots.

    Args:
        num_envs: Number of robots.
        robot: Name of a robot, or a folder with a robot.toml.
        rewards: Name of the rewards.
        randomization: Name of the domain randomization.
        wide: Whether mirrored joints may also move in opposite directions, and limbs spread.
        falls: Number of settled falls in the pool; their mirror images double it.
        seed: Seed of the falls; that of the episodes goes to ``reset``.
        threads: Threads that step physics; 0 for one per processor.
        physics: Engine that steps physics; mujoco-warp takes a GPU if there is one.
    """
    for kind, name, known in (
        ("rewards", rewards, REWARDS),
        ("randomization", randomization, RANDOMIZATIONS),
        ("physics", physics, get_args(PhysicsName)),
    ):
        if name not in known:
            raise ValueError(f"unknown {kind} '{name}', expected {', '.join(known)}")
    loaded = load_robot(robot)
    options = EnvOptions(
        robots=num_envs,
        randomization=RANDOMIZATIONS[randomization],
        rewards=REWARDS[rewards],
        threads=threads,
        physics=PhysicsEngine(physics),
    )
    world = build_training_world(loaded, FLAT_SCENE, PHYSICS_STEP)
    pool = make_pool(world, falls, pool_rng(seed))
    return GetUpEnv(loaded, choose_actions(loaded, wide), pool, options)
