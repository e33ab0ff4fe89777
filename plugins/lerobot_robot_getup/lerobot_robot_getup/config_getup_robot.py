"""Configuration of the robot, as LeRobot's programs parse it from ``--robot.*``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any, cast

from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.get_up.rise import RiseRequest

NO_RISE, STANDING = "none", "standing"
OWN_NAMES = {"robot": "model", "method": "rise", "from": "start"}
"""Names of fields that LeRobot's options give another meaning, or none."""


@RobotConfig.register_subclass("getup")
@dataclass(kw_only=True)
class GetupRobotConfig(RobotConfig):
    """A humanoid, how it is reached, and what it does after a fall."""

    model: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""
    backend: str = "twin"
    """``twin``; ``virtual`` servos on a virtual bus; a robot with ``dynamixel`` servos."""
    port: str = ""
    """Serial port; of a robot with several, NAME=PATH of each, separated by commas."""
    start: str | None = None
    """Of a simulated robot: supine, prone, left, right or a posture file; None: it stands."""
    scene: str = "flat"
    """Name of a scene, or a scene file; for simulated robots."""
    realtime: bool = True
    """False: a simulated robot moves as fast as the computer can."""
    use_degrees: bool = True
    """``<joint>.pos`` in degrees from the model's zero; False: -100 to 100 over the range."""
    torque_limit: float | None = None
    """Torque limit per servo, of rises too [N·m]; None for stall torque."""
    max_speed: float | None = None
    """Highest speed of the targets of actions [deg/s]; None for that of the servos."""
    approach_speed: float = 60.0
    """Speed at which targets go to the first action after the start or a rise [deg/s]."""
    rise: str = "plan"
    """How it gets up: ``plan``, ``policy``, ``auto``; ``none``: it does not, nor notices falls."""
    policy: str | None = None
    """Name of a policy of the robot, or an .onnx file; None for the robust one."""
    attempts: int = 3
    """Number of attempts to get up."""
    fallen_tilt: float = 45.0
    """Tilt of the torso from which the robot counts as fallen [deg]."""
    cameras: dict[str, CameraConfig] = field(default_factory=dict)

    @property
    def rises(self) -> bool:
        """Return whether it gets up after a fall."""
        return self.rise != NO_RISE

    def make_request(self) -> RiseRequest:
        """Make the request by which the library opens the robot.

        Raises:
            BadInputError: naming every option that does not fit, under its name here.
        """
        request = RiseRequest(
            robot=self.model,
            backend=cast(Any, self.backend),
            method=cast(Any, self.rise if self.rises else "plan"),
            port=tuple(filter(None, self.port.split(","))),
            origin=self.start or (None if self.port else STANDING),
            scene=self.scene,
            torque_limit=self.torque_limit,
            policy=self.policy,
            attempts=self.attempts,
        )
        speeds = {"max_speed": self.max_speed, "approach_speed": self.approach_speed}
        problems = [
            f"--robot.{name} is {speed:g} deg/s, expected more than 0 deg/s"
            for name, speed in speeds.items()
            if speed is not None and not speed > 0.0
        ]
        if not 0.0 < (tilt := self.fallen_tilt) < 180.0:
            problems.append(f"--robot.fallen_tilt is {tilt:g} deg, expected between 0 and 180 deg")
        try:
            RiseRequest.accept(request)
        except BadInputError as error:
            problems += [re.sub(r"--([a-z][a-z-]*)", _rename, each) for each in error.problems]
        if problems:
            raise BadInputError("; ".join(problems))
        return request


def _rename(option: re.Match[str]) -> str:
    """Name an option of the command line as LeRobot's programs do."""
    return f"--robot.{OWN_NAMES.get(option[1], option[1]).replace('-', '_')}"
