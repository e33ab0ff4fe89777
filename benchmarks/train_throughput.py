"""Compare training with bare physics: policy steps per second, same machine, same run.

Bare physics steps the same robots on `mujoco.batch` with the targets that the environment sent,
each policy step from the state that the environment was in: nothing is sensed, rewarded or reset.
Compared with it, in turn: the environment with random actions; training, learning included; and,
once, the same task as single-robot Gymnasium environments in two processes under stable-baselines3
(`pip install stable-baselines3`; skipped if missing).

    python benchmarks/train_throughput.py --json throughput.json

Minutes until a policy, as it would be exported, stands up from 95 % of 200 falls that it never saw;
of every 25th iteration, those are tried in which half as many stood up while exploring:

    python benchmarks/train_throughput.py --until 0.95 --json minutes.json

A training with style curves needs a prior and a training to begin with, and has no peer:

    python benchmarks/train_throughput.py --recipe styled-quick --prior out/prior --parent FOLDER
"""

from __future__ import annotations

import importlib.util
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass, replace
from json import dumps
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
import tyro
from mujoco.batch import Batch
from training_checkpoints import FALLS, SEED, JudgedCheckpoint, KeptCheckpoints, judge_until
from training_progress import TrainingProgress

from humanoid_getup.policy.observation import Floats
from robots import Robot, load_robot
from robots.quaternion import Array
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts import StartPool
from sim2real.training.config import RECIPES, STEPS, Recipe
from sim2real.training.library_threads import numpy_threads
from sim2real.training.train import POOL, Training, keep_prior

PROCESSES = 2
SPEED_ITERATIONS = 25


@dataclass(frozen=True)
class Task:
    """A training to measure."""

    robot: Robot
    recipe_name: str
    recipe: Recipe
    pool: StartPool
    threads: int
    steps: int
    """Policy steps of every robot in a round."""
    prior: Path | None
    """Folder of the pose prior of a training with style curves."""
    parent: Path | None
    seed: int
    """Random seed of the trainings."""

    def make_env(self, robots: int, threads: int) -> GetUpEnv:
        if self.prior is not None:
            recipe = replace(self.recipe, robots=robots)
            with tempfile.TemporaryDirectory() as name:
                keep_prior(self.prior, folder := Path(name))
                self.pool.save(folder / POOL, self.robot)
                training = Training(robot=self.robot, recipe=recipe, folder=folder, threads=threads)
                return training.build_env()
        training = Training(robot=self.robot, recipe=self.recipe, folder=Path(), threads=threads)
        options = replace(training.build_options(), robots=robots)
        actions = self.recipe.choose_actions(self.robot)
        return GetUpEnv(self.robot, actions, StartPool.of(self.pool.qpos), options)


