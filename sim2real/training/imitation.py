"""Imitation: before it explores, a policy learns what planned motions do.

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

STEPS = 200  # policy steps of each part
PARTS = 3  # the motions replayed, then the policy twice
EPOCHS = 8
BATCH = 2048
LEARNING_RATE = 1e-3
NOISE = 0.1  # of the outputs while motions are replayed


@dataclass(frozen=True)
class Example:
    """What N robots observe, and what they should do."""

    observation: torch.Tensor
    outputs: torch.Tensor


def imitate(actor: MLPModel, env: RslEnv, rng: np.random.Generator) -> list[float]:
    """Let an actor imitate the motions of an environment; return the final loss of each part."""
    task = env.env.style
    if task is None:
        raise ValueError("rises are imitated along style curves, expected an environment with them")
    examples: list[Example] = []
    losses = []
    optimizer = torch.optim.Adam(actor.mlp.parameters(), lr=LEARNING_RATE)
    for part in range(PARTS):
        examples += _collect(actor, env, task, rng, is_replayed=part == 0)
        losses.append(_fit(actor, env, examples, optimizer, is_first=part == 0))
    return losses


def _collect(
    actor: MLPModel,
    env: RslEnv,
    task: StyleTask,
    rng: np.random.Generator,
    *,
    is_replayed: bool,
) -> list[Example]:
    examples = []
    for _ in range(STEPS):
        outputs, known = find_outputs(env.env, task)
        observed = env.get_observations()["policy"]
        rows = torch.from_numpy(np.flatnonzero(known))
        wanted = torch.as_tensor(outputs, dtype=torch.float32)
        examples.append(Example(observed[rows], wanted[rows]))
        if is_replayed:
            moved = torch.as_tensor(outputs + rng.normal(0.0, NOISE, outputs.shape))
        else:
            with torch.no_grad():
                moved = actor(env.get_observations())
        env.step(moved)
    return examples


def find_outputs(env: GetUpEnv, task: StyleTask) -> tuple[Array, NDArray[np.bool_]]:
    """Find the outputs (N, m) that lead to the next targets of each robot's motion.

    Only some curves are those of a motion whose targets are known: which, is (N,).
    """
    share = (task.guide.time + env.step_time) / task.guide.duration
    target = task.library.interpolate_targets(task.row, share)
    known = task.library.is_planned[task.row]
    target = np.where(known[:, None], target, env.robot.standing.joint_pos)
    guide = task.guide
    return task.head.invert(target, env.memory, guide.wanted, guide.features), known


def _fit(
    actor: MLPModel,
    env: RslEnv,
    examples: list[Example],
    optimizer: torch.optim.Optimizer,
    *,
    is_first: bool,
) -> float:
    observed = torch.cat([example.observation for example in examples])
    outputs = torch.cat([example.outputs for example in examples])
    if is_first:
        actor.update_normalization(TensorDict({"policy": observed}, batch_size=[len(observed)]))
    total = 0.0
    for _ in range(EPOCHS):
        total = 0.0
        for rows in torch.randperm(len(observed)).split(BATCH):
            seen = TensorDict({"policy": observed[rows]}, batch_size=[len(rows)])
            wanted = outputs[rows]
            if torch.rand(()) < 0.5:  # of half of the batches the mirror image
                index, sign = env.mirrors["policy"]
                seen = TensorDict({"policy": observed[rows][:, index] * sign}, [len(rows)])
                index, sign = env.action_mirror
                wanted = wanted[:, index] * sign
            loss = (actor(seen) - wanted).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += float(loss.detach()) * len(rows)
    return total / len(observed)
