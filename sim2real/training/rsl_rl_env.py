"""The training environment as rsl-rl sees it: torch in, torch out, one step after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from humanoid_getup.policy.observation import Floats, mirror_of_observation
from sim2real.environment.get_up_env import GetUpEnv


@dataclass(frozen=True)
class StepReport:
    """What one policy step of all robots brought."""

    falls: int
    """Episodes from settled falls that ended in it."""
    stood: int
    """Those of them that ended in a stand."""
    reward: float
    """Mean over the robots."""
    lift: float
    """Largest share of its weight that a robot hangs by."""


class RslEnv(VecEnv):
    """Hands a `GetUpEnv` to rsl-rl; the actor sees sensors, the critic everything."""

    def __init__(
        self,
        env: GetUpEnv,
        device: str = "cpu",
        on_step: Callable[[StepReport], None] = lambda _: None,
    ) -> None:
        self.env, self.device, self._on_step = env, device, on_step
        self.num_envs = env.num_envs
        self.num_actions = env.action.size
        self.max_episode_length = env.longest
        self.cfg = {}
        mirror = mirror_of_observation(env.robot, env.action)
        self.mirror_index = torch.as_tensor(mirror.index, device=device)
        self.mirror_sign = torch.as_tensor(mirror.sign, dtype=torch.float32, device=device)
        action_sign = env.action.mirror_sign(env.robot)
        self.action_sign = torch.as_tensor(action_sign, dtype=torch.float32, device=device)
        critic = env.mirror_of_critic()
        self.critic_index = torch.as_tensor(critic.index, device=device)
        self.critic_sign = torch.as_tensor(critic.sign, dtype=torch.float32, device=device)
        self.observations = TensorDict({}, batch_size=[self.num_envs])

    def begin(self, seed: int, rng: np.random.Generator) -> None:
        """Lay all robots down, their episodes of all ages so that they do not end together."""
        observation, info = self.env.reset(seed=seed)
        self.env.ages[:] = rng.integers(0, self.env.longest, self.num_envs)
        self.observations = self._pack(observation, info["critic"])

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Return how many policy steps each episode has lasted."""
        return torch.as_tensor(self.env.ages)

    @episode_length_buf.setter
    def episode_length_buf(self, ages: torch.Tensor) -> None:
        self.env.ages[:] = ages.numpy()

    def get_observations(self) -> TensorDict:
        """Return what actor and critic saw last."""
        return self.observations

    def step(
        self, actions: torch.Tensor
    ) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict[str, object]]:
        """Let a policy step pass."""
        observation, reward, _, ended, info = self.env.step(actions.cpu().numpy())
        self.observations = self._pack(observation, info["critic"])
        self._on_step(StepReport(info["falls"], info["stood"], float(reward.mean()), info["lift"]))
        done = torch.as_tensor(ended, device=self.device)
        log = {f"Rewards/{name}": value for name, value in info["rewards"].items()}
        log["Train/lift"] = info["lift"]
        extras = {"time_outs": done, "log": log}
        return self.observations, torch.as_tensor(reward, device=self.device), done, extras

    def _pack(self, observation: Floats, critic: Floats) -> TensorDict:
        values = {"policy": torch.from_numpy(observation), "critic": torch.from_numpy(critic)}
        return TensorDict(values, batch_size=[self.num_envs]).to(self.device)


def mirror_batch(
    env: RslEnv, obs: TensorDict | None = None, actions: torch.Tensor | None = None
) -> tuple[TensorDict | None, torch.Tensor | None]:
    """Append the mirror images of observations and of actions; rsl-rl's symmetry function."""
    if obs is not None:
        mirrored = TensorDict(
            {
                "policy": obs["policy"][:, env.mirror_index] * env.mirror_sign,
                "critic": obs["critic"][:, env.critic_index] * env.critic_sign,
            },
            batch_size=obs.batch_size,
        )
        obs = cast(TensorDict, torch.cat([obs, mirrored]))  # pyright: ignore[reportArgumentType, reportCallIssue]
    if actions is not None:
        actions = torch.cat((actions, actions * env.action_sign))
    return obs, actions
