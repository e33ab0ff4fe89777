"""Widening: a trained policy learns to move more, beginning from what it can already do."""

from __future__ import annotations

import math
from typing import Any

import torch

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import Term

LAST_ACTION = "last_action"
FIRST_STD = 0.3  # of numbers that are new in an action

Weights = dict[str, torch.Tensor]


class WideningError(ValueError):
    """A policy cannot become another one; the message tells why."""


def widen(
    checkpoint: dict[str, Any],
    terms: tuple[Term, ...],
    before: tuple[str, ...],
    action: ActionSpec,
) -> dict[str, Any]:
    """Let actor and critic see and give more numbers than they learned with.

    What is new has no weight yet: the widened policy does what it did before, and tries the
    new numbers by chance.

    Args:
        checkpoint: With actor_state_dict and critic_state_dict.
        terms: Parts of the observation that the widened policy sees.
        before: Names of the numbers of the actions that it learned with.
        action: What the widened policy's actions mean; its first numbers are the old ones.

    Raises:
        WideningError: if the old actions are not the first of the new ones.
    """
    if action.names[: len(before)] != before:
        raise WideningError(
            f"actions {', '.join(action.names)} do not begin with {', '.join(before)}"
        )
    more = action.size - len(before)
    names = [term.name for term in terms]
    at = sum(term.size for term in terms[: names.index(LAST_ACTION)]) + len(before)
    actor = _widen_input(checkpoint["actor_state_dict"], at, more)
    return {
        "actor_state_dict": _widen_output(actor, more),
        "critic_state_dict": _widen_input(checkpoint["critic_state_dict"], at, more),
    }


def _widen_input(state: Weights, at: int, more: int) -> Weights:
    """Insert ``more`` inputs without weight at a place."""
    state = dict(state)
    first = "mlp.0.weight"
    state[first] = _insert(state[first], at, torch.zeros(len(state[first]), more))
    for name, value in (("_mean", 0.0), ("_var", 1.0), ("_std", 1.0)):
        key = f"obs_normalizer.{name}"
        state[key] = _insert(state[key], at, torch.full((1, more), value))
    return state


def _widen_output(state: Weights, more: int) -> Weights:
    """Append ``more`` outputs without weight, tried with a small deviation."""
    state = dict(state)
    last = max(
        (key for key in state if key.startswith("mlp.") and key.endswith(".weight")),
        key=lambda key: int(key.split(".")[1]),
    ).removesuffix(".weight")
    weight, bias = f"{last}.weight", f"{last}.bias"
    state[weight] = torch.cat((state[weight], torch.zeros(more, state[weight].shape[1])))
    state[bias] = torch.cat((state[bias], torch.zeros(more)))
    deviation = "distribution.log_std_param"
    state[deviation] = torch.cat((state[deviation], torch.full((more,), math.log(FIRST_STD))))
    return state


def _insert(values: torch.Tensor, at: int, new: torch.Tensor) -> torch.Tensor:
    return torch.cat((values[:, :at], new, values[:, at:]), dim=1)
