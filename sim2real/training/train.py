"""Training: PPO of rsl-rl on the get-up environment, that a kill cannot take back."""

from __future__ import annotations

import hashlib
import json
import os
import random
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from robots import Robot
from sim2real.environment.get_up_env import EnvOptions, GetUpEnv, make_world
from sim2real.environment.initial_states import StartPool, make_pool, pool_rng
from sim2real.environment.randomization import RANDOMIZATIONS
from sim2real.environment.rewards import REWARDS
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.config import RECIPE, OtherTrainingError, Recipe, settle_recipe
from sim2real.training.distributed import DistributedProcess
from sim2real.training.progress import Progress, TrainReport
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.runner import Runner, build_config

POOL = "falls.npz"
PROGRESS = "progress.csv"


def build_options(recipe: Recipe, threads: int) -> EnvOptions:
    """Build the environment's options."""
    return EnvOptions(
        robots=recipe.robots,
        randomization=RANDOMIZATIONS[recipe.randomization],
        rewards=REWARDS[recipe.rewards],
        physics_step=recipe.physics_step,
        lift=recipe.lift,
        threads=threads,
    )


def train(
    robot: Robot,
    recipe: Recipe,
    seed: int,
    folder: Path,
    *,
    device: str = "cpu",
    threads: int = 0,
    parent: Path | None = None,
    report: Callable[[TrainReport], None] = lambda _: None,
) -> None:
    """Train a policy into a folder, going on from a checkpoint that is there.

    One seed gives one policy on one machine, interrupted or not. Started by torchrun, each
    process has robots and a GPU of its own, and the first one writes.

    Args:
        robot: Robot.
        recipe: How it is trained.
        seed: Of all that is left to chance.
        folder: Where checkpoint, progress and TensorBoard's files go.
        device: Device that learns.
        threads: Threads that step physics; 0 for all.
        parent: Folder of a training whose policy this one begins with, widened where it
            moves more; ``None`` to begin from nothing.
        report: Hears of every iteration.

    Raises:
        OSError: if the parent cannot be read.
        WideningError: if it cannot become this policy.
        OtherTrainingError: if the folder holds another training.
        CheckpointError: if its checkpoint is spoiled.
    """
    rank = DistributedProcess.from_environment(os.environ)
    seed, device, common_seed = rank.seed(seed), rank.device(device), seed
    folder.mkdir(parents=True, exist_ok=True)
    if rank.leads:
        write_recipe(robot, recipe, common_seed, folder / RECIPE, parent)
    progress = Progress(folder / PROGRESS, recipe, report, rank)
    pool = load_pool(robot, recipe, common_seed, folder / POOL)
    options = build_options(recipe, threads)
    random.seed(seed)
    torch.manual_seed(seed)
    action = recipe.choose_actions(robot)
    env = RslEnv(GetUpEnv(robot, action, pool, options), device, progress)
    log_file = folder / "rsl_rl.log" if rank.leads else Path(os.devnull)
    with log_file.open("a") as log, redirect_stdout(log):
        env.begin(seed, np.random.default_rng(seed))
        runner = Runner(env, build_config(recipe, seed), folder, device, rank)
        if (folder / CHECKPOINT).exists():
            runner.resume()
        elif parent is not None:
            runner.inherit(parent)
        progress.resume(runner.current_learning_iteration)
        left = recipe.iterations - runner.current_learning_iteration
        if left > 0:
            runner.learn(left)


def write_recipe(
    robot: Robot, recipe: Recipe, seed: int, file: Path, parent: Path | None = None
) -> None:
    """Write down what is trained, for whoever goes on with it or exports it.

    Raises:
        OSError: if the parent cannot be read.
        OtherTrainingError: if something else is written there, or the parent's robot is another.
    """
    record: dict[str, Any] = {
        "robot": robot.name,
        "seed": seed,
        "actions": recipe.choose_actions(robot).names,
        "recipe": asdict(recipe),
        "rewards": {r.term.__name__: r.weight for r in REWARDS[recipe.rewards]},
        "parent": None if parent is None else _describe_parent(robot, parent),
    }
    settle_recipe(file, record)


def _describe_parent(robot: Robot, parent: Path) -> dict[str, Any]:
    """Tell what a training begins with, by its content."""
    try:
        record = json.loads((parent / RECIPE).read_text("utf-8"))
        trained, rewards, seed = record["robot"], record["recipe"]["rewards"], record["seed"]
    except (KeyError, TypeError, ValueError) as error:
        raise OtherTrainingError(
            f"{parent / RECIPE} is not a recipe of a training: {error}"
        ) from error
    if trained != robot.name:
        raise OtherTrainingError(
            f"{parent} is a training of robot '{trained}', expected '{robot.name}'"
        )
    file = parent / CHECKPOINT
    return {
        "recipe": rewards,
        "seed": seed,
        "iterations": int(read_checkpoint(file)["iter"]) + 1,
        "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
    }


def load_pool(robot: Robot, recipe: Recipe, seed: int, file: Path) -> StartPool:
    """Load the settled falls that a training starts from; make them if there are none.

    Raises:
        FallError: if the robot does not come to lie still.
        ValueError: if the file holds no falls of this robot.
    """
    world = make_world(robot, "flat", False)
    if not file.exists():
        make_pool(world, recipe.falls, pool_rng(seed)).save(file, robot)
    return StartPool.load(file, robot, world.model.nq)
