"""Training: PPO of rsl-rl on the get-up environment; it can be interrupted at any time."""

from __future__ import annotations

import hashlib
import os
import random
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import torch

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from robots import Robot
from robots.quaternion import Array
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically
from sim2real.environment.env_options import PHYSICS_STEP, RANDOMIZATIONS, EnvOptions
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.rewards import REWARDS
from sim2real.environment.starts import (
    StartPool,
    list_rises,
    make_backward_pool,
    make_pool,
    make_terrain_pool,
    pool_rng,
    sample_terrain_stands,
)
from sim2real.environment.terrain import Terrain
from sim2real.environment.training_world import build_training_world
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.config import RECIPE, Recipe, TrainingRecord, check_recipe
from sim2real.training.distributed import DistributedProcess
from sim2real.training.iteration_log import IterationLog, TrainReport
from sim2real.training.library_threads import numpy_threads, torch_threads
from sim2real.training.overlapped_runner import OverlappedRunner
from sim2real.training.policy_parent import check_policy_parent, is_policy_file
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.runner import TrainingRunner, build_config
from sim2real.training.styled_training import (
    build_style_task,
    check_prior,
    keep_prior,
    load_head,
    make_terrain,
)

POOL = "falls.npz"
PROGRESS = "progress.csv"


def build_options(recipe: Recipe, threads: int, device: str = "cpu") -> EnvOptions:
    """Build the environment's options; physics on a GPU shares that of the networks."""
    return EnvOptions(
        robots=recipe.robots,
        randomization=RANDOMIZATIONS[recipe.randomization],
        rewards=REWARDS[recipe.rewards],
        physics_step=recipe.physics_step,
        assistive_force=recipe.lift,
        threads=threads,
        physics=PhysicsEngine(recipe.physics, device if device.startswith("cuda") else ""),
    )


@dataclass(frozen=True, kw_only=True)
class TrainingInputs:
    """Parent, prior and device of a training."""

    parent: Path | None = None
    """Folder of a training, or file of a policy, that gives the initial policy."""
    prior: Path | None = None
    """Folder of a pose prior."""
    device: str = "cpu"
    """Device of the networks."""
    threads: int = 0
    """Threads of physics; 0 are one per processor."""


def train(
    robot: Robot,
    recipe: Recipe,
    seed: int,
    folder: Path,
    inputs: TrainingInputs = TrainingInputs(),
    report: Callable[[TrainReport], None] = lambda _: None,
) -> None:
    """Train a policy into a folder; continue from the checkpoint in it, if any.

    One seed gives one policy on one machine, interrupted or not. Under torchrun, each process has
    its share of the robots, and its own GPU if they train on GPUs; curricula and figures are those
    of all robots, and the first process writes.

    The policy of a parent's folder, extended to this action space, is the initial one, or the
    policy of a parent's file, with this action space. A training with style curves needs a pose
    prior, of which it keeps a copy.
    """
    process = DistributedProcess.from_environment(os.environ)
    check_processes(recipe, process)
    with process.connected(device := process.device(inputs.device)):
        _train(robot, recipe, seed, folder, replace(inputs, device=device), process, report)


def check_processes(recipe: Recipe, process: DistributedProcess) -> None:
    """Check that several processes can train a recipe."""
    process.count_robots(recipe.robots)
    if process.of > 1 and recipe.overlap:
        raise ValueError(
            f"--overlap is given to {process.of} processes, expected one: leave it out"
        )
    if process.of > 1 and recipe.style is not None:
        raise ValueError(
            f"a recipe with style curves is given to {process.of} processes, expected one: what it "
            "imitates at first is learned by one"
        )


def _train(
    robot: Robot,
    recipe: Recipe,
    common_seed: int,
    folder: Path,
    inputs: TrainingInputs,
    process: DistributedProcess,
    report: Callable[[TrainReport], None],
) -> None:
    """Train as one of the processes, which are connected."""
    parent, seed, device = inputs.parent, process.seed(common_seed), inputs.device
    source = check_inputs(robot, recipe, folder, parent, inputs.prior, device)
    folder.mkdir(parents=True, exist_ok=True)
    action = recipe.choose_actions(robot)
    outputs = action.names if source is None else load_head(robot, action, source).names
    process.lead(lambda: write_recipe(robot, recipe, common_seed, folder / RECIPE, parent, outputs))
    if source is not None:
        keep_prior(source, folder)
    iteration_log = IterationLog(folder / PROGRESS, recipe, report, process)
    random.seed(seed)
    torch.manual_seed(seed)
    if process.of > 1:  # the first one samples the falls of all
        process.lead(lambda: prepare_pool(robot, recipe, common_seed, folder))
    own = replace(recipe, robots=process.count_robots(recipe.robots))
    threads = process.threads(inputs.threads)
    env = RslEnv(
        build_env(robot, own, action, common_seed, folder, threads, device),
        device,
        iteration_log,
        process.gather if process.of > 1 else None,
    )
    log_file = folder / "rsl_rl.log" if process.leads else Path(os.devnull)
    with log_file.open("a") as log, redirect_stdout(log), numpy_threads(1):
        env.begin(seed, np.random.default_rng(seed))
        mirrors = env.env.mirrors if recipe.style else None
        config = build_config(recipe, seed, mirrors)
        runner_type = OverlappedRunner if recipe.overlap else TrainingRunner
        runner = runner_type(env, config, folder, device, process)
        if (folder / CHECKPOINT).exists():
            runner.resume()
        elif parent is not None and is_policy_file(parent):
            runner.inherit_policy(parent, seed)
        elif parent is not None:
            runner.inherit(parent)
        elif recipe.style is not None:
            runner.imitate(seed)
        iteration_log.resume(runner.current_learning_iteration)
        left = recipe.iterations - runner.current_learning_iteration
        if left > 0:
            with torch_threads(1):  # but for updates, whose batches are larger
                runner.learn(left)