class Recorder:
    """Forwards every call to a batch; records the controls that are rolled out, and from where."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self.rolled: list[tuple[Array, int, Array]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._batch, name)

    def rollout(self, steps: int, control: Array, **rest: Any) -> dict[Any, Array]:
        self.rolled.append((self._batch.state.copy(), steps, control))
        return self._batch.rollout(steps, control, **rest)


class Stepping:
    """Steps the environment with random actions, and bare physics as the environment did."""

    def __init__(self, task: Task, rng: np.random.Generator) -> None:
        self._task, self._rng, n = task, rng, task.recipe.robots
        self._env = task.make_env(n, task.threads)
        self._env.reset(seed=0)
        self._env.episodes.age[:] = rng.integers(0, self._env.longest, n)
        self._bare = Batch(self._env.sim.model, n, task.threads)
        self._recorder = Recorder(self._env.sim.batch)
        self._env.sim.batch = self._recorder  # pyright: ignore[reportAttributeAccessIssue]

    def measure(self) -> tuple[float, float]:
        """Return policy steps per second of bare physics and of the environment."""
        recorder, count = self._recorder, self._task.steps * self._env.num_envs
        recorder.rolled.clear()
        shape = self._task.steps, self._env.num_envs, len(self._env.head.names)
        actions = self._rng.uniform(-1.0, 1.0, shape)
        with numpy_threads(1):  # as a training does
            began = time.perf_counter()
            for action in actions:
                self._env.step(action)
            whole = count / (time.perf_counter() - began)
        began = time.perf_counter()
        for state, steps, control in recorder.rolled:
            self._bare.state[:] = state
            self._bare.rollout(steps, control, record=())
        return count / (time.perf_counter() - began), whole


def measure_training(task: Task, iterations: int) -> float:
    """Return policy steps per second of a training, from the second iteration on."""
    with tempfile.TemporaryDirectory() as folder:
        train(task, Path(folder), iterations + 2)
        return TrainingProgress.read(Path(folder)).steps_per_s(begin=1)


def train(task: Task, folder: Path, iterations: int) -> None:
    """Train by `getup train`, from the falls of the task."""
    task.pool.save(folder / POOL, task.robot)
    line = [sys.executable, "-m", "humanoid_getup.commands.main", "train"]
    line += ["--recipe", task.recipe_name, "--robot", task.robot.name, "--out", str(folder)]
    line += ["--iterations", str(iterations), "--robots", str(task.recipe.robots)]
    line += ["--threads", str(task.threads), "--seed", str(task.seed)]
    line += ["--prior", str(task.prior)] if task.prior else []
    line += ["--parent", str(task.parent)] if task.parent else []
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    if done.returncode > 1:
        raise SystemExit(done.stderr)


class OneRobot(gymnasium.Env):
    """The same task with one robot, as a single Gymnasium environment.

    `GetUpEnv` resets a robot in the last step of its episode: that step returns the final
    observation, and the following reset the first one of the new episode.
    """

    def __init__(self, task: Task) -> None:
        self._env = task.make_env(1, 1)
        self._begun: Floats | None = (
            None  # first observation of an episode that has not been requested yet
        )
        self.observation_space = self._env.single_observation_space
        self.action_space = self._env.single_action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        observation, self._begun = self._begun, None
        if observation is None or seed is not None:
            observation, _ = self._env.reset(seed=seed, options=options)
        return observation[0], {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        observation, reward, _, cut, info = self._env.step(action[None])
        if cut[0]:
            self._begun, observation = observation, info["final_obs"]
        return observation[0], float(reward[0]), False, bool(cut[0]), {}


def measure_peer(task: Task, iterations: int) -> float | None:
    """Return policy steps per second of stable-baselines3's PPO; None if it is missing."""
    if not iterations or task.recipe.style:
        return None
    if importlib.util.find_spec("stable_baselines3") is None:
        print("stable-baselines3 is not installed: skipped")
        return None
    from stable_baselines3 import PPO  # pyright: ignore[reportMissingImports]
    from stable_baselines3.common.vec_env import SubprocVecEnv  # pyright: ignore[reportMissingImports]

    samples = STEPS * task.recipe.robots  # between two updates, as in our training
    robots = SubprocVecEnv([lambda: OneRobot(task)] * PROCESSES)
    try:
        peer = PPO(
            "MlpPolicy",
            robots,
            n_steps=samples // PROCESSES,
            batch_size=samples // 4,
            n_epochs=4,
            gamma=task.recipe.discount,
            policy_kwargs={"net_arch": list(task.recipe.hidden)},
            device="cpu",
            seed=0,
        )
        peer.learn(samples)  # warms up
        began = time.perf_counter()
        peer.learn(iterations * samples, reset_num_timesteps=False)
        return iterations * samples / (time.perf_counter() - began)
    finally:
        robots.close()


def measure_speeds(task: Task, rounds: int, iterations: int) -> dict[str, list[float]]:
    """Measure bare physics, the environment and training in turn, some times."""
    stepping = Stepping(task, np.random.default_rng(0))
    speeds: dict[str, list[float]] = {name: [] for name in ("bare", "env", "training")}
    for _ in range(rounds):
        bare, env = stepping.measure()
        speeds["bare"].append(bare)
        speeds["env"].append(env)
        speeds["training"].append(measure_training(task, iterations))
    return speeds


