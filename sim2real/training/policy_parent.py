"""A policy file as the parent of a training: its actor, read back from the graph."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, read_model
from humanoid_getup.policy.onnx_policy import SUFFIX
from robots import Robot
from robots.quaternion import Array
from sim2real.pose_prior import PosePrior
from sim2real.training.config import Recipe
from sim2real.training.networks import list_prior_arrays

LAYERS = re.compile(r"mlp\.(kept|turned)\.\d+\.weight|mlp\.kept\.\d+\.bias|mlp\.\d+\.(weight|bias)")
MEAN, ACTOR = "_mean", "actor."


def is_policy_file(parent: Path) -> bool:
    """Return whether a parent is a policy file, not the folder of a training."""
    return parent.suffix == SUFFIX


def check_policy_parent(file: Path, robot: Robot, recipe: Recipe) -> None:
    """Check that a policy of this robot, with or without style curves, can begin a training."""
    try:
        model = onnx.load_model_from_string(read_model(file))
        properties = {entry.key: entry.value for entry in model.metadata_props}
        contract = PolicyContract.from_json(properties[CONTRACT_KEY])
    except ValueError as error:
        raise ValueError(f"{file} is not a policy: {error}") from error
    if recipe.style is not None and contract.style is None:
        raise ValueError(
            f"{file} follows no style curves, expected a policy that does, or the folder of a "
            "training"
        )
    if recipe.style is None and contract.style is not None:
        raise ValueError(f"{file} follows style curves, expected a policy that does not")
    problems = contract.find_mismatches(robot, robot.control_period)
    weights = _read_weights(file)
    bad = [name for name, values in weights.items() if not np.isfinite(values).all()]
    problems += [f"its network holds NaN or infinity in {bad[0]}"] if bad else []
    own = recipe.choose_actions(robot).names
    if contract.action.names != own:
        problems.append(f"it has actions {', '.join(contract.action.names)}; expected {own}")
    if problems:
        raise ValueError(f"{file}: {'; '.join(problems)}")


def check_decoder(file: Path, prior: PosePrior) -> None:
    """Check that the decoder of a policy, with its statistics, is that of a pose prior."""
    found = _read_weights(file)
    for name, values in list_prior_arrays(prior).items():
        # Exporting drops biases of zero; of arrays that are equal it keeps one, under either name.
        held = [found[name]] if name in found else [np.zeros_like(values), *found.values()]
        if any(np.array_equal(values, other) for other in held):
            continue
        raise ValueError(
            f"{file} was trained with another prior, expected --prior with the one that is beside "
            "it, or with which it was trained"
        )


def read_actor(file: Path, actor: Any) -> dict[str, torch.Tensor]:
    """Read the weights of a policy as the state of an actor.

    What a graph does not hold, the deviation of exploration, is that of ``actor``.
    """
    found = {name: torch.tensor(values) for name, values in _read_weights(file).items()}
    state = dict(actor.state_dict())
    expected = {name: values.shape for name, values in state.items() if LAYERS.fullmatch(name)}
    prefix = ACTOR if any(name.startswith(ACTOR) for name in found) else ""  # with a decoder
    read = {name: found.get(f"{prefix}{name}", torch.zeros(0)) for name in expected}
    normalizer = next(name.removesuffix(MEAN) for name in state if name.endswith(f"r.{MEAN}"))
    # Exporting has added a small number to the deviations and named the sum by itself.
    name_of_mean = f"{prefix}{normalizer}{MEAN}"
    mean = found.get(name_of_mean, torch.zeros(0))
    sums = [v for name, v in found.items() if name != name_of_mean and v.shape == mean.shape]
    if {name: values.shape for name, values in read.items()} != expected or len(sums) != 1:
        raise ValueError(f"{file} has another network than the recipe")
    std = sums[0] - actor.get_submodule(normalizer.removesuffix(".")).eps
    statistics = {
        MEAN: mean,
        "_std": std,
        "_var": std.square(),
        "count": torch.ones((), dtype=torch.long),
    }
    return state | read | {f"{normalizer}{name}": values for name, values in statistics.items()}


def _read_weights(file: Path) -> dict[str, Array]:
    model = onnx.load_model_from_string(read_model(file))
    return {entry.name: numpy_helper.to_array(entry) for entry in model.graph.initializer}
