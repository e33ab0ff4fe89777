"""A network that is symmetric by construction: a mirrored robot acts as the mirror image."""

from __future__ import annotations

from typing import Any

import torch
from rsl_rl.models import MLPModel
from torch import nn

from humanoid_getup.policy.observation import Mirror

Exchange = tuple[list[int], list[float]]
"""A `Mirror` as plain lists, for rsl-rl's configuration."""


def as_exchange(mirror: Mirror) -> Exchange:
    """Write a mirror as plain lists."""
    return mirror.index.tolist(), mirror.sign.tolist()


class SymmetricModel(MLPModel):
    """rsl-rl's network, averaged with the mirror image of what it yields for the mirror image.

    Appended mirror images of observations would teach the same only after a while, and a policy
    of small deviation that is not symmetric yet would be torn apart by them.
    """

    def __init__(self, *args: Any, inputs: Exchange, outputs: Exchange, **kwargs: Any) -> None:
        """Build the network from the exchanges of left and right in inputs and outputs."""
        super().__init__(*args, **kwargs)
        self.obs_normalizer = BothSides(self.obs_normalizer, inputs)
        self.mlp = Averaged(self.mlp, outputs)


class BothSides(nn.Module):
    """Normalizes observations (N, d) and their mirror images, side by side, (N, 2 d)."""

    def __init__(self, normalizer: Any, inputs: Exchange) -> None:
        super().__init__()
        self.normalizer = normalizer
        self.register_buffer("index", torch.tensor(inputs[0]))
        self.register_buffer("sign", torch.tensor(inputs[1], dtype=torch.float32))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Normalize both sides."""
        return torch.cat([self.normalizer(x), self.normalizer(self._mirror(x))], dim=-1)

    def update(self, x: torch.Tensor) -> None:
        """Update the statistics by observations and their mirror images."""
        self.normalizer.update(torch.cat([x, self._mirror(x)]))

    def freeze(self) -> None:
        """Keep the statistics as they are."""
        self.normalizer.until = 1

    def _mirror(self, x: torch.Tensor) -> torch.Tensor:
        buffers: Any = self
        return x[:, buffers.index] * buffers.sign


class Averaged(nn.Module):
    """Averages what a network yields for each side."""

    def __init__(self, network: nn.Module, outputs: Exchange) -> None:
        super().__init__()
        self.network = network
        self.register_buffer("index", torch.tensor(outputs[0]))
        self.register_buffer("sign", torch.tensor(outputs[1], dtype=torch.float32))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Map both sides, (N, 2 d), to outputs (N, k)."""
        own, other = x.chunk(2, dim=-1)
        buffers: Any = self
        mirrored = self.network(other)[:, buffers.index] * buffers.sign
        return 0.5 * (self.network(own) + mirrored)
