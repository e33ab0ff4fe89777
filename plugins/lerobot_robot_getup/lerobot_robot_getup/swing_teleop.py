"""A teleoperator without a device: it swings joints, to try a robot out."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import Any

from lerobot.processor import RobotAction
from lerobot.teleoperators import Teleoperator, TeleoperatorConfig

from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.requests.shared import RobotOption
from lerobot_robot_getup.getup_robot import POSITION
from lerobot_robot_getup.joint_units import JointUnits


@TeleoperatorConfig.register_subclass("getup_swing")
@dataclass(kw_only=True)
class SwingTeleopConfig(TeleoperatorConfig):
    """Which joints swing, and how far."""

    model: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""
    joints: list[str] = field(default_factory=list)
    """The joints that swing about their standing angles; the others stand."""
    amplitude: float = 20.0
    """[deg]"""
    period: float = 2.0
    """[s]"""
    use_degrees: bool = True
    """As of the robot."""


class SwingTeleop(Teleoperator):
    """Returns the targets of a robot that stands and swings some joints."""

    config_class = SwingTeleopConfig
    name = "getup_swing"

    def __init__(self, config: SwingTeleopConfig) -> None:
        """Load the description of the robot.

        Raises:
            ValueError: if the robot has no such joint.
        """
        super().__init__(config)
        self.config = config
        self._robot = load_robot(RobotOption(robot=config.model))
        if unknown := [name for name in config.joints if name not in self._robot.joint_names]:
            raise ValueError(
                f"--teleop.joints: unknown joint {', '.join(map(repr, unknown))}, expected "
                f"{', '.join(self._robot.joint_names)}"
            )
        self._units = JointUnits.of(self._robot, use_degrees=config.use_degrees)
        self._began: float | None = None

    @property
    def action_features(self) -> dict[str, type]:
        """Return the joints, ``<joint>.pos``."""
        return {joint + POSITION: float for joint in self._robot.joint_names}

    @property
    def feedback_features(self) -> dict[str, type]:
        """Return nothing: there is no device to move."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Return whether it has begun."""
        return self._began is not None

    def connect(self, calibrate: bool = True) -> None:
        """Begin to swing."""
        del calibrate
        self._began = time.perf_counter()

    @property
    def is_calibrated(self) -> bool:
        """Return True: there is nothing to calibrate."""
        return True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def get_action(self) -> RobotAction:
        """Return the targets of now."""
        now = time.perf_counter()
        swing = math.sin(2.0 * math.pi * (now - (self._began or now)) / self.config.period)
        target = self._robot.standing.joint_pos.copy()
        for joint in self.config.joints:
            target[self._robot.joint_names.index(joint)] += (
                math.radians(self.config.amplitude) * swing
            )
        return dict(
            zip(self.action_features, self._units.from_angles(target).tolist(), strict=True)
        )

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: there is no device to move."""

    def disconnect(self) -> None:
        """End."""
        self._began = None
