"""Compare training with bare physics: policy steps a second, same machine, same run.

Bare physics steps the same robots on `mujoco.batch` with targets that the environment sent:
nothing is sensed, rewarded or laid down again. Against it: the environment with random
actions; the whole of training, learning included; and the same task as single-robot
Gymnasium environments in two processes under stable-baselines3 (`pip install
stable-baselines3`; left out where it is missing).

    python benchmarks/train_throughput.py --recipe quick --json throughput.json
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import statistics
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco.batch import Batch

from humanoid_getup.policy.observation import Floats
from robots import Robot, load_robot
from robots.quaternion import Array
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.initial_states import StartPool
from sim2real.training.config import RECIPES, STEPS, Recipe
from sim2real.training.iteration_log import TrainReport
from sim2real.training.train import build_options, load_pool, train

ROUNDS = 5  # of bare physics and of the environment, in turn
PROCESSES = 2


@dataclass(frozen=True)
class Task:
    """What is trained, and with what."""

    robot: Robot
    recipe: Recipe
    pool: StartPool
    threads: int
    steps: int
    """Policy steps of every robot in a round."""

    def make_env(self, robots: int, threads: int) -> GetUpEnv:
        options = replace(build_options(self.recipe, threads), robots=robots)
        actions = self.recipe.choose_actions(self.robot)
        return GetUpEnv(self.robot, actions, StartPool.of(self.pool.qpos), options)


class Recorder:
    """Passes everything on to a batch, and keeps the controls that are rolled out."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self.rolled: list[tuple[int, Array]] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._batch, name)

    def rollout(self, steps: int, control: Array, **rest: Any) -> dict[Any, Array]:
        self.rolled.append((steps, control))
        return self._batch.rollout(steps, control, **rest)


def measure_stepping(task: Task, rng: np.random.Generator) -> tuple[float, float]:
    """Return policy steps a second of bare physics and of the environment."""
    n = task.recipe.robots
    env = task.make_env(n, task.threads)
    env.reset(seed=0)
    env.ages[:] = rng.integers(0, env.longest, n)
    bare_batch = Batch(env.sim.model, n, task.threads)
    recorder = Recorder(env.sim.batch)
    env.sim.batch = recorder  # pyright: ignore[reportAttributeAccessIssue]
    bare, whole = [], []
    for _ in range(ROUNDS):
        bare_batch.state[:] = recorder.state
        recorder.rolled.clear()
        actions = rng.uniform(-1.0, 1.0, (task.steps, n, env.action.size))
        began = time.perf_counter()
        for action in actions:
            env.step(action)
        whole.append(task.steps * n / (time.perf_counter() - began))
        began = time.perf_counter()
        for steps, control in recorder.rolled:
            bare_batch.rollout(steps, control, record=())
        bare.append(task.steps * n / (time.perf_counter() - began))
    return statistics.median(bare), statistics.median(whole)


def measure_training(task: Task, iterations: int) -> float:
    """Return policy steps a second of training, from the first update's end on."""
    seen: list[tuple[float, int]] = []

    def note(report: TrainReport) -> None:
        seen.append((time.perf_counter(), report.steps))

    recipe = replace(task.recipe, iterations=iterations + 1)
    with tempfile.TemporaryDirectory() as folder:
        train(task.robot, recipe, 0, Path(folder), threads=task.threads, report=note)
    (began, before), (ended, after) = seen[0], seen[-1]
    return (after - before) / (ended - began)


class OneRobot(gymnasium.Env):
    """The same task, one robot, as Gymnasium's single environments are.

    At an end the robot already lies in its next start: what it saw last is returned, and
    the reset that follows hands out what it sees now.
    """

    def __init__(self, task: Task) -> None:
        self._env = task.make_env(1, 1)
        self._begun: Floats | None = None  # seen in an episode that nobody has asked for yet
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
    """Return policy steps a second of stable-baselines3's PPO; None where it is missing."""
    if importlib.util.find_spec("stable_baselines3") is None:
        print("stable-baselines3 is not installed: left out")
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="op3")
    parser.add_argument("--recipe", default="quick", choices=sorted(RECIPES))
    parser.add_argument("--robots", type=int, default=None, help="side by side")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--iterations", type=int, default=10, help="of training")
    parser.add_argument("--peer-iterations", type=int, default=2, help="of stable-baselines3")
    parser.add_argument("--steps", type=int, default=40, help="policy steps in a round")
    parser.add_argument("--falls", type=int, default=128)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    recipe = RECIPES[options.recipe]
    recipe = replace(recipe, falls=options.falls, robots=options.robots or recipe.robots)
    robot = load_robot(options.robot)
    with tempfile.TemporaryDirectory() as folder:
        pool = load_pool(robot, recipe, 0, Path(folder, "falls.npz"))
    task = Task(robot, recipe, pool, options.threads, options.steps)
    bare, env = measure_stepping(task, np.random.default_rng(0))
    rates = {"bare": bare, "env": env, "training": measure_training(task, options.iterations)}
    peer = measure_peer(task, options.peer_iterations)
    rates |= {} if peer is None else {"stable_baselines3": peer}
    for name, rate in rates.items():
        print(f"{name:18} {rate:9,.0f} policy steps/s  {rate / bare:5.2f} of bare")
    record = {
        "name": "train_throughput",
        "recipe": options.recipe,
        "robots": recipe.robots,
        "mujoco": mujoco.__version__,
        "policy_steps_per_s": rates,
        "over_bare": {name: rate / bare for name, rate in rates.items()},
    }
    if options.json:
        options.json.write_text(json.dumps(record, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