def measure_learning(task: Task, share: float) -> list[JudgedCheckpoint]:
    """Train the whole recipe; judge until a share of falls stands."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name, "training")
        folder.mkdir()
        checkpoints = KeptCheckpoints(training=folder, folder=folder / "checkpoints")
        with checkpoints.keeping():
            train(task, folder, task.recipe.iterations)
        progress, falls = TrainingProgress.read(folder), Path(name, "unseen.npz")
        judged = judge_until(checkpoints.found, progress, share, falls)
        if not any(each.stood >= share for each in judged):
            print(f"  never {share:.0%}", flush=True)
        return judged


def main(
    *,
    robot: str = "op3",
    recipe: Literal["quick", "robust", "gentle", "styled-quick"] = "quick",
    prior: Path | None = None,
    parent: Path | None = None,
    robots: int | None = None,
    threads: int = 0,
    rounds: int = 3,
    iterations: int | None = None,
    peer_iterations: int = 2,
    steps: int = 40,
    falls: int = 128,
    until: float | None = None,
    seed: int = 0,
    json: Path | None = None,
) -> None:
    """Compare training with bare physics.

    Args:
        robot: Name of a robot.
        recipe: Training recipe.
        prior: Folder of the pose prior of a training with style curves.
        parent: Policy file, or folder of a training, that such a training begins with.
        robots: Robots side by side; default: the recipe's.
        threads: Threads that step physics; 0 for one per processor.
        rounds: Measurements of each, in turn.
        iterations: Iterations of training, every 25th of which writes a checkpoint; default: 25,
            with --until the recipe's.
        peer_iterations: Iterations of stable-baselines3; 0 for none.
        steps: Policy steps in a round.
        falls: Settled falls in the pool.
        until: Train whole recipes instead, and judge their policies until one stands up from this
            share of falls.
        seed: Random seed of the trainings, and of the falls that they begin with.
        json: File for the results.
    """
    chosen = replace(RECIPES[recipe], falls=falls if until is None else RECIPES[recipe].falls)
    chosen = replace(chosen, robots=robots or chosen.robots)
    if until is not None:
        chosen = replace(chosen, iterations=iterations or chosen.iterations)
    if chosen.style is not None and prior is None:
        raise SystemExit(f"--prior is missing, expected with recipe {recipe}, see `getup prior`")
    loaded = load_robot(robot)
    with tempfile.TemporaryDirectory() as folder:
        training = Training(robot=loaded, recipe=chosen, seed=seed, folder=Path(folder))
        pool = training.load_pool()
    task = Task(loaded, recipe, chosen, pool, threads, steps, prior, parent, seed)
    head: dict[str, object] = {"name": "train_throughput", "recipe": recipe}
    head |= {"robots": chosen.robots, "seed": seed, "mujoco": mujoco.__version__}
    if until is not None:
        head |= {"share": until, "judged_falls": FALLS, "judged_seed": SEED}
        judged = [asdict(one) for one in measure_learning(task, until)]
        write(head | {"judged": judged}, json)
        return
    speeds = measure_speeds(task, rounds, iterations or SPEED_ITERATIONS)
    if peer := measure_peer(task, peer_iterations):
        speeds["stable_baselines3"] = [peer] * rounds
    over = {
        name: [rate / bare for rate, bare in zip(rates, speeds["bare"], strict=True)]
        for name, rates in speeds.items()
    }
    for name, rates in speeds.items():
        ratio = f"{statistics.median(over[name]):.2f} of bare"
        spread = f"{min(over[name]):.2f} to {max(over[name]):.2f}"
        print(f"{name:18} {statistics.median(rates):9,.0f} policy steps/s  {ratio} ({spread})")
    medians = {name: statistics.median(rates) for name, rates in speeds.items()}
    head["n"] = rounds
    write(head | {"policy_steps_per_s": medians, "each": speeds, "over_bare": over}, json)


def write(record: dict[str, Any], file: Path | None) -> None:
    """Write the results, if there is a file for them."""
    if file:
        file.write_text(dumps(record, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
