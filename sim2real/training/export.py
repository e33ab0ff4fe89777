"""Export: a trained policy as one ONNX file, its normalizer and its contract inside."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from rsl_rl.models import MLPModel
from tensordict import TensorDict

from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.observation import StyleInput, list_terms, mirror_of_observation
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, OnnxNetwork, seal_model
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError
from robots import Robot
from robots.storage.files import atomic_path
from sim2real.environment.action_heads import PriorHead
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.config import TrainingRecord
from sim2real.training.networks import MirroredNormalizer, StyledNetwork, SymmetricModel
from sim2real.training.ppo import AVERAGE
from sim2real.training.runner import Mirrors, build_config

OPSET = 18
SAMPLES = 1000  # observations on which torch and onnxruntime must agree
PARITY = 1e-5  # largest difference of an action, whose components are from -1 to 1
MOST_BYTES = 2_000_000


@dataclass(frozen=True)
class Exported:
    """Figures of an export."""

    size: int
    """Size of the file [bytes]."""
    iterations: int
    """Iterations of the training."""
    difference: float
    """Largest difference between the actions of torch and of onnxruntime."""


def export_policy(training: TrainingRecord, robot: Robot, file: Path) -> Exported:
    """Write the policy of a training's checkpoint to a file, if all checks pass."""
    action = training.recipe.choose_actions(robot)
    is_other = training.robot != robot.name
    recipe = training.recipe.style
    head = PriorHead.load(robot, action, training.folder) if recipe and not is_other else None
    outputs = head.names if head else action.names
    if is_other or training.actions != outputs:
        raise ValueError(
            f"{training.folder}: trained for robot '{training.robot}' with actions "
            f"{', '.join(training.actions)}; expected '{robot.name}' with {', '.join(outputs)}"
        )
    checkpoint = read_checkpoint(training.folder / CHECKPOINT)
    style = None
    if recipe is not None:
        style = StyleInput(memory=len(outputs), height_map=recipe.height_map)
    terms = list_terms(robot, action, style)
    mirrors = None
    if head is not None:
        seen = mirror_of_observation(robot, head.mirror, style)
        mirrors = (seen, seen, head.mirror)  # that of the critic, which is not rebuilt, is any
    size = sum(term.size for term in terms)
    actor = rebuild_actor(training, size, len(outputs), checkpoint[AVERAGE], mirrors)
    network: Any = actor.as_onnx(verbose=False).to("cpu")
    if head is not None:
        network = StyledNetwork(network, terms, action, head.prior)
    iterations = int(checkpoint["iter"]) + 1
    provenance = training.provenance | {"iterations": iterations}
    contract = PolicyContract.of(robot, action, robot.control_period, provenance, style)
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_path(file) as partial:
        _write(network.eval(), size, contract, partial)
        difference = _compare(network, _sample_observations(actor), partial, robot)
        bytes_written = partial.stat().st_size
        if bytes_written > MOST_BYTES:
            too_large = f"the policy has {bytes_written} bytes, expected at most {MOST_BYTES}"
            raise ValueError(too_large)
    return Exported(bytes_written, iterations, difference)


def rebuild_actor(
    training: TrainingRecord,
    observation_size: int,
    action_size: int,
    weights: dict[str, Any],
    mirrors: Mirrors | None = None,
) -> MLPModel:
    """Build the trained actor without its environment."""
    config = build_config(training.recipe, training.seed, mirrors)
    actor_config = {key: value for key, value in config["actor"].items() if key != "class_name"}
    example = TensorDict({"policy": torch.zeros(1, observation_size)}, batch_size=[1])
    model = SymmetricModel if mirrors else MLPModel
    actor = model(example, config["obs_groups"], "actor", action_size, **actor_config)
    file = training.folder / CHECKPOINT
    try:
        actor.load_state_dict(weights)
    except RuntimeError as error:
        reason = " ".join(str(error).split())
        raise ValueError(f"{file} does not fit robot and recipe: {reason}") from error
    bad = [name for name, value in actor.state_dict().items() if not torch.isfinite(value).all()]
    if bad:
        raise ValueError(f"{file} holds NaN or infinity: {', '.join(bad)}")
    return actor.eval()


def _write(network: Any, size: int, contract: PolicyContract, file: Path) -> None:
    with _quiet():
        torch.onnx.export(
            network,
            (torch.zeros(2, size),),  # a batch of one would fix the batch size
            str(file),
            opset_version=OPSET,
            input_names=["obs"],
            output_names=["actions", "memory"] if contract.style else ["actions"],
            dynamic_shapes={"x": {0: torch.export.Dim("robots")}},
            external_data=False,
            dynamo=True,
        )
    model = onnx.load(str(file))
    for node in model.graph.node:
        node.ClearField("metadata_props")  # stack traces that contain local paths
    onnx.helper.set_model_props(model, {CONTRACT_KEY: contract.to_json()})
    file.write_bytes(seal_model(model.SerializeToString()))


def _sample_observations(actor: MLPModel) -> torch.Tensor:
    """Draw observations from the actor's own statistics, (N, size)."""
    normalizer: Any = actor.obs_normalizer
    if isinstance(normalizer, MirroredNormalizer):
        normalizer = normalizer.normalizer
    noise = torch.randn(SAMPLES, actor.obs_dim, generator=torch.Generator().manual_seed(0))
    return normalizer.mean + noise * normalizer.std


def _compare(network: Any, seen: torch.Tensor, file: Path, robot: Robot) -> float:
    """Compare the file with its network; return the largest difference of actions and memory."""
    with torch.no_grad():
        found = network(seen)
    wanted = [values.numpy() for values in (found if isinstance(found, tuple) else (found,))]
    try:
        OnnxPolicy.load(file, robot, robot.control_period)
    except PolicyError as error:
        raise ValueError(f"the written policy cannot be run: {error}") from error
    given = OnnxNetwork(file)(seen.numpy())
    pairs = zip(given, wanted, strict=False)  # a network without memory has no second output
    difference = max(float(np.abs(one - other).max()) for one, other in pairs)
    if not difference <= PARITY:
        raise ValueError(
            f"torch and onnxruntime differ by {difference:.1e}, expected at most {PARITY:.0e}"
        )
    return difference


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the exporter's progress messages."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with redirect_stdout(StringIO()), warnings.catch_warnings(action="ignore"):
            yield
    finally:
        logger.setLevel(level)
