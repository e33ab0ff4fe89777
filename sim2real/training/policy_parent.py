"""A policy file as the parent of a training: its actor, read back from the graph."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import onnx
import torch
from onnx import numpy_helper

from humanoid_getup.policy.contract import ContractError, PolicyContract
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, NetworkError, read_model
from humanoid_getup.policy.onnx_policy import SUFFIX
from robots import Robot
from sim2real.training.config import TrainingFolderError

LAYERS = "actor.mlp.network."
MEAN = "actor.obs_normalizer.normalizer._mean"


def is_policy_file(parent: Path) -> bool:
    """Return whether a parent is a policy file, not the folder of a training."""
    return parent.suffix == SUFFIX


def read_contract(file: Path, robot: Robot) -> PolicyContract:
    """Read the contract of a policy of this robot that follows style curves.

    Raises:
        OSError: if the file cannot be read.
        TrainingFolderError: if it is no such policy.
    """
    try:
        model = onnx.load_model_from_string(read_model(file))
        properties = {entry.key: entry.value for entry in model.metadata_props}
        contract = PolicyContract.from_json(properties[CONTRACT_KEY])
    except (NetworkError, ContractError, ValueError) as error:
        raise TrainingFolderError(f"{file} is not a policy: {error}") from error
    if contract.style is None:
        raise TrainingFolderError(
            f"{file} follows no style curves, expected a policy that does, or the folder of a "
            "training"
        )
    faults = contract.find_mismatches(robot, robot.control_period)
    if faults:
        raise TrainingFolderError(f"{file}: {'; '.join(faults)}")
    return contract


def read_actor(file: Path, actor: Any) -> dict[str, torch.Tensor]:
    """Read the weights of a policy with style curves as the state of a symmetric actor.

    What a graph does not hold, the deviation of exploration, is that of ``actor``.

    Raises:
        OSError: if the file cannot be read.
        TrainingFolderError: if the networks differ.
    """
    model = onnx.load_model_from_string(read_model(file))
    found = {
        entry.name: torch.tensor(numpy_helper.to_array(entry)) for entry in model.graph.initializer
    }
    state = dict(actor.state_dict())
    read = {
        f"mlp.network.{name.removeprefix(LAYERS)}": values
        for name, values in found.items()
        if name.startswith(LAYERS)
    }
    mean = found.get(MEAN)
    scales = [v for name, v in found.items() if mean is not None and v.shape == mean.shape]
    shapes = {name: tuple(values.shape) for name, values in read.items()}
    wanted = {name: tuple(state[name].shape) for name in state if name.startswith("mlp.network")}
    if mean is None or len(scales) != 2 or shapes != wanted:
        raise TrainingFolderError(f"{file} has another network than this recipe")
    (scale,) = (v for name, v in found.items() if v.shape == mean.shape and name != MEAN)
    normalizer = "obs_normalizer.normalizer."
    std = scale - actor.obs_normalizer.normalizer.eps
    return (
        state
        | read
        | {
            f"{normalizer}_mean": mean,
            f"{normalizer}_std": std,
            f"{normalizer}_var": std.square(),
            f"{normalizer}count": torch.ones_like(state[f"{normalizer}count"]),
        }
    )
