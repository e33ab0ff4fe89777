"""A training loop that collects the next steps while the networks learn from the last ones.

Robots are moved by copies of the networks as these were before the update: their steps are one
update old when they are learned from.
"""

from __future__ import annotations

import copy
import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from rsl_rl.algorithms import PPO
from rsl_rl.storage import RolloutStorage
from rsl_rl.utils import check_nan

from sim2real.training.config import STEPS
from sim2real.training.library_threads import torch_threads
from sim2real.training.rsl_rl_env import RslEnv
from sim2real.training.runner import TrainingRunner

MOST_WEIGHT = 2.0  # of a sample: rare actions of the older policy must not dominate a batch


@dataclass(frozen=True)
class CollectedStep:
    """What the log of a training reads of a policy step of N robots."""

    rewards: torch.Tensor
    """(N,)"""
    dones: torch.Tensor
    """(N,)"""
    extras: dict[str, Any]


class StepCollector:
    """Moves the robots by copies of the networks, which another thread may change meanwhile."""

    def __init__(self, alg: PPO, env: RslEnv, seed: int) -> None:
        """Copy the networks of an algorithm; its steps get a storage of their own."""
        self._env, self._seed = env, seed
        self._alg = copy.copy(alg)
        self._alg.actor = copy.deepcopy(alg._raw_actor).requires_grad_(False)
        self._alg.critic = copy.deepcopy(alg._raw_critic).requires_grad_(False)
        self._alg.storage = copy.deepcopy(alg.storage)
        self._alg.transition = RolloutStorage.Transition()
        # Threads share torch's own generator, and would draw from it in any order.
        self._noise = torch.Generator(alg.device)
        distribution: Any = self._alg.actor.distribution
        distribution.generator = self._noise

    def copy_networks(self, alg: PPO) -> None:
        """Copy weights and statistics of an algorithm's networks."""
        self._alg.actor.load_state_dict(alg._raw_actor.state_dict())
        self._alg.critic.load_state_dict(alg._raw_critic.state_dict())

    def collect(self, iteration: int) -> list[CollectedStep]:
        """Collect the steps of an iteration; its number and the seed decide the exploration."""
        state = np.random.SeedSequence((self._seed, iteration)).generate_state(1, np.uint64)
        self._noise.manual_seed(int(state[0] >> np.uint64(1)))
        with torch.inference_mode(), torch_threads(1):
            steps = [self._step() for _ in range(STEPS)]
            self._alg.compute_returns(self._env.get_observations())
        return steps

    def hand_over(self, alg: PPO) -> None:
        """Give the collected steps to an algorithm, in exchange for its empty storage."""
        alg.storage, self._alg.storage = self._alg.storage, alg.storage

    def _step(self) -> CollectedStep:
        actions = self._alg.act(self._env.get_observations())
        observed, rewards, dones, extras = self._env.step(actions)
        check_nan(observed, rewards, dones)
        self._alg.process_env_step(observed, rewards, dones, extras)  # pyright: ignore[reportArgumentType]
        return CollectedStep(rewards, dones, extras)


class OverlappedRunner(TrainingRunner):
    """Collects the next steps in a thread while the networks learn from the last ones.

    Before a checkpoint nothing is collected ahead, so that a resumed training finds the robots
    where they were.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        # Physics takes the other half of the processors.
        self.alg.threads = max(self.alg.threads // 2, 1)  # pyright: ignore[reportAttributeAccessIssue]
        self._collector = StepCollector(self.alg, self.env, self.cfg["seed"])

    def learn(self, num_learning_iterations: int, init_at_random_ep_len: bool = False) -> None:
        """Train for some iterations."""
        del init_at_random_ep_len  # the environment begins so
        self.alg.train_mode()
        self.logger.init_logging_writer()
        first = self.current_learning_iteration
        end = first + num_learning_iterations
        with ThreadPoolExecutor(1, "collector") as thread:
            ahead: Future[list[CollectedStep]] | None = None
            for iteration in range(first, end):
                began = time.monotonic()
                if ahead is None:
                    ahead = self._collect(thread, iteration)
                steps = ahead.result()
                collected = time.monotonic()
                self._collector.hand_over(self.alg)
                saves = iteration % self.cfg["save_interval"] == 0 or iteration + 1 == end
                ahead = None if saves else self._collect(thread, iteration + 1)
                for step in steps:
                    self.logger.process_env_step(step.rewards, step.dones, step.extras)
                weigh_by_newest(self.alg)
                losses = self.alg.update()
                self.current_learning_iteration = iteration
                self.logger.log(
                    it=iteration,
                    start_it=first,
                    total_it=end,
                    collect_time=collected - began,  # as far as it was waited for
                    learn_time=time.monotonic() - collected,
                    loss_dict=losses,
                    learning_rate=self.alg.learning_rate,
                    action_std=self.alg.get_policy().output_std,
                    rnd_weight=None,
                )
                if saves:
                    self.save("")
        self.logger.stop_logging_writer()

    def _collect(self, thread: ThreadPoolExecutor, iteration: int) -> Future[list[CollectedStep]]:
        """Begin to collect the steps of an iteration by the present policy."""
        self._collector.copy_networks(self.alg)
        return thread.submit(self._collector.collect, iteration)


def weigh_by_newest(alg: PPO) -> None:
    """Convert stored steps of an older policy to weighted ones of the present policy.

    An update then begins at a ratio of 1 and a divergence of 0: both limit its own step alone.
    The weights of advantages correct for the age ([Hilton22], decoupled objective).
    """
    stored, actor = alg.storage, alg.actor
    with torch.inference_mode():
        actor(stored.observations.flatten(0, 1), stochastic_output=True)  # pyright: ignore[reportArgumentType]
        newest = actor.get_output_log_prob(stored.actions.flatten(0, 1))
        newest = newest.view_as(stored.actions_log_prob)
        weights = (newest - stored.actions_log_prob).exp().clamp(max=MOST_WEIGHT)
        stored.advantages = stored.advantages * weights
        stored.actions_log_prob.copy_(newest)
        params: Any = stored.distribution_params
        for kept, now in zip(params, actor.output_distribution_params, strict=True):
            kept.copy_(now.view_as(kept))
