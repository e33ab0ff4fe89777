"""Adapter of the training environment to rsl-rl."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, cast

import numpy as np
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from humanoid_getup.policy.observation import Floats
from sim2real.environment.get_up_env import GetUpEnv


class RslEnv(VecEnv):
    """A `GetUpEnv` for rsl-rl; the actor observes sensors, the critic privileged state as well."""

    def __init__(
        self,
        env: GetUpEnv,
        device: str = "cpu",
        on_step: Callable[[float, dict[str, Any]], None] = lambda *_: None,
    ) -> None:
        """Wrap an environment; ``on_step`` gets each step's mean reward and information."""
        self.env, self.device, self._on_step = env, device, on_step
        self.num_envs = env.num_envs
        self.num_actions = len(env.head.names)
        self.max_episode_length = env.longest
        self.cfg = {}
        self.reports = True
        """Whether ``on_step`` is called."""
        policy, critic, self.action_mirror = (
            (
                torch.as_tensor(mirror.index, device=device),
                torch.as_tensor(mirror.sign, dtype=torch.float32, device=device),
            )
            for mirror in env.mirrors
        )
        self.mirrors = {"policy": policy, "critic": critic}
        self.observations = TensorDict({}, batch_size=[self.num_envs])

    def begin(self, seed: int, rng: np.random.Generator) -> None:
        """Start all episodes at random ages, so that they do not end together."""
        observation, info = self.env.reset(seed=seed)
        self.env.episodes.age[:] = rng.integers(0, self.env.longest, self.num_envs)
        self.observations = self._pack(observation, info["critic"])

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Return the age of each episode in policy steps."""
        return torch.as_tensor(self.env.episodes.age)

    @episode_length_buf.setter
    def episode_length_buf(self, ages: torch.Tensor) -> None:
        self.env.episodes.age[:] = ages.numpy()

    def get_observations(self) -> TensorDict:
        """Return the last observations of actor and critic."""
        return self.observations

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, object]]:
        """Step all robots by one policy step."""
        observation, reward, terminated, truncated, info = self.env.step(actions.cpu().numpy())
        self.observations = self._pack(observation, info["critic"])
        if self.reports:
            self._on_step(float(reward.mean()), info)
        done = torch.as_tensor(terminated | truncated, device=self.device)
        log = {f"Rewards/{name}": value for name, value in info["rewards"].items()}
        log["Train/lift"] = info["assistive_force"]
        timed_out = torch.as_tensor(truncated, device=self.device)
        extras = {"time_outs": timed_out, "log": log}
        return self.observations, torch.as_tensor(reward, device=self.device), done, extras

    def _pack(self, observation: Floats, critic: Floats) -> TensorDict:
        values = {"policy": torch.from_numpy(observation), "critic": torch.from_numpy(critic)}
        return TensorDict(values, batch_size=[self.num_envs]).to(self.device)


def mirror_batch(
    env: RslEnv, obs: TensorDict | None = None, actions: torch.Tensor | None = None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Append the mirror images of observations and actions; rsl-rl's symmetry function."""
    if obs is not None:
        images = {name: obs[name][:, index] * sign for name, (index, sign) in env.mirrors.items()}
        mirrored = TensorDict(images, batch_size=obs.batch_size)
        obs = cast(TensorDict, torch.cat([obs, mirrored]))  # pyright: ignore[reportArgumentType, reportCallIssue]
    if actions is not None:
        index, sign = env.action_mirror
        actions = torch.cat((actions, actions[:, index] * sign))
    return obs, actions
