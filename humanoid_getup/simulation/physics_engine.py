"""The engines that step physics: MuJoCo on the CPU, or mujoco-warp on a GPU."""

from __future__ import annotations

import math
from dataclasses import dataclass
from importlib import import_module
from typing import Literal

import mujoco
import numpy as np
from mujoco.batch import Batch

from humanoid_getup.simulation.world import World
from robots.kinematics import place

PhysicsName = Literal["mujoco", "warp"]


@dataclass(frozen=True)
class PhysicsEngine:
    """The engine that steps physics, and its device."""

    name: PhysicsName = "mujoco"
    device: str = ""
    """Of mujoco-warp: cpu, cuda or cuda:N; '' for a GPU if there is one, else the CPU."""

    def load(self) -> None:
        """Import the engine."""
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


MOST_PHASE = 1.5  # rad, of a servo's oscillation within a physics step; it grows from 2 rad


def find_coarse_step(world: World) -> float:
    """Find the longest stable physics step that divides a robot's control period [s].

    A servo of stiffness k and the inertia I that it feels oscillate with sqrt(k / I). That of its
    joint in the standing posture is taken.
    """
    robot, model = world.robot, world.model
    data = mujoco.MjData(model)
    data.qpos[:] = place(robot, model, robot.standing)
    mujoco.mj_forward(model, data)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    felt = 1.0 / np.diag(np.linalg.inv(inertia))[robot.layout(model).dof]
    fastest = float(np.sqrt(robot.position_gain / felt).max())
    return robot.control_period / math.ceil(robot.control_period * fastest / MOST_PHASE)
