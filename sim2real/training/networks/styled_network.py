"""The graph of a styled policy: actor, filter, decoder, offsets and balance in one network."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import nn

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.policy.observation import UPRIGHT, Term
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
from sim2real.pose_prior.pose_prior import Network, PosePrior

FEATURE_SIGN = torch.tensor([1.0, -1.0, 1.0])  # of features counted from upright, mirrored


class StyledNetwork(nn.Module):
    """Maps observations to actions and to the memory, as `PriorHead` does with an actor."""

    latent_sign: torch.Tensor
    latent_mean: torch.Tensor
    latent_std: torch.Tensor
    pos_mean: torch.Tensor
    pos_std: torch.Tensor
    feature_mean: torch.Tensor
    feature_std: torch.Tensor
    feature_sign: torch.Tensor
    mirror_sign: torch.Tensor
    standing: torch.Tensor
    stance_range: torch.Tensor
    ankles: torch.Tensor
    gains: torch.Tensor
    home: torch.Tensor
    scale: torch.Tensor

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
