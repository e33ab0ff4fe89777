"""The training loop: rsl-rl's runner with complete checkpoints, and its configuration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rsl_rl.runners import OnPolicyRunner
from tensordict import TensorDict

from humanoid_getup.policy.observation import SAME, Mirror
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint, restore_like, write_checkpoint
from sim2real.training.config import STEPS, Recipe, TrainingRecord
from sim2real.training.imitation import imitate
from sim2real.training.networks import extend_actions, extend_inputs
from sim2real.training.policy_parent import read_actor
from sim2real.training.rsl_rl_env import RslEnv, mirror_batch

# Shares of episodes from settled falls and along rises, while these are imitated.
IMITATED_FALLS, IMITATED_RISES = 0.25, 0.7
CRITIC_ROUNDS, CRITIC_RATE = 12, 1e-3
MAP_STD = 0.05  # by which height maps are normalized; their unit is a neck height
Mirrors = tuple[Mirror, Mirror, Mirror]


class TrainingRunner(OnPolicyRunner):
    """rsl-rl's runner with checkpoints that hold the complete state of a training."""

    env: RslEnv

    def __init__(self, env: RslEnv, config: dict[str, Any], folder: Path, device: str) -> None:
        self._file = folder / CHECKPOINT
        super().__init__(env, config, str(folder), device)
        self._frozen = False  # whether the statistics of observations stay as they are
        self.logger.git_status_repos = []  # do not record the git state of the current folder

    def save(self, path: str, infos: dict | None = None) -> None:
        """Replace the checkpoint."""
        del path, infos
        state = self.alg.save() | {
            "iter": self.current_learning_iteration,
            "env": self.env.env.save_state(),
            "observations": self.env.observations.cpu().to_dict(),
            "torch_rng": torch.get_rng_state(),
            "cuda_rng": torch.cuda.get_rng_state(self.device) if self._on_gpu else None,
            "frozen": self._frozen,
            "timesteps": self.logger.tot_timesteps,
            "time": self.logger.tot_time,
        }
        write_checkpoint(state, self._file)

    def resume(self) -> None:
        """Continue from the checkpoint as if the training had not been interrupted."""
        state = read_checkpoint(self._file, self.device)
        self.alg.load(state, None, True)
        if state["frozen"]:
            self.freeze_normalizers()
        self.current_learning_iteration = state["iter"] + 1
        env = self.env.env
        env.restore_state(restore_like(env.save_state(), state["env"]))
        self.env.observations = TensorDict(state["observations"], [env.num_envs]).to(self.device)
        torch.set_rng_state(state["torch_rng"].cpu())
        if self._on_gpu:
            torch.cuda.set_rng_state(state["cuda_rng"].cpu(), self.device)
        self.logger.tot_timesteps, self.logger.tot_time = state["timesteps"], state["time"]

    def inherit(self, parent: Path) -> None:
        """Start with the networks of another training, extended to this one's actions.

        A policy with style curves has the same outputs before and after.
        """
        state = read_checkpoint(parent / CHECKPOINT, self.device)
        before, env = TrainingRecord.load(parent).actions, self.env.env
        if env.style is None:
            state = extend_actions(state, env.terms, before, env.action)
        elif before != env.head.names:
            raise ValueError(
                f"{parent} is a training with outputs {', '.join(before)}; expected "
                f"{', '.join(env.head.names)}"
            )
        actor, critic = self.alg._raw_actor, self.alg._raw_critic
        models = {"actor_state_dict": actor, "critic_state_dict": critic}
        networks = {name: state[name] for name in models}
        if env.style is not None and env.style.input.height_map:
            at = sum(term.size for term in env.terms[:-1])
            for name, model in models.items():
                networks[name] = extend_inputs(networks[name], model, at, MAP_STD)
        try:
            self.alg.load(networks, {"actor": True, "critic": True}, True)
        except RuntimeError as error:
            raise ValueError(f"{parent} has other networks than the recipe") from error
        if env.style is not None:
            self.freeze_normalizers()

    def inherit_policy(self, file: Path, seed: int) -> None:
        """Start with the actor of a policy file; fit the critic to its returns."""
        actor: Any = self.alg._raw_actor
        actor.load_state_dict(read_actor(file, actor))
        self.fit_critic(seed)

    def imitate(self, seed: int) -> list[float]:
        """Train a new policy to imitate rises, then its critic; return the losses.

        Afterwards normalizers stay as they are: their drift would distort what was learned.
        """
        env = self.env.env
        self.env.reports = False
        usual = env.options
        env.options = replace(
            usual, falls=IMITATED_FALLS, motions=IMITATED_RISES, assistive_force=0.0
        )
        self.env.begin(seed, np.random.default_rng(seed))  # along rises
        losses = imitate(self.alg._raw_actor, self.env, np.random.default_rng(seed))
        env.options = usual
        self.env.begin(seed, np.random.default_rng(seed))  # as the training does
        return losses + self.fit_critic(seed)

    def freeze_normalizers(self) -> None:
        """Keep the statistics of observations as they are."""
        self._frozen = True
        models: tuple[Any, ...] = (self.alg._raw_actor, self.alg._raw_critic)
        for model in models:
            model.obs_normalizer.until = 1

    def fit_critic(self, seed: int) -> list[float]:
        """Fit the critic to the returns of the present policy; return the error of each round.

        Not to distort the policy, the statistics of its observations are kept meanwhile; those of
        the critic's are kept from then on.
        """
        actor: Any = self.alg._raw_actor
        actor.obs_normalizer.until = 1
        self.env.reports = False
        errors = [self._fit_once() for _ in range(CRITIC_ROUNDS)]
        self.freeze_normalizers()
        self.env.begin(seed, np.random.default_rng(seed))
        self.env.reports = True
        return errors

    def _fit_once(self) -> float:
        """Collect steps of the policy, and fit the critic; return its mean squared error."""
        alg: Any = self.alg
        alg.train_mode()
        with torch.inference_mode():
            observed = self.env.get_observations()
            for _ in range(STEPS):
                observed, rewards, dones, extras = self.env.step(alg.act(observed))
                alg.process_env_step(observed, rewards, dones, extras)
            alg.compute_returns(observed)
        alg.critic.update_normalization(alg.storage.observations.flatten(0, 1))
        optimizer = torch.optim.Adam(alg.critic.parameters(), lr=CRITIC_RATE)
        errors = []
        for batch in alg.storage.mini_batch_generator(4, 4):
            value = alg.critic(batch.observations.clone())
            error = (value - batch.returns.clone()).square().mean()
            optimizer.zero_grad()
            error.backward()
            optimizer.step()
            errors.append(float(error.detach()))
        alg.storage.clear()
        return float(np.mean(errors))

    @property
    def _on_gpu(self) -> bool:
        return self.device.startswith("cuda")


