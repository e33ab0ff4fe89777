"""The engines that step physics: MuJoCo on the CPU, or mujoco-warp on a GPU."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Literal

import mujoco
from mujoco.batch import Batch

PhysicsName = Literal["mujoco", "warp"]


@dataclass(frozen=True)
class PhysicsEngine:
    """The engine that steps physics, and its device."""

    name: PhysicsName = "mujoco"
    device: str = ""
    """Of mujoco-warp: cpu, cuda or cuda:N; '' for a GPU if there is one, else the CPU."""

    def load(self) -> None:
        """Import the engine.

        Raises:
            ModuleNotFoundError: if it is not installed.
        """
        if self.name == "warp":
            import warp

            warp.config.log_level = warp.LOG_ERROR  # standard output belongs to results
            import_module("mujoco_warp")

    def make_batch(self, model: mujoco.MjModel, n: int, threads: int = 0) -> Batch:
        """Build a batch of ``n`` worlds.

        Raises:
            ModuleNotFoundError: if mujoco-warp is not installed.
            ValueError: if mujoco-warp cannot simulate the model, or finds no such device.
        """
        if self.name == "mujoco":
            return Batch(model, n, threads)
        self.load()
        from humanoid_getup.simulation.warp_batch import WarpBatch

        return WarpBatch(model, n, threads, device=self.device)


MUJOCO = PhysicsEngine()
