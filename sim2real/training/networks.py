"""Networks of policies: symmetric by construction, extended, and with a decoder as one graph."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from rsl_rl.models import MLPModel
from rsl_rl.utils import resolve_nn_activation
from torch import nn

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import UPRIGHT, Mirror, Term
from robots.quaternion import Array
from sim2real.environment.action_heads import (
    BEGIN,
    FILTER_SHARE,
    FULL,
    GAINS,
    LARGEST,
    LEAST_SCALE,
    MOST_OUTPUT,
    OFFSET_SCALE,
    STANCE_ANGLE,
    STANCE_HEIGHT,
    AnkleBalance,
)
from sim2real.pose_prior import Network, PosePrior

ROOT = math.sqrt(0.5)


class SymmetricModel(MLPModel):
    """rsl-rl's network with layers whose outputs exchange left and right with their inputs.

    Appended mirror images of observations lead to symmetry only after a while, and they drive a
    policy of small deviation that is not symmetric yet in opposite directions.
    """

    def __init__(
        self,
        *args: Any,
        inputs: Mirror,
        outputs: Mirror,
        hidden_dims: list[int],
        activation: str = "elu",
        **kwargs: Any,
    ) -> None:
        """Build the network from the exchanges of left and right in inputs and outputs."""
        super().__init__(*args, hidden_dims=hidden_dims, activation=activation, **kwargs)
        self.obs_normalizer = MirroredNormalizer(self.obs_normalizer, inputs)
        self.mlp = SymmetricNetwork(inputs, outputs, hidden_dims, activation)


class MirroredNormalizer(nn.Module):
    """Normalizes observations by statistics of them and of their mirror images."""

    index: torch.Tensor
    sign: torch.Tensor

    def __init__(self, normalizer: Any, inputs: Mirror) -> None:
        super().__init__()
        self.normalizer = normalizer
        self.register_buffer("index", torch.tensor(inputs.index))
        self.register_buffer("sign", torch.tensor(inputs.sign, dtype=torch.float32))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Normalize observations (N, d)."""
        return self.normalizer(x)

    def update(self, x: torch.Tensor) -> None:
        """Update the statistics by observations and their mirror images."""
        self.normalizer.update(torch.cat([x, x[:, self.index] * self.sign]))

    @property
    def until(self) -> int | None:
        """Number of observations after which the statistics are kept; ``None`` for never."""
        return self.normalizer.until

    @until.setter
    def until(self, count: int) -> None:
        self.normalizer.until = count


