"""Makes a training environment from names and numbers."""

from __future__ import annotations

from humanoid_getup.policy.action import choose_actions
from robots import load_robot
from sim2real.environment.get_up_env import EnvOptions, GetUpEnv, make_world
from sim2real.environment.initial_states import make_pool, pool_rng
from sim2real.environment.randomization import RANDOMIZATIONS
from sim2real.environment.rewards import REWARDS


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
) -> GetUpEnv:
    """Build a training environment from names and numbers.

    Args:
        num_envs: Robots side by side.
        robot: Robot by name, or a folder that holds a robot.toml.
        rewards: Rewards by name.
        randomization: How robots differ from their description, by name.
        wide: Whether mirrored joints may also move contrary to each other, and limbs spread.
        falls: Settled falls that episodes begin with; their mirror images double them.
        seed: Seed of the falls; that of the episodes goes to ``reset``.
        threads: Threads that step physics; 0 for all that the machine has.

    Raises:
        ValueError: if there are no such rewards, or no such robot.
    """
    if rewards not in REWARDS:
        raise ValueError(f"unknown rewards '{rewards}': allowed {', '.join(REWARDS)}")
    if randomization not in RANDOMIZATIONS:
        allowed = ", ".join(RANDOMIZATIONS)
        raise ValueError(f"unknown randomization '{randomization}': allowed {allowed}")
    body = load_robot(robot)
    action = choose_actions(body, wide)
    world = make_world(body, "flat", delays=False)
    options = EnvOptions(
        robots=num_envs,
        randomization=RANDOMIZATIONS[randomization],
        rewards=REWARDS[rewards],
        threads=threads,
    )
    return GetUpEnv(body, action, make_pool(world, falls, pool_rng(seed)), options)
