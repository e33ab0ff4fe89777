"""Extension of trained networks: more action components, or more inputs, of zero weight."""

from __future__ import annotations

import math
from typing import Any

import torch

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import Term

LAST_ACTION = "last_action"
FIRST_STD = 0.3  # initial standard deviation of new action components

Weights = dict[str, torch.Tensor]


def extend_actions(
    checkpoint: dict[str, Any], terms: tuple[Term, ...], before: tuple[str, ...], action: ActionSpec
) -> dict[str, Any]:
    """Add action components to the outputs of an actor and to the inputs of actor and critic.

    New weights are zero: the extended policy behaves as before and explores the new components
    by noise alone. The components ``before`` must be the first of the new ones.
    """
    if action.names[: len(before)] != before:
        raise ValueError(f"actions {', '.join(action.names)} do not begin with {', '.join(before)}")
    more = action.size - len(before)
    names = [term.name for term in terms]
    at = sum(term.size for term in terms[: names.index(LAST_ACTION)]) + len(before)
    actor = _extend_input(checkpoint["actor_state_dict"], at, more)
    return {
        "actor_state_dict": _extend_output(actor, more),
        "critic_state_dict": _extend_input(checkpoint["critic_state_dict"], at, more),
    }


def _extend_input(state: Weights, at: int, more: int) -> Weights:
    """Insert ``more`` inputs of zero weight before input ``at``."""
    state = dict(state)
    first = "mlp.0.weight"
    state[first] = insert_columns(state[first], at, torch.zeros(len(state[first]), more))
    for name, value in (("_mean", 0.0), ("_var", 1.0), ("_std", 1.0)):
        key = f"obs_normalizer.{name}"
        state[key] = insert_columns(state[key], at, torch.full((1, more), value))
    return state


def _extend_output(state: Weights, more: int) -> Weights:
    """Append ``more`` outputs of zero weight and small standard deviation."""
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


def insert_columns(values: torch.Tensor, at: int, new: torch.Tensor) -> torch.Tensor:
    """Insert columns before column ``at``."""
    return torch.cat((values[:, :at], new.to(values), values[:, at:]), dim=1)


def extend_inputs(state: Weights, network: Any, at: int, std: float) -> Weights:
    """Insert inputs of zero weight before input ``at`` of a symmetric network's state.

    As many as ``network`` has more, whose exchange of left and right is taken as well. They are
    normalized by mean 0 and ``std``.
    """
    state, new = dict(state), network.state_dict()
    more = len(new["obs_normalizer.index"]) - len(state["obs_normalizer.index"])
    for part in ("kept", "turned"):
        weight, combinations = f"mlp.{part}.0.weight", f"mlp.inputs_{part}"
        whole = state[weight] @ state[combinations]
        whole = insert_columns(whole, at, torch.zeros(len(whole), more))
        state[weight], state[combinations] = whole @ new[combinations].T, new[combinations]
    for name, value in (("_mean", 0.0), ("_var", std**2), ("_std", std)):
        key = f"obs_normalizer.normalizer.{name}"
        state[key] = insert_columns(state[key], at, torch.full((1, more), value))
    return state | {key: new[key] for key in ("obs_normalizer.index", "obs_normalizer.sign")}