class SymmetricNetwork(nn.Module):
    """Fully connected layers that commute with the exchange of left and right.

    Values that the exchange keeps, and those whose sign it changes, have layers of their own. The
    units of a hidden layer are pairs that it exchanges, so that their activation keeps the symmetry
    ([Cohen16], regular representations). For as many units, that is a quarter of the work of
    averaging a network with its mirror image.
    """

    inputs_kept: torch.Tensor
    inputs_turned: torch.Tensor
    outputs_kept: torch.Tensor
    outputs_turned: torch.Tensor

    def __init__(
        self, inputs: Mirror, outputs: Mirror, hidden: list[int], activation: str = "elu"
    ) -> None:
        """Build the layers; their hidden units are even numbers."""
        super().__init__()
        if any(units % 2 for units in hidden):
            raise ValueError(f"hidden layers have {hidden} units, expected pairs")
        self.activation = resolve_nn_activation(activation)
        for name, (kept, turned) in (("inputs", split(inputs)), ("outputs", split(outputs))):
            self.register_buffer(f"{name}_kept", kept)
            self.register_buffer(f"{name}_turned", turned)
        pairs = [units // 2 for units in hidden]
        self.kept = _make_layers([len(self.inputs_kept), *pairs, len(self.outputs_kept)])
        self.turned = _make_layers([len(self.inputs_turned), *pairs, len(self.outputs_turned)])
        for layer in self.turned:
            bias: Any = layer.bias
            nn.init.zeros_(bias).requires_grad_(False)  # of what changes its sign

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Map inputs (N, d) to outputs (N, k)."""
        kept, turned = x @ self.inputs_kept.T, x @ self.inputs_turned.T
        for keep, turn in zip(self.kept[:-1], self.turned, strict=False):
            own, other = keep(kept), turn(turned)
            left = self.activation(ROOT * (own + other))
            right = self.activation(ROOT * (own - other))
            kept, turned = ROOT * (left + right), ROOT * (left - right)
        found = self.kept[-1](kept) @ self.outputs_kept
        if not len(self.outputs_turned):
            return found
        return found + self.turned[-1](turned) @ self.outputs_turned


def split(mirror: Mirror) -> tuple[torch.Tensor, torch.Tensor]:
    """Find orthonormal combinations that an exchange keeps, (p, d), and those that it negates.

    The sign of the latter, (q, d), is changed; p and q add up to d.
    """
    kept, turned = [], []
    for i, (j, sign) in enumerate(zip(mirror.index, mirror.sign, strict=True)):
        row = torch.zeros(len(mirror.index))
        if i == j:
            row[i] = 1.0
            (kept if sign > 0.0 else turned).append(row)
        elif i < j:
            for combinations, other in ((kept, sign), (turned, -sign)):
                row = torch.zeros(len(mirror.index))
                row[i], row[j] = ROOT, other * ROOT
                combinations.append(row)
    empty = torch.zeros(0, len(mirror.index))
    return tuple(torch.stack(rows) if rows else empty for rows in (kept, turned))  # pyright: ignore[reportReturnType]


def _make_layers(sizes: list[int]) -> nn.ModuleList:
    return nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes) if b)


FEATURE_SIGN = torch.tensor([1.0, -1.0, 1.0])  # of features counted from upright, mirrored


class StyledNetwork(nn.Module):
    """Maps observations to actions and to the memory, as `PriorHead` does with an actor."""

    if TYPE_CHECKING:  # buffers, which are registered by their names

        def __getattr__(self, name: str) -> torch.Tensor: ...

    def __init__(
        self, actor: nn.Module, terms: tuple[Term, ...], action: ActionSpec, prior: PosePrior
    ) -> None:
        """Join an actor with the decoder of its pose prior."""
        super().__init__()
        self.actor, self.size = actor, prior.size
        ends = np.cumsum([0, *(term.size for term in terms)])
        starts = {term.name: int(start) for term, start in zip(terms, ends, strict=False)}
        first = starts["last_action"]
        self.memory = slice(first, first + prior.size + prior.robot.n)
        self.wanted = slice(starts["style_targets"], starts["style_targets"] + len(UPRIGHT))
        first = starts["style_features"]
        self.measured = slice(first, first + len(UPRIGHT))
        self.decoder = _build(prior.decoder)
        self.mirror_index = prior.robot.mirror_index.tolist()
        buffers = {
            **_list_statistics(prior),
            "mirror_sign": prior.robot.mirror_sign,
            "standing": np.array([1.0, 0.0, 0.0]),
            "stance_range": np.array([STANCE_HEIGHT, STANCE_ANGLE, STANCE_ANGLE]),
            "ankles": AnkleBalance(prior.robot).ankles,
            "gains": GAINS,
            "home": action.home,
            "scale": action.scale,
        }
        for name, values in buffers.items():
            self.register_buffer(name, torch.tensor(np.asarray(values), dtype=torch.float32))
        self.register_buffer("feature_sign", FEATURE_SIGN)

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Map observations (N, size) to actions (N, n) and memory (N, m)."""
        outputs = self.actor(x).clamp(-MOST_OUTPUT, MOST_OUTPUT)
        memory = FILTER_SHARE * outputs + (1.0 - FILTER_SHARE) * x[:, self.memory]
        distance = (x[:, self.measured] - self.standing).abs() / self.stance_range
        scaled = memory * distance.amax(dim=1, keepdim=True).clamp(LEAST_SCALE, 1.0)
        latent, wanted = scaled[:, : self.size], x[:, self.wanted]
        turned = self._decode(latent * self.latent_sign, wanted * self.feature_sign)
        mirrored = turned[:, self.mirror_index] * self.mirror_sign
        pos = 0.5 * (self._decode(latent, wanted) + mirrored)
        pos = pos + OFFSET_SCALE * scaled[:, self.size :] + self._balance(x)
        return (pos - self.home) / self.scale, memory

    def _balance(self, x: torch.Tensor) -> torch.Tensor:
        """Compute the correction of `AnkleBalance` to the joint targets."""
        measured = x[:, self.measured]
        share = ((measured[:, :1] - BEGIN) / (FULL - BEGIN)).clamp(0.0, 1.0)
        error = (x[:, self.wanted] - measured)[:, 1:]
        return share * (self.gains * error).clamp(-LARGEST, LARGEST) @ self.ankles

    def _decode(self, latent: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
        condition = (wanted - self.feature_mean) / self.feature_std
        x = torch.cat([latent * self.latent_std + self.latent_mean, condition], dim=-1)
        return self.decoder(x) * self.pos_std + self.pos_mean


def list_prior_arrays(prior: PosePrior) -> dict[str, Array]:
    """List the arrays of a pose prior that a graph holds, by name, in single precision."""
    arrays = dict(_list_statistics(prior))
    layers = zip(prior.decoder.weights, prior.decoder.biases, strict=True)
    for number, (weight, bias) in enumerate(layers):
        name = f"decoder.{2 * number}"  # there is an activation after each layer
        arrays |= {f"{name}.weight": weight, f"{name}.bias": bias}
    single: Any = {name: values.astype(np.float32) for name, values in arrays.items()}
    return single


def _list_statistics(prior: PosePrior) -> dict[str, Array]:
    return {
        "latent_sign": prior.latent_sign,
        "latent_mean": prior.latent_mean,
        "latent_std": prior.latent_std,
        "pos_mean": prior.pos_mean,
        "pos_std": prior.pos_std,
        "feature_mean": prior.feature_mean - UPRIGHT,
        "feature_std": prior.feature_std,
    }


def _build(network: Network) -> nn.Sequential:
    layers: list[nn.Module] = []
    for weight, bias in zip(network.weights, network.biases, strict=True):
        layer = nn.Linear(weight.shape[1], weight.shape[0])
        layer.weight.data, layer.bias.data = _tensor(weight), _tensor(bias)
        layers += [layer, nn.Tanh()]
    return nn.Sequential(*layers[:-1])


def _tensor(values: Array) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float32)


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
