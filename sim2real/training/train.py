"""Training: PPO of rsl-rl on the get-up environment; it can be interrupted at any time."""

from __future__ import annotations

import hashlib
import random
import shutil
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import torch

from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.quaternion import Array
from robots.storage.encoding import to_json
from robots.storage.files import atomic_path, write_atomically
from sim2real.environment.action_heads import PriorHead
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
from sim2real.environment.style_task import StyleTask, build_library, list_named_curves
from sim2real.environment.terrain import Terrain, build_terrain
from sim2real.environment.training_world import build_training_world
from sim2real.pose_prior import PRIOR, RISES, PosePrior, RiseSet
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.config import RECIPE, Recipe, TrainingRecord, check_recipe
from sim2real.training.iteration_log import IterationLog, TrainReport
from sim2real.training.library_threads import numpy_threads, torch_threads
from sim2real.training.policy_parent import check_decoder, check_policy_parent, is_policy_file
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.runner import TrainingRunner, build_config

POOL = "falls.npz"
PROGRESS = "progress.csv"
TERRAIN_SEED = 7_002  # makes the terrain of training differ from every scene's


@dataclass(frozen=True, kw_only=True)
class Training:
    """A training of a policy into a folder."""

    robot: Robot
    recipe: Recipe
    folder: Path
    seed: int = 0
    parent: Path | None = None
    """Folder of a training, or file of a policy, that gives the initial policy."""
    prior: Path | None = None
    """Folder of a pose prior."""
    device: str = "cpu"
    """Device of the networks."""
    threads: int = 0
    """Threads of physics; 0 are one per processor."""

    def run(self, report: Callable[[TrainReport], None] = lambda _: None) -> None:
        """Train, or continue from the checkpoint in the folder, if any.

        One seed gives one policy on one machine, interrupted or not.

        The policy of a parent's folder, extended to this action space, is the initial one, or the
        policy of a parent's file, with this action space. A training with style curves needs a
        pose prior, of which it keeps a copy.
        """
        recipe, folder, seed = self.recipe, self.folder, self.seed
        prior = self._check()
        folder.mkdir(parents=True, exist_ok=True)
        self.write_recipe(prior)
        if prior is not None:
            keep_prior(prior, folder)
        iteration_log = IterationLog(folder / PROGRESS, recipe, report)
        random.seed(seed)
        torch.manual_seed(seed)
        env = RslEnv(self.build_env(), self.device, iteration_log)
        with (folder / "rsl_rl.log").open("a") as log, redirect_stdout(log), numpy_threads(1):
            env.begin(seed, np.random.default_rng(seed))
            config = build_config(recipe, seed, env.env.mirrors if recipe.style else None)
            runner = TrainingRunner(env, config, folder, self.device)
            if (folder / CHECKPOINT).exists():
                runner.resume()
            elif self.parent is not None and is_policy_file(self.parent):
                runner.inherit_policy(self.parent, seed)
            elif self.parent is not None:
                runner.inherit(self.parent)
            elif recipe.style is not None:
                runner.imitate(seed)
            iteration_log.resume(runner.current_learning_iteration)
            left = recipe.iterations - runner.current_learning_iteration
            if left > 0:
                with torch_threads(1):  # but for updates, whose batches are larger
                    runner.learn(left)

    def _check(self) -> Path | None:
        """Check all inputs; return the folder of the pose prior, if the training needs one."""
        physics = self.build_options().physics
        if physics.name != MUJOCO.name:
            physics.make_batch(self.world.model, 1)
        if self.parent is not None and is_policy_file(self.parent):
            check_policy_parent(self.parent, self.robot, self.recipe)
        if self.recipe.backwards:
            list_rises(self.robot)
        if self.recipe.style is None:
            return None
        if self.recipe.style.height_map and self.parent is None:
            raise ValueError(
                f"{self.folder}: a training with a height map continues one without, expected "
                "--parent"
            )
        return self._check_prior(self.parent)

    def _check_prior(self, parent: Path | None) -> Path:
        """Find the folder with the pose prior, and check its content.

        That is the one that is given, or else the parent's, or else the training's own.
        """
        is_folder = parent is not None and not is_policy_file(parent)
        source = self.prior or (parent if is_folder and parent else self.folder)
        missing = [name for name in (PRIOR, RISES) if not (source / name).exists()]
        if missing:
            raise ValueError(
                f"{source} has no {missing[0]}, expected --prior with the folder of `getup prior`"
            )
        for name in (PRIOR, RISES):
            _check_kept(source / name, self.folder / name)
        found = PosePrior.load(source / PRIOR, self.robot)
        RiseSet.load(source / RISES, self.robot)
        if parent is not None and not is_folder:
            check_decoder(parent, found)
        elif parent is not None and (parent / PRIOR).read_bytes() != (source / PRIOR).read_bytes():
            raise ValueError(f"{source / PRIOR} is another prior than that of {parent}")
        return source

    @cached_property
    def terrain(self) -> Terrain | None:
        """Return the terrain on which it trains; ``None`` for flat ground."""
        rng = np.random.default_rng([self.seed, TERRAIN_SEED])
        return build_terrain(self.robot, rng) if self.recipe.terrain else None

    @property
    def world(self) -> World:
        """Build the world in which robots fall."""
        scene = self.terrain.scene if self.terrain else FLAT_SCENE
        return build_training_world(self.robot, scene, PHYSICS_STEP)

    def build_options(self) -> EnvOptions:
        """Build the environment's options; physics on a GPU shares that of the networks."""
        recipe, style, terrain = self.recipe, self.recipe.style, self.terrain
        options = EnvOptions(
            robots=recipe.robots,
            randomization=RANDOMIZATIONS[recipe.randomization],
            rewards=REWARDS[recipe.rewards],
            physics_step=recipe.physics_step,
            assistive_force=recipe.lift,
            threads=self.threads,
            physics=PhysicsEngine(
                recipe.physics, self.device if self.device.startswith("cuda") else ""
            ),
        )
        if terrain is not None:
            x, y = terrain.flat_center
            options = replace(options, scene=terrain.scene, origin=(float(x), float(y)))
        if style is None:
            return options
        shares = {"falls": style.falls, "motions": style.motions, "restarts": style.restarts}
        return replace(options, **shares, ends_early=0.0)

    def build_env(self) -> GetUpEnv:
        """Build the environment with the falls, and the prior, in the folder."""
        robot, style = self.robot, self.recipe.style
        action, pool = self.recipe.choose_actions(robot), self.load_pool()
        task = rises = None
        if style is not None:
            model = build_training_world(robot, FLAT_SCENE, PHYSICS_STEP).model
            found = RiseSet.load(self.folder / RISES, robot)
            library = build_library(robot, model, found, [*list_named_curves(robot)], style.named)
            task = StyleTask(
                robot,
                self.recipe.robots,
                library,
                PriorHead.load(robot, action, self.folder),
                self.threads,
                height_map=style.height_map,
            )
            rises = library.state_qpos
        stands = self._make_stands(self.terrain, rises) if self.terrain else None
        return GetUpEnv(robot, action, pool, self.build_options(), task, stands)

    def _make_stands(self, terrain: Terrain, rises: Array | None) -> StartPool:
        """Make the standing initial states on a terrain; some are states near the end of rises."""
        world = self.world
        states = np.zeros((0, world.model.nq)) if rises is None else rises
        return sample_terrain_stands(world, terrain, states, pool_rng(self.seed))

    def load_pool(self) -> StartPool:
        """Load the settled falls that episodes start from; sample them if there is no file.

        On a terrain there are falls on each patch, the mirror images of none; a training backwards
        has frames of the robot's rises among them.
        """
        world, file, count = self.world, self.folder / POOL, self.recipe.falls
        if not file.exists():
            rng = pool_rng(self.seed)
            if self.terrain is not None:
                pool = make_terrain_pool(world, self.terrain, count, rng)
            else:
                make = make_backward_pool if self.recipe.backwards else make_pool
                pool = make(world, count, rng)
            pool.save(file, self.robot)
        return StartPool.load(file, self.robot, world.model.nq)

    def write_recipe(self, prior: Path | None = None) -> None:
        """Write the recipe file, or check that an existing one is the same."""
        recipe, file = self.recipe, self.folder / RECIPE
        action = recipe.choose_actions(self.robot)
        outputs = PriorHead.load(self.robot, action, prior).names if prior else action.names
        record: dict[str, object] = {
            "robot": self.robot.name,
            "seed": self.seed,
            "actions": outputs,
            "recipe": asdict(recipe),
            "rewards": {r.term.__name__: r.weight for r in REWARDS[recipe.rewards]},
            "parent": None if self.parent is None else _describe_parent(self.robot, self.parent),
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


def keep_prior(prior: Path, folder: Path) -> None:
    """Copy the files of a pose prior into the folder of a training that has none yet."""
    for name in (PRIOR, RISES):
        kept = folder / name
        _check_kept(prior / name, kept)
        if not kept.exists():
            with atomic_path(kept) as partial:
                shutil.copyfile(prior / name, partial)


def _check_kept(file: Path, kept: Path) -> None:
    """Check that a training's copy of a file, if there is one, is the same."""
    if kept.exists() and kept.read_bytes() != file.read_bytes():
        raise ValueError(f"{kept} is another file than {file}")
