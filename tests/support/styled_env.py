"""A training environment with style curves: named styles, and two rises whose targets are known."""

import numpy as np

from humanoid_getup.policy.action import build_posture_spec
from humanoid_getup.style.style import load_any_style
from robots import Robot
from sim2real.environment.action_heads import PriorHead
from sim2real.environment.env_options import EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.rewards import REWARDS
from sim2real.environment.starts import StartPool
from sim2real.environment.style_task import CurveLibrary, StyleTask

SAMPLES = 5


def make_library(robot: Robot, states: np.ndarray) -> CurveLibrary:
    """Make a library of the named styles and, of the first two, known rises."""
    curves = list(load_any_style(robot).curves)
    target = np.full((len(curves), SAMPLES, robot.n), np.nan)
    target[:2] = robot.standing.joint_pos
    sources = ["planned: one", "policy: two", *[""] * (len(curves) - 2)]
    row, share = np.zeros(len(states), dtype=int), np.linspace(0.0, 1.0, len(states))
    return CurveLibrary.of(curves, target, sources, 0.5, (states, row, share))


def make_styled_env(robot: Robot, pool: StartPool, head: PriorHead, robots: int = 12) -> GetUpEnv:
    """Make an environment whose robots are reset."""
    options = EnvOptions(
        robots=robots,
        rewards=REWARDS["styled"],
        falls=0.5,
        motions=0.25,
        ends_early=0.0,
        threads=1,
    )
    task = StyleTask(robot, robots, make_library(robot, pool.qpos[:4]), head, threads=1)
    made = GetUpEnv(robot, build_posture_spec(robot), pool, options, task)
    made.reset(seed=0)
    return made
