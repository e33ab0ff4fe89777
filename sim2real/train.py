"""Training: PPO of rsl-rl on the get-up environment, that a kill cannot take back."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import random
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rsl_rl.runners import OnPolicyRunner

from humanoid_getup.action import choose_actions
from robots import Robot
from sim2real.checkpoint import read_checkpoint, write_checkpoint
from sim2real.env import EnvOptions, GetUpEnv, make_world
from sim2real.randomisation import RANDOMISATIONS
from sim2real.rank import Rank
from sim2real.recipe_file import OtherTrainingError, settle_recipe
from sim2real.rewards import REWARDS
from sim2real.rsl_env import RslEnv, StepReport, mirror_batch
from sim2real.starts import StartPool, make_pool, pool_rng
from sim2real.widening import widen

STEPS = 20  # policy steps of every robot between two updates
CHECKPOINT = "checkpoint.pt"
POOL = "falls.npz"
PROGRESS = "progress.csv"
RECIPE = "recipe.json"


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a policy is trained."""

    rewards: str
    randomisation: str
    """By name."""
    apart: bool
    """Whether mirrored joints may also move contrary to each other."""
    iterations: int
    robots: int = 512
    hidden: tuple[int, ...] = (256, 128)
    falls: int = 1024
    """Settled falls in the pool; their mirror images double it."""
    discount: float = 0.97
    """At 20.8 Hz a horizon of 1.6 s, most of a way up."""
    desired_kl: float = 0.015
    """The step size shrinks above twice this divergence, and grows below half of it."""
    entropy: float = 0.002
    """A fifth of rsl-rl's own: the least deviation keeps a policy exploring."""
    first_std: float = 1.0
    most_std: float = 1.5
    """Most that an action is tried beside what the policy would do, of numbers from -1 to 1.

    Above 0.4 noise alone asks for full speed, this way and that: a policy that learns under
    it does so, too, and shakes while it stands.
    """
    physics_step: float = 0.006
    """[s]; a coarse one makes a training of nights one of minutes."""
    lift: float = 0.8
    """Largest share of its weight that a robot hangs by at first.

    Who hangs by most of it finds standing by chance, which a training from nothing needs;
    for one that begins with a policy that rises, 0.3 bridges the change of conditions.
    """


RECIPES = {
    "quick": Recipe(rewards="quick", randomisation="torque", apart=False, iterations=500),
    "robust": Recipe(
        rewards="robust",
        randomisation="all",
        apart=True,
        iterations=1500,
        entropy=0.0,
        most_std=0.2,
        lift=0.3,
    ),
    "gentle": Recipe(
        rewards="gentle",
        randomisation="all",
        apart=True,
        iterations=800,
        entropy=0.0,
        most_std=0.2,
        lift=0.3,
    ),
}


class Runner(OnPolicyRunner):
    """rsl-rl's runner, whose checkpoint holds all that a resumed training depends on."""

    env: RslEnv

    def __init__(
        self, env: RslEnv, config: dict[str, Any], folder: Path, device: str, rank: Rank
    ) -> None:
        super().__init__(env, config, str(folder), device)
        self._file, self._rank = folder / CHECKPOINT, rank
        self.logger.git_status_repos = []  # the tree around a training is nobody's business

    def save(self, path: str, infos: dict | None = None) -> None:
        """Write the one checkpoint, in place of the last."""
        del path, infos
        state = self.alg.save() | {
            "iter": self.current_learning_iteration,
            "env": self.env.env.save_state(),
            "observations": self.env.observations.cpu(),
            "torch_rng": torch.get_rng_state(),
            "cuda_rng": torch.cuda.get_rng_state(self.device) if self._on_gpu else None,
            "timesteps": self.logger.tot_timesteps,
            "time": self.logger.tot_time,
        }
        write_checkpoint(state, self._file)

    def resume(self) -> None:
        """Go on from the checkpoint as if nothing had happened.

        Of several processes, only the first wrote down its robots; the others begin anew.
        """
        state = read_checkpoint(self._file, self.device)
        self.alg.load(state, None, True)
        self.current_learning_iteration = state["iter"] + 1
        if not self._rank.leads:
            return
        self.env.env.restore_state(state["env"])
        self.env.observations = state["observations"].to(self.device)
        torch.set_rng_state(state["torch_rng"].cpu())
        if self._on_gpu:
            torch.cuda.set_rng_state(state["cuda_rng"].cpu(), self.device)
        self.logger.tot_timesteps, self.logger.tot_time = state["timesteps"], state["time"]

    def inherit(self, parent: Path) -> None:
        """Begin with the networks of another training."""
        state = read_checkpoint(parent / CHECKPOINT, self.device)
        before = tuple(json.loads((parent / RECIPE).read_text("utf-8"))["actions"])
        env = self.env.env
        widened = widen(state, env.terms, before, env.action)
        self.alg.load(widened, {"actor": True, "critic": True}, True)

    @property
    def _on_gpu(self) -> bool:
        return self.device.startswith("cuda")


