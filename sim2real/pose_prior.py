"""The pose prior: a decoder from latent parameters and style targets to joint angles.

It is the conditional variational autoencoder of [Frezzato22], section 3.5, made symmetric: to
exchange left and right in the latent parameters and in the targets exchanges left and right in
the posture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.style.curves import StyleCurves, extract_curves, measure_features
from humanoid_getup.style.features import COUNT, mirror_features
from robots import Robot
from robots.quaternion import Array
from robots.storage.arrays import (
    ArchiveError,
    check_robot,
    load_arrays,
    save_arrays,
    to_numbers,
    to_text,
)
from robots.storage.validation import shown

PRIOR, RISES = "prior.npz", "rises.npz"
"""Files of a pose prior's folder, which a training keeps copies of."""
LAYERS = 3
VECTORS = (
    "latent_sign",
    "latent_mean",
    "latent_std",
    "pos_mean",
    "pos_std",
    "feature_mean",
    "feature_std",
)
NETWORKS = ("encoder", "decoder")
PARTS = [f"{n}_{part}{i}" for n in NETWORKS for i in range(LAYERS) for part in ("weight", "bias")]


@dataclass(frozen=True, eq=False)
class Network:
    """Fully connected layers with hyperbolic tangents between them."""

    weights: tuple[Array, ...]
    """Of each layer, (outputs, inputs)."""
    biases: tuple[Array, ...]
    """Of each layer, (outputs,)."""

    def __call__(self, *inputs: Array) -> Array:
        """Map the concatenated inputs, (N, ...), to outputs."""
        x = np.concatenate(inputs, axis=-1).astype(np.float32)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = np.tanh(x @ weight.T + bias)
        return x @ self.weights[-1].T + self.biases[-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class PosePrior:
    """Decodes latent parameters, which are standard normal over the postures of rises."""

    robot: Robot
    latent_sign: Array
    """Sign of each latent parameter when left and right are exchanged, (k,)."""
    latent_mean: Array
    """Mean of the encoder's output over the postures, (k,)."""
    latent_std: Array
    """Standard deviation of the same, (k,)."""
    pos_mean: Array
    """Mean joint angles [rad], (n,)."""
    pos_std: Array
    """Standard deviation of joint angles [rad], (n,)."""
    feature_mean: Array
    """Mean of the style features, (3,)."""
    feature_std: Array
    """Standard deviation of the style features, (3,)."""
    encoder: Network
    """Maps standardized postures and features to mean and log variance of latents."""
    decoder: Network
    """Maps latents and standardized features to standardized postures."""

    @property
    def size(self) -> int:
        """Return how many latent parameters there are."""
        return len(self.latent_sign)

    def decode(self, latent: Array, features: Array) -> Array:
        """Decode joint angles [rad], (N, n), from latents (N, k) and style features (N, 3)."""
        mirrored = self._decode(latent * self.latent_sign, mirror_features(features))
        return 0.5 * (self._decode(latent, features) + self.robot.mirror_joints(mirrored))

    def encode(self, joint_pos: Array, features: Array) -> Array:
        """Encode joint angles [rad], (N, n), with style features (N, 3), as latents (N, k)."""
        mirror = self.robot.mirror_joints
        mirrored = self._encode(mirror(joint_pos), mirror_features(features))
        return 0.5 * (self._encode(joint_pos, features) + mirrored * self.latent_sign)

    def _decode(self, latent: Array, features: Array) -> Array:
        pos = self.decoder(latent * self.latent_std + self.latent_mean, self._condition(features))
        return pos * self.pos_std + self.pos_mean

    def _encode(self, joint_pos: Array, features: Array) -> Array:
        pos = (joint_pos - self.pos_mean) / self.pos_std
        latent = self.encoder(pos, self._condition(features))[:, : self.size]
        return (latent - self.latent_mean) / self.latent_std

    def _condition(self, features: Array) -> Array:
        return (features - self.feature_mean) / self.feature_std

    def save(self, file: Path) -> None:
        """Write the prior to an .npz file."""
        arrays: dict[str, Any] = {key: getattr(self, key) for key in VECTORS}
        for name in NETWORKS:
            network: Network = getattr(self, name)
            for layer in range(LAYERS):
                arrays[f"{name}_weight{layer}"] = network.weights[layer]
                arrays[f"{name}_bias{layer}"] = network.biases[layer]
        names = {"robot": self.robot.name, "joints": "\n".join(self.robot.joint_names)}
        save_arrays(file, arrays | names)

    @staticmethod
    def load(file: Path, robot: Robot) -> PosePrior:
        """Read the prior of a robot; raises ValueError if the file holds none of it."""
        try:
            arrays = load_arrays(file, ("robot", "joints", *VECTORS, *PARTS))
            check_robot(arrays.pop("robot"), robot.name)
            joints = to_text(arrays.pop("joints"), "joints").split("\n")
            if tuple(joints) != robot.joint_names:
                raise ArchiveError(f"its joints are {shown(joints)}, not those of '{robot.name}'")
            return _build(robot, arrays)
        except ArchiveError as error:
            raise ValueError(
                f"{file} holds no pose prior, expected an .npz of `getup prior`: {error}"
            ) from error


def _build(robot: Robot, arrays: dict[str, Array]) -> PosePrior:
    """Check a prior's arrays."""
    k, n = arrays["latent_sign"].size, robot.n
    sizes = dict.fromkeys(VECTORS, COUNT)
    sizes |= {key: k for key in VECTORS if key.startswith("latent")}
    sizes |= {key: n for key in VECTORS if key.startswith("pos")}
    vectors = {key: to_numbers(arrays[key], key, (size,)) for key, size in sizes.items()}
    for key, values in vectors.items():
        if key.endswith("_std") and not np.all(values > 0.0):
            raise ArchiveError(f"{key} holds {values.min():g}, expected above 0")
    if not np.all(np.abs(vectors["latent_sign"]) == 1.0):
        raise ArchiveError("latent_sign holds another number than 1 and -1")
    ends = {"encoder": (n + COUNT, 2 * k), "decoder": (k + COUNT, n)}
    encoder, decoder = (_read_network(arrays, name, *ends[name]) for name in NETWORKS)
    return PosePrior(robot=robot, encoder=encoder, decoder=decoder, **vectors)


def _read_network(arrays: dict[str, Array], name: str, inputs: int, outputs: int) -> Network:
    hidden = [arrays[f"{name}_bias{layer}"].size for layer in range(LAYERS - 1)]
    sizes = [inputs, *hidden, outputs]
    pairs = [
        (
            to_numbers(arrays[f"{name}_weight{i}"], f"{name}_weight{i}", (sizes[i + 1], sizes[i])),
            to_numbers(arrays[f"{name}_bias{i}"], f"{name}_bias{i}", (sizes[i + 1],)),
        )
        for i in range(LAYERS)
    ]
    single: Any = [[a.astype(np.float32) for a in arrays] for arrays in zip(*pairs, strict=True)]
    return Network(tuple(single[0]), tuple(single[1]))


POLICY_SOURCE = "policy: "  # begins the source of a rise by a policy, before its name
PERIOD = 0.048  # s between two frames of a rise
LEAST_STD = 0.02  # rad, for joints and features that hardly change in the rises


@dataclass(frozen=True, kw_only=True)
class CollectedRise:
    """One rise on flat ground: MuJoCo positions every `PERIOD`, from lying to standing."""

    source: str
    """Its source, such as "planned: sit-up" or "policy: robust"."""
    qpos: Array
    """(T, nq)"""
    joint_target: Array
    """Targets that were sent to the servos [rad], (T, n)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RiseSet:
    """Many rises of one robot, their frames one after another."""

    robot: Robot
    qpos: Array
    """MuJoCo positions on flat ground, of the robot alone, (F, nq)."""
    joint_target: Array
    """Targets of the servos at all frames [rad], (F, n)."""
    first: NDArray[np.int_]
    """Row of each rise's first frame, and the number of frames, (R + 1,)."""
    sources: tuple[str, ...]
    """Source of each rise, (R,)."""

    def __len__(self) -> int:
        return len(self.sources)

    @staticmethod
    def join(robot: Robot, rises: Sequence[CollectedRise]) -> RiseSet:
        """Join rises of a robot."""
        return RiseSet(
            robot=robot,
            qpos=np.concatenate([rise.qpos for rise in rises]),
            joint_target=np.concatenate([rise.joint_target for rise in rises]),
            first=np.cumsum([0, *(len(rise.qpos) for rise in rises)]),
            sources=tuple(rise.source for rise in rises),
        )

    @property
    def model(self) -> mujoco.MjModel:
        """Return the model whose positions the frames are: the robot alone."""
        return self.robot.spec().compile()

    @cached_property
    def joint_pos(self) -> Array:
        """Return the joint angles of all frames [rad], (F, n)."""
        return self.qpos[:, self.robot.layout(self.model).qpos]

    @cached_property
    def features(self) -> Array:
        """Return the style features of all frames, (F, 3)."""
        return measure_features(self.robot, self.model, self.qpos)

    @cached_property
    def pos_mean(self) -> Array:
        """Return the mean of the joint angles and their mirror images [rad], (n,)."""
        return self.robot.symmetrize(self.joint_pos.mean(axis=0))

    @cached_property
    def pos_std(self) -> Array:
        """Return the standard deviation of the same [rad], (n,)."""
        squares = np.mean((self.joint_pos - self.pos_mean) ** 2, axis=0)
        both = 0.5 * (squares + squares[self.robot.mirror_index])
        return np.maximum(np.sqrt(both), LEAST_STD)

    @cached_property
    def feature_mean(self) -> Array:
        """Return the mean of the features and their mirror images, (3,)."""
        mean = self.features.mean(axis=0)
        return 0.5 * (mean + mirror_features(mean))

    @cached_property
    def feature_std(self) -> Array:
        """Return the standard deviation of the same, (3,)."""
        squares = np.mean((self.features - self.feature_mean) ** 2, axis=0)
        return np.maximum(np.sqrt(squares), LEAST_STD)

    def duration(self, rise: int) -> float:
        """Return how long a rise lasts [s]."""
        return float((self.first[rise + 1] - self.first[rise] - 1) * PERIOD)

    def curves(self, rise: int) -> StyleCurves:
        """Extract the style curves of a rise."""
        features = self.features[self.first[rise] : self.first[rise + 1]]
        return extract_curves(np.arange(len(features), dtype=float) * PERIOD, features)

    def save(self, file: Path) -> None:
        """Write the rises to an .npz file."""
        arrays = {
            "qpos": self.qpos.astype(np.float32),
            "joint_target": self.joint_target.astype(np.float32),
            "first": self.first,
        }
        save_arrays(file, arrays | {"sources": "\n".join(self.sources), "robot": self.robot.name})

    @staticmethod
    def load(file: Path, robot: Robot) -> RiseSet:
        """Read the rises of a robot; raises ValueError if the file holds none of it."""
        width = robot.spec().compile().nq
        try:
            arrays = load_arrays(file, ("qpos", "joint_target", "first", "sources", "robot"))
            check_robot(arrays["robot"], robot.name)
            sources = tuple(to_text(arrays["sources"], "sources").split("\n"))
            qpos = to_numbers(arrays["qpos"], "qpos", (None, width))
            target = to_numbers(arrays["joint_target"], "joint_target", (len(qpos), robot.n))
            first = to_numbers(arrays["first"], "first", (len(sources) + 1,)).astype(int)
            if first[0] != 0 or first[-1] != len(qpos) or np.any(np.diff(first) < 2):
                raise ArchiveError("first does not divide the frames into rises")
        except ArchiveError as error:
            raise ValueError(f"{file} holds no rises, expected an .npz of them: {error}") from error
        return RiseSet(robot=robot, qpos=qpos, joint_target=target, first=first, sources=sources)
