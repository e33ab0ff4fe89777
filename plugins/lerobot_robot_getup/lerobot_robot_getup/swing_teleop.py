"""A teleoperator without a device: it swings joints, to try a robot out."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lerobot.processor import RobotAction
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from lerobot_robot_getup.joints import JointUnits, name_positions
from robots import load_robot


@TeleoperatorConfig.register_subclass("getup_swing")
@dataclass(kw_only=True)
class SwingTeleopConfig(TeleoperatorConfig):
    """Which joints of a model swing about their standing angles, and how far; the others stand."""

    model: str = "op3"
    joints: list[str] = field(default_factory=list)
    amplitude: float = 20.0  # deg
    period: float = 2.0  # s
    use_degrees: bool = True


class SwingTeleop(Teleoperator):
    """Returns the targets of a robot that stands and swings some joints."""

    config_class = SwingTeleopConfig
    name = "getup_swing"
    action_features: dict[str, type] = {}  # noqa: RUF012
    feedback_features: dict[str, type] = {}  # noqa: RUF012
    is_connected, is_calibrated = False, True

    def __init__(self, config: SwingTeleopConfig) -> None:
        """Load the description of the robot; a joint that it does not have is refused."""
        super().__init__(config)
        self.config, self._robot = config, load_robot(config.model)
        names = self._robot.joint_names
        if unknown := [name for name in config.joints if name not in names]:
            raise ValueError(
                f"--teleop.joints: unknown joint {', '.join(map(repr, unknown))}, expected "
                f"{', '.join(names)}"
            )
        self._units = JointUnits(self._robot, use_degrees=config.use_degrees)
        self._amplitude = math.radians(config.amplitude) * np.isin(names, config.joints)
        self.action_features = name_positions(self._robot)

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002
        """Begin to swing."""
        self.is_connected, self._began = True, time.perf_counter()

    def get_action(self) -> RobotAction:
        """Return the targets of now."""
        phase = 2.0 * math.pi * (time.perf_counter() - self._began) / self.config.period
        target = self._robot.standing.joint_pos + self._amplitude * math.sin(phase)
        numbers = self._units.from_angles(target).tolist()
        return dict(zip(self.action_features, numbers, strict=True))

    def disconnect(self) -> None:
        """End."""
        self.is_connected = False

    def calibrate(self) -> None:
        """Do nothing: there is no device."""

    configure = calibrate

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: there is no device."""
