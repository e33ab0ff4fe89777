"""Compare training with bare physics: policy steps per second, same machine, same run.

Bare physics steps the same robots on `mujoco.batch` with the targets that the environment sent,
each policy step from the state that the environment was in: nothing is sensed, rewarded or reset.
Compared with it: the environment with random actions; training, learning included; and the same
task as single-robot Gymnasium environments in two processes under stable-baselines3 (`pip install
stable-baselines3`; skipped if missing).

    python benchmarks/train_throughput.py --recipe quick --json throughput.json

A training with style curves needs a prior and a training to begin with, and has no peer:

    python benchmarks/train_throughput.py --recipe styled-quick --prior out/prior --parent FOLDER
"""

from __future__ import annotations

import importlib.util
import statistics
import tempfile
import time
from dataclasses import dataclass, replace
from json import dumps
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
import tyro
from mujoco.batch import Batch

from humanoid_getup.policy.observation import Floats
from robots import Robot, load_robot
from robots.quaternion import Array
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts.start_pool import StartPool
from sim2real.training.config import RECIPES, STEPS, Recipe
from sim2real.training.iteration_log import TrainReport
from sim2real.training.library_threads import numpy_threads
from sim2real.training.styled_training import keep_prior
from sim2real.training.train import POOL, TrainingInputs, build_env, build_options, load_pool, train

ROUNDS = 5  # of bare physics and of the environment, in turn
PROCESSES = 2


@dataclass(frozen=True)
class Task:
    """A training to measure."""

    robot: Robot
    recipe: Recipe
    pool: StartPool
    threads: int
    steps: int
    """Policy steps of every robot in a round."""
    prior: Path | None
    """Folder of the pose prior of a training with style curves."""
    parent: Path | None

    def make_env(self, robots: int, threads: int) -> GetUpEnv:
        if self.prior is not None:
            recipe = replace(self.recipe, robots=robots)
            with tempfile.TemporaryDirectory() as name:
                keep_prior(self.prior, folder := Path(name))
                self.pool.save(folder / POOL, self.robot)
                actions = recipe.choose_actions(self.robot)
                return build_env(self.robot, recipe, actions, 0, folder, threads)
        options = replace(build_options(self.recipe, threads), robots=robots)
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


def measure_stepping(task: Task, rng: np.random.Generator) -> tuple[float, float]:
    """Return policy steps per second of bare physics and of the environment."""
    n = task.recipe.robots
    env = task.make_env(n, task.threads)
    env.reset(seed=0)
    env.episodes.age[:] = rng.integers(0, env.longest, n)
    bare_batch = Batch(env.sim.model, n, task.threads)
    recorder = Recorder(env.sim.batch)
    env.sim.batch = recorder  # pyright: ignore[reportAttributeAccessIssue]
    bare, whole = [], []
    for _ in range(ROUNDS):
        recorder.rolled.clear()
        actions = rng.uniform(-1.0, 1.0, (task.steps, n, len(env.head.names)))
        began = time.perf_counter()
        for action in actions:
            env.step(action)
        whole.append(task.steps * n / (time.perf_counter() - began))
        began = time.perf_counter()
        for state, steps, control in recorder.rolled:
            bare_batch.state[:] = state
            bare_batch.rollout(steps, control, record=())
        bare.append(task.steps * n / (time.perf_counter() - began))
    return statistics.median(bare), statistics.median(whole)


def measure_training(task: Task, iterations: int) -> float:
    """Return policy steps per second of training, from the first update's end on."""
    seen: list[tuple[float, int]] = []

    def note(report: TrainReport) -> None:
        seen.append((time.perf_counter(), report.steps))

    recipe = replace(task.recipe, iterations=iterations + 1)
    with tempfile.TemporaryDirectory() as folder:
        train(
            task.robot,
            recipe,
            0,
            Path(folder),
            TrainingInputs(parent=task.parent, prior=task.prior, threads=task.threads),
            note,
        )
    (began, before), (ended, after) = seen[0], seen[-1]
    return (after - before) / (ended - began)


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


def main(
    *,
    robot: str = "op3",
    recipe: Literal["quick", "robust", "gentle", "styled-quick"] = "quick",
    prior: Path | None = None,
    parent: Path | None = None,
    robots: int | None = None,
    threads: int = 0,
    iterations: int = 10,
    peer_iterations: int = 2,
    steps: int = 40,
    falls: int = 128,
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
        iterations: Iterations of training.
        peer_iterations: Iterations of stable-baselines3.
        steps: Policy steps in a round.
        falls: Settled falls in the pool.
        json: File for the results.
    """
    chosen = replace(RECIPES[recipe], falls=falls)
    chosen = replace(chosen, robots=robots or chosen.robots)
    if chosen.style is not None and prior is None:
        raise SystemExit(f"--prior is missing, expected with recipe {recipe}, see `getup prior`")
    loaded = load_robot(robot)
    with tempfile.TemporaryDirectory() as folder:
        pool = load_pool(loaded, chosen, 0, Path(folder, "falls.npz"))
    task = Task(loaded, chosen, pool, threads, steps, prior, parent)
    with numpy_threads(1):  # as a training does
        bare, env = measure_stepping(task, np.random.default_rng(0))
    rates = {"bare": bare, "env": env, "training": measure_training(task, iterations)}
    peer = None if chosen.style else measure_peer(task, peer_iterations)
    rates |= {} if peer is None else {"stable_baselines3": peer}
    for name, rate in rates.items():
        print(f"{name:18} {rate:9,.0f} policy steps/s  {rate / bare:5.2f} of bare")
    record = {
        "name": "train_throughput",
        "recipe": recipe,
        "robots": chosen.robots,
        "mujoco": mujoco.__version__,
        "policy_steps_per_s": rates,
        "over_bare": {name: rate / bare for name, rate in rates.items()},
    }
    if json:
        json.write_text(dumps(record, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
