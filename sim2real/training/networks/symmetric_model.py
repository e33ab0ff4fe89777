"""A network that is symmetric by construction: a mirrored robot acts as the mirror image."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import torch
from rsl_rl.models import MLPModel
from rsl_rl.utils import resolve_nn_activation
from torch import nn

from humanoid_getup.policy.observation import Mirror

Exchange = tuple[list[int], list[float]]
"""A `Mirror` as plain lists, for rsl-rl's configuration."""
ROOT = math.sqrt(0.5)


def as_exchange(mirror: Mirror) -> Exchange:
    """Write a mirror as plain lists."""
    return mirror.index.tolist(), mirror.sign.tolist()


class SymmetricModel(MLPModel):
    """rsl-rl's network with layers whose outputs exchange left and right with their inputs.

    Appended mirror images of observations lead to symmetry only after a while, and they drive a
    policy of small deviation that is not symmetric yet in opposite directions.
    """

    def __init__(
        self,
        *args: Any,
        inputs: Exchange,
        outputs: Exchange,
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

    def __init__(self, normalizer: Any, inputs: Exchange) -> None:
        super().__init__()
        self.normalizer = normalizer
        self.register_buffer("index", torch.tensor(inputs[0]))
        self.register_buffer("sign", torch.tensor(inputs[1], dtype=torch.float32))

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
        self, inputs: Exchange, outputs: Exchange, hidden: list[int], activation: str = "elu"
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


def split(exchange: Exchange) -> tuple[torch.Tensor, torch.Tensor]:
    """Find orthonormal combinations that an exchange keeps, (p, d), and those that it negates.

    The sign of the latter, (q, d), is changed; p and q add up to d.
    """
    kept, turned = [], []
    for i, (j, sign) in enumerate(zip(*exchange, strict=True)):
        row = torch.zeros(len(exchange[0]))
        if i == j:
            row[i] = 1.0
            (kept if sign > 0.0 else turned).append(row)
        elif i < j:
            for combinations, other in ((kept, sign), (turned, -sign)):
                row = torch.zeros(len(exchange[0]))
                row[i], row[j] = ROOT, other * ROOT
                combinations.append(row)
    empty = torch.zeros(0, len(exchange[0]))
    return tuple(torch.stack(rows) if rows else empty for rows in (kept, turned))  # pyright: ignore[reportReturnType]


def _make_layers(sizes: list[int]) -> nn.ModuleList:
    return nn.ModuleList(nn.Linear(a, b) for a, b in pairwise(sizes) if b)
