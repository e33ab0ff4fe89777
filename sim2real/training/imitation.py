"""Imitation: a policy is trained on planned motions before it explores.

Robots replay the motions in the training environment under its domain randomization; what the
policy would observe is stored with the outputs that lead to the motion's next targets. Then the
policy itself moves them, and learns what would have led back to the motion ([Ross11], DAgger).

Rises of policies are not imitated: their actions are rates, small against the errors of a network
that has to yield whole postures, and what was learned of them did not stand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from robots.quaternion import Array
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.style_task import StyleTask
from sim2real.training.rsl_rl_env import RslEnv

REPLAYED = 150  # policy steps in which motions are replayed
STEPS = 60  # policy steps of each part in which the policy moves the robots
PARTS = 20  # of the latter
EPOCHS = 3  # over all examples so far, after each part
BATCH = 2048
LEARNING_RATES = (1e-3, 1e-4)  # at first, and in the last part
NOISE = 0.1  # of the outputs while motions are replayed


@dataclass(frozen=True)
class Example:
    """Observations of N robots, and the correct outputs for them."""

    observation: torch.Tensor
    outputs: torch.Tensor


def imitate(actor: MLPModel, env: RslEnv, rng: np.random.Generator) -> list[float]:
    """Train an actor to imitate an environment's motions; return the last loss of each part.

    The actor is symmetric by construction, so mirror images add nothing.
    """
    task = env.env.style
    if task is None:
        raise ValueError("rises are imitated along style curves, expected an environment with them")
    optimizer = torch.optim.Adam(actor.mlp.parameters())
    examples = _collect(None, env, task, rng, REPLAYED)
    seen = torch.cat([example.observation for example in examples])
    actor.update_normalization(TensorDict({"policy": seen}, batch_size=[len(seen)]))
    losses = [_fit(actor, examples, optimizer, LEARNING_RATES[0])]
    for rate in np.linspace(*LEARNING_RATES, PARTS):
        examples += _collect(actor, env, task, rng, STEPS)
        losses.append(_fit(actor, examples, optimizer, float(rate)))
    return losses


def _collect(
    actor: MLPModel | None, env: RslEnv, task: StyleTask, rng: np.random.Generator, steps: int
) -> list[Example]:
    """Collect examples while an actor, or without one their motions, move the robots."""
    examples = []
    for _ in range(steps):
        outputs, known = find_outputs(env.env, task)
        observed = env.get_observations()["policy"]
        rows = torch.from_numpy(np.flatnonzero(known))
        wanted = torch.as_tensor(outputs, dtype=torch.float32, device=observed.device)
        examples.append(Example(observed[rows], wanted[rows]))
        if actor is None:
            moved = torch.as_tensor(outputs + rng.normal(0.0, NOISE, outputs.shape))
        else:
            with torch.no_grad():
                moved = actor(env.get_observations())
        env.step(moved)
    return examples


def find_outputs(env: GetUpEnv, task: StyleTask) -> tuple[Array, NDArray[np.bool_]]:
    """Find outputs (N, m) that lead to the next targets of motions; which are known, is (N,)."""
    share = (task.tracker.time + env.step_time) / task.tracker.duration
    target = task.library.interpolate_targets(task.row, share)
    known = task.library.is_planned[task.row]
    target = np.where(known[:, None], target, env.robot.standing.joint_pos)
    tracker = task.tracker
    return task.head.invert(target, env.memory, tracker.wanted, tracker.features), known


def _fit(
    actor: MLPModel, examples: list[Example], optimizer: torch.optim.Optimizer, rate: float
) -> float:
    """Fit an actor to examples; return the mean loss of the last epoch."""
    for group in optimizer.param_groups:
        group["lr"] = rate
    observed = torch.cat([example.observation for example in examples])
    outputs = torch.cat([example.outputs for example in examples])
    total = 0.0
    for _ in range(EPOCHS):
        total = 0.0
        for rows in torch.randperm(len(observed)).split(BATCH):
            seen = TensorDict({"policy": observed[rows]}, batch_size=[len(rows)])
            loss = (actor(seen) - outputs[rows]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += float(loss.detach()) * len(rows)
    return total / len(observed)
