"""A robot with other proportions than its model file."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from robots.reshaping.reshape_model import reshape_model
from robots.robot import Robot


@dataclass(frozen=True, kw_only=True, repr=False)
class ReshapedRobot(Robot):
    """A robot whose model has the lengths of `body`; servos and joints stay the same."""

    def read_model(self) -> mujoco.MjSpec:
        """Read the model, and give it the body's lengths."""
        spec = super().read_model()
        reshape_model(spec, self, self.body)
        return spec
