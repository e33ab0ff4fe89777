"""Fits the pose prior: the conditional variational autoencoder of [Frezzato22], section 3.5."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from humanoid_getup.style.features import COUNT
from robots import Robot
from robots.quaternion import Array
from sim2real.pose_prior import Network, PosePrior, RiseSet
from sim2real.training.library_threads import torch_threads

VARIANCE = 0.85  # share of the postures' variance that the latent parameters account for


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """Hyperparameters; the defaults are those of [Frezzato22], section 3.5."""

    hidden: int = 256
    epochs: int = 100
    batch: int = 128
    beta: float = 1e-6
    """Weight of the divergence of the latent parameters from a standard normal distribution."""
    learning_rate: float = 1e-4


def count_latents(rises: RiseSet) -> Array:
    """Choose the latent parameters: their signs under the exchange of left and right, (k,).

    Each principal component of postures and their mirror images is symmetric or antisymmetric;
    as many are taken as account for `VARIANCE`.
    """
    away = (rises.joint_pos - rises.pos_mean) / rises.pos_std
    mirrored = rises.robot.mirror_joints(away)
    parts = [(0.5 * (away + mirrored), 1.0), (0.5 * (away - mirrored), -1.0)]
    components = [
        (float(value) ** 2, sign)
        for part, sign in parts
        for value in np.linalg.svd(part, compute_uv=False)
    ]
    components.sort(reverse=True)
    share = np.cumsum([value for value, _ in components])
    count = int(np.searchsorted(share, VARIANCE * share[-1])) + 1
    return np.array(sorted((sign for _, sign in components[:count]), reverse=True))


class Autoencoder(nn.Module):
    """An autoencoder that exchanges left and right in postures as in latent parameters.

    Everything is in standard deviations; the condition's mirror image changes one sign.
    """

    def __init__(self, robot: Robot, latent_sign: Array, options: FitOptions) -> None:
        super().__init__()
        n, k, hidden = robot.n, len(latent_sign), options.hidden
        self.encoder = _make_network(n + COUNT, hidden, 2 * k)
        self.decoder = _make_network(k + COUNT, hidden, n)
        self.latent_sign = torch.tensor(latent_sign, dtype=torch.float32)
        self.joint_sign = torch.tensor(robot.mirror_sign, dtype=torch.float32)
        self.joint_index = torch.tensor(robot.mirror_index)
        self.condition_sign = torch.tensor([1.0, -1.0, 1.0])

    def encode(self, pos: torch.Tensor, condition: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return mean and log variance of the latent parameters, (N, k) each."""
        mean, log_var = self._encode(pos, condition)
        other_mean, other_var = self._encode(self._mirror(pos), condition * self.condition_sign)
        return 0.5 * (mean + other_mean * self.latent_sign), 0.5 * (log_var + other_var)

    def decode(self, latent: torch.Tensor, condition: torch.Tensor) -> torch.Tensor:
        """Return joint angles, (N, n)."""
        pos = self.decoder(torch.cat([latent, condition], dim=-1))
        turned = torch.cat([latent * self.latent_sign, condition * self.condition_sign], dim=-1)
        return 0.5 * (pos + self._mirror(self.decoder(turned)))

    def _encode(self, pos: torch.Tensor, condition: torch.Tensor) -> tuple[torch.Tensor, ...]:
        return self.encoder(torch.cat([pos, condition], dim=-1)).chunk(2, dim=-1)

    def _mirror(self, pos: torch.Tensor) -> torch.Tensor:
        return pos[:, self.joint_index] * self.joint_sign


@torch_threads(1)
def fit_prior(
    rises: RiseSet,
    seed: int,
    options: FitOptions | None = None,
    report: Callable[[int, float], None] = lambda *_: None,
) -> PosePrior:
    """Fit a pose prior; after each epoch its number and the loss are reported.

    On one thread, which is fastest for small batches, it is the same on every machine.
    """
    options = options or FitOptions()
    generator = torch.Generator().manual_seed(seed)
    torch.manual_seed(seed)
    latent_sign = count_latents(rises)
    model = Autoencoder(rises.robot, latent_sign, options)
    pos = _scale(rises.joint_pos, rises.pos_mean, rises.pos_std)
    condition = _scale(rises.features, rises.feature_mean, rises.feature_std)
    optimizer = torch.optim.Adam(model.parameters(), lr=options.learning_rate)
    for epoch in range(options.epochs):
        total = 0.0
        for rows in torch.randperm(len(pos), generator=generator).split(options.batch):
            mean, log_var = model.encode(pos[rows], condition[rows])
            noise = torch.randn(mean.shape, generator=generator)
            latent = mean + noise * (0.5 * log_var).exp()
            error = (model.decode(latent, condition[rows]) - pos[rows]).square().mean()
            divergence = 0.5 * (mean.square() + log_var.exp() - 1.0 - log_var).sum(dim=-1).mean()
            loss = error + options.beta * divergence
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total += float(error.detach()) * len(rows)
        report(epoch, total / len(pos))
    with torch.no_grad():
        latent, _ = model.encode(pos, condition)
    # The mean over postures and their mirror images: that of antisymmetric parameters is 0.
    mean = 0.5 * (latent.mean(dim=0) * (1.0 + model.latent_sign))
    return PosePrior(
        robot=rises.robot,
        latent_sign=latent_sign,
        latent_mean=mean.numpy().astype(float),
        latent_std=(latent - mean).square().mean(dim=0).sqrt().numpy().astype(float),
        pos_mean=rises.pos_mean,
        pos_std=rises.pos_std,
        feature_mean=rises.feature_mean,
        feature_std=rises.feature_std,
        encoder=_read_weights(model.encoder),
        decoder=_read_weights(model.decoder),
    )


def _read_weights(network: nn.Sequential) -> Network:
    layers = [layer for layer in network if isinstance(layer, nn.Linear)]
    return Network(
        tuple(layer.weight.detach().numpy() for layer in layers),
        tuple(layer.bias.detach().numpy() for layer in layers),
    )


def _make_network(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, hidden),
        nn.Tanh(),
        nn.Linear(hidden, hidden),
        nn.Tanh(),
        nn.Linear(hidden, outputs),
    )


def _scale(values: Array, mean: Array, std: Array) -> torch.Tensor:
    return torch.as_tensor((values - mean) / std, dtype=torch.float32)