def check_inputs(
    robot: Robot,
    recipe: Recipe,
    folder: Path,
    parent: Path | None,
    prior: Path | None,
    device: str = "cpu",
) -> Path | None:
    """Check the inputs of a training; return the folder of its pose prior, if it needs one."""
    physics = build_options(recipe, 1, device).physics
    if physics.name != MUJOCO.name:
        scene = make_terrain(robot, 0).scene if recipe.terrain else FLAT_SCENE
        physics.make_batch(build_training_world(robot, scene, PHYSICS_STEP).model, 1)
    if parent is not None and is_policy_file(parent):
        check_policy_parent(parent, robot, recipe)
    if recipe.backwards:
        list_rises(robot)
    if recipe.style is None:
        return None
    if recipe.style.height_map and parent is None:
        raise ValueError(
            f"{folder}: a training with a height map continues one without, expected --parent"
        )
    return check_prior(robot, prior, parent, folder)


def build_env(
    robot: Robot,
    recipe: Recipe,
    action: ActionSpec,
    seed: int,
    folder: Path,
    threads: int,
    device: str = "cpu",
) -> GetUpEnv:
    """Build the environment of a training with the falls, and the prior, in its folder."""
    options, style = build_options(recipe, threads, device), recipe.style
    pool, terrain = prepare_pool(robot, recipe, seed, folder)
    if terrain is not None:
        x, y = terrain.flat_center
        options = replace(options, scene=terrain.scene, origin=(float(x), float(y)))
    if style is None:
        stands = make_stands(robot, seed, terrain) if terrain else None
        return GetUpEnv(robot, action, pool, options, stands=stands)
    shares = {"falls": style.falls, "motions": style.motions, "restarts": style.restarts}
    options = replace(options, **shares, ends_early=0.0)
    model = build_training_world(robot, FLAT_SCENE, PHYSICS_STEP).model
    task = build_style_task(
        robot, model, action, folder, robots=recipe.robots, recipe=style, threads=threads
    )
    rises = task.library.state_qpos
    stands = make_stands(robot, seed, terrain, rises) if terrain else None
    return GetUpEnv(robot, action, pool, options, task, stands)


def prepare_pool(
    robot: Robot, recipe: Recipe, seed: int, folder: Path
) -> tuple[StartPool, Terrain | None]:
    """Load the falls of a training, on its terrain if it has one; sample them if there are none."""
    terrain = make_terrain(robot, seed) if recipe.terrain else None
    return load_pool(robot, recipe, seed, folder / POOL, terrain), terrain


def make_stands(robot: Robot, seed: int, terrain: Terrain, rises: Array | None = None) -> StartPool:
    """Make the standing initial states on a terrain; some are states near the end of rises."""
    world = build_training_world(robot, terrain.scene, PHYSICS_STEP)
    states = np.zeros((0, world.model.nq)) if rises is None else rises
    return sample_terrain_stands(world, terrain, states, pool_rng(seed))


def write_recipe(
    robot: Robot,
    recipe: Recipe,
    seed: int,
    file: Path,
    parent: Path | None = None,
    outputs: tuple[str, ...] | None = None,
) -> None:
    """Write the recipe file, or check that an existing one is the same."""
    record: dict[str, object] = {
        "robot": robot.name,
        "seed": seed,
        "actions": outputs or recipe.choose_actions(robot).names,
        "recipe": asdict(recipe),
        "rewards": {r.term.__name__: r.weight for r in REWARDS[recipe.rewards]},
        "parent": None if parent is None else _describe_parent(robot, parent),
    }
    if file.exists():
        check_recipe(file, record)
    write_atomically(file, to_json(record))


def _describe_parent(robot: Robot, parent: Path) -> dict[str, str | int]:
    """Identify the parent of a training by its content."""
    if is_policy_file(parent):
        return {"policy": parent.stem, "sha256": hashlib.sha256(parent.read_bytes()).hexdigest()}
    record = TrainingRecord.load(parent)
    if record.robot != robot.name:
        raise ValueError(
            f"{parent} is a training of robot '{record.robot}', expected '{robot.name}'"
        )
    file = parent / CHECKPOINT
    return {
        "recipe": record.recipe.rewards,
        "seed": record.seed,
        "iterations": int(read_checkpoint(file)["iter"]) + 1,
        "sha256": hashlib.sha256(file.read_bytes()).hexdigest(),
    }


def load_pool(
    robot: Robot, recipe: Recipe, seed: int, file: Path, terrain: Terrain | None = None
) -> StartPool:
    """Load the settled falls that episodes start from; sample them if there is no file.

    On a terrain there are falls on each patch, the mirror images of none; a training backwards
    has frames of the robot's rises among them.
    """
    scene = terrain.scene if terrain else FLAT_SCENE
    world = build_training_world(robot, scene, PHYSICS_STEP)
    if not file.exists():
        rng = pool_rng(seed)
        if terrain is not None:
            pool = make_terrain_pool(world, terrain, recipe.falls, rng)
        elif recipe.backwards:
            pool = make_backward_pool(world, recipe.falls, rng)
        else:
            pool = make_pool(world, recipe.falls, rng)
        pool.save(file, robot)
    return StartPool.load(file, robot, world.model.nq)