def build_config(recipe: Recipe, seed: int, mirrors: Mirrors | None = None) -> dict[str, Any]:
    """Build rsl-rl's configuration; values without a comment are its defaults.

    With the mirrors of observation, critic's observation and outputs, both networks are
    symmetric by construction; without, they learn symmetry from mirrored mini-batches.
    """
    gaussian = {
        "class_name": "GaussianDistribution",
        "init_std": recipe.first_std,
        "std_type": "log",
        "std_range": (0.1, recipe.most_std),  # at least 0.1, so that exploration continues
    }
    network = {
        "class_name": "MLPModel",
        "hidden_dims": list(recipe.hidden),
        "activation": "elu",
        "obs_normalization": True,
    }
    actor, critic = network | {"distribution_cfg": gaussian}, dict(network)
    if mirrors is not None:
        own = {"class_name": "sim2real.training.networks:SymmetricModel"}
        inputs, critic_inputs, outputs = mirrors
        actor |= own | {"inputs": inputs, "outputs": outputs}
        critic |= own | {"inputs": critic_inputs, "outputs": SAME}
    return {
        "seed": seed,
        "num_steps_per_env": STEPS,
        "save_interval": 25,
        "obs_groups": {"actor": ["policy"], "critic": ["critic"]},
        "logger": "tensorboard",
        "actor": actor,
        "critic": critic,
        "algorithm": {
            "class_name": "sim2real.training.ppo:AveragingPPO",
            "num_learning_epochs": 4,  # as in the first policy that learned to rise
            "num_mini_batches": 4,
            "clip_param": 0.2,
            "gamma": recipe.discount,
            "lam": 0.95,
            "value_loss_coef": 1.0,
            "use_clipped_value_loss": False,  # clipping slows the learning of returns near 30
            "entropy_coef": recipe.entropy,
            "learning_rate": recipe.learning_rate,
            "schedule": "adaptive",  # by the desired KL divergence
            "desired_kl": recipe.desired_kl,
            "max_grad_norm": 1.0,
            "symmetry_cfg": {
                "data_augmentation_func": mirror_batch,
                "use_data_augmentation": mirrors is None,
                "use_mirror_loss": False,
            },
        },
    }