def build_config(recipe: Recipe, seed: int) -> dict[str, Any]:
    """Build rsl-rl's configuration: its own defaults where no reason stands beside a number."""
    gaussian = {
        "class_name": "GaussianDistribution",
        "init_std": recipe.first_std,
        "std_type": "log",
        "std_range": (0.1, recipe.most_std),  # at least 0.1: what is sure of itself still explores
    }
    network = {
        "class_name": "MLPModel",
        "hidden_dims": list(recipe.hidden),
        "activation": "elu",
        "obs_normalization": True,
    }
    return {
        "seed": seed,
        "num_steps_per_env": STEPS,
        "save_interval": 25,
        "obs_groups": {"actor": ["policy"], "critic": ["critic"]},
        "logger": "tensorboard",
        "actor": network | {"distribution_cfg": gaussian},
        "critic": dict(network),
        "algorithm": {
            "class_name": "PPO",
            "num_learning_epochs": 4,  # of four mini-batches, as what first learnt to rise
            "num_mini_batches": 4,
            "clip_param": 0.2,
            "gamma": recipe.discount,
            "lam": 0.95,
            "value_loss_coef": 1.0,
            "use_clipped_value_loss": False,  # clipped, returns near 30 are learnt slowly
            "entropy_coef": recipe.entropy,
            "learning_rate": 1e-3,
            "schedule": "adaptive",  # the step size keeps to the desired KL divergence
            "desired_kl": recipe.desired_kl,
            "max_grad_norm": 1.0,
            "symmetry_cfg": {
                "data_augmentation_func": mirror_batch,
                "use_data_augmentation": True,
                "use_mirror_loss": False,
            },
        },
    }


@dataclass(frozen=True, kw_only=True)
class TrainReport:
    """How far a training is."""

    iteration: int
    iterations: int
    steps: int
    """Policy steps of all robots so far."""
    seconds: float
    """Time spent so far, resumed parts included [s]."""
    falls: int
    """Episodes from settled falls that ended in the last iteration."""
    stood: int
    """Those of them that ended in a stand, exploring as they were."""
    reward: float
    lift: float
    """Largest share of its weight that a robot hung by: what stands with it has not risen."""

    @property
    def share(self) -> float:
        """Return the share of falls that ended standing; nan for none."""
        return self.stood / self.falls if self.falls else float("nan")


class Progress:
    """Adds up steps to iterations and writes a row for each."""

    def __init__(
        self, file: Path, recipe: Recipe, report: Callable[[TrainReport], None], rank: Rank
    ) -> None:
        self._file, self._recipe, self._report, self._rank = file, recipe, report, rank
        self._steps: list[StepReport] = []
        self._begun, self._before = time.monotonic(), 0.0
        self._iteration = 0

    def resume(self, iteration: int) -> None:
        """Keep the rows before an iteration and go on from there."""
        self._iteration = iteration
        if not self._rank.leads or not self._file.exists():
            return
        with self._file.open(newline="") as stream:
            rows = [row for row in csv.DictReader(stream) if int(row["iteration"]) < iteration]
        self._before = float(rows[-1]["seconds"]) if rows else 0.0
        with self._file.open("w", newline="") as stream:
            writer = csv.DictWriter(stream, list(TrainReport.__dataclass_fields__))
            writer.writeheader()
            writer.writerows(rows)

    def __call__(self, step: StepReport) -> None:
        """Count one policy step."""
        self._steps.append(step)
        if len(self._steps) < STEPS:
            return
        report = TrainReport(
            iteration=self._iteration,
            iterations=self._recipe.iterations,
            steps=(self._iteration + 1) * STEPS * self._recipe.robots * self._rank.of,
            seconds=round(self._before + time.monotonic() - self._begun, 1),
            falls=sum(s.falls for s in self._steps),
            stood=sum(s.stood for s in self._steps),
            reward=round(float(np.mean([s.reward for s in self._steps])), 4),
            lift=round(self._steps[-1].lift, 3),
        )
        self._steps, self._iteration = [], self._iteration + 1
        if not self._rank.leads:
            return
        row = asdict(report)
        is_new = not self._file.exists()
        with self._file.open("a", newline="") as stream:
            writer = csv.DictWriter(stream, list(row))
            if is_new:
                writer.writeheader()
            writer.writerow(row)
        self._report(report)


def build_options(recipe: Recipe, threads: int) -> EnvOptions:
    """Build the environment's options."""
    return EnvOptions(
        robots=recipe.robots,
        randomisation=RANDOMISATIONS[recipe.randomisation],
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
        CheckpointError: if its checkpoint is spoilt.
    """
    rank = Rank.from_environment(os.environ)
    seed, device, common_seed = rank.seed(seed), rank.device(device), seed
    folder.mkdir(parents=True, exist_ok=True)
    if rank.leads:
        write_recipe(robot, recipe, common_seed, folder / RECIPE, parent)
    progress = Progress(folder / PROGRESS, recipe, report, rank)
    pool = load_pool(robot, recipe, common_seed, folder / POOL)
    options = build_options(recipe, threads)
    random.seed(seed)
    torch.manual_seed(seed)
    action = choose_actions(robot, recipe.apart)
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
        "actions": choose_actions(robot, recipe.apart).names,
        "recipe": asdict(recipe),
        "parent": None if parent is None else _describe_parent(robot, parent),
    }
    settle_recipe(file, record)


def _describe_parent(robot: Robot, parent: Path) -> dict[str, Any]:
    """Tell what a training begins with, by its content."""
    record = json.loads((parent / RECIPE).read_text("utf-8"))
    if record["robot"] != robot.name:
        raise OtherTrainingError(
            f"{parent} is a training of robot '{record['robot']}', allowed '{robot.name}'"
        )
    content = (parent / CHECKPOINT).read_bytes()
    return {
        "recipe": record["recipe"]["rewards"],
        "seed": record["seed"],
        "sha256": hashlib.sha256(content).hexdigest(),
    }


def load_pool(robot: Robot, recipe: Recipe, seed: int, file: Path) -> StartPool:
    """Load the settled falls that a training starts from; make them if there are none.

    Raises:
        FallError: if the robot does not come to lie still.
        ValueError: if the file holds no falls of this robot.
    """
    world = make_world(robot, "flat", False)
    if not file.exists():
        make_pool(robot, world, recipe.falls, pool_rng(seed)).save(file, robot)
    return StartPool.load(file, robot, world.nq)
