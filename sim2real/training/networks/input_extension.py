"""Input extension: adds inputs of zero weight to a network."""

from __future__ import annotations

from typing import Any

import torch

from sim2real.training.networks.action_extension import insert_columns

Weights = dict[str, torch.Tensor]


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
    return state | {f"obs_normalizer.{name}": new[f"obs_normalizer.{name}"] for name in EXCHANGE}


EXCHANGE = ("index", "sign")
