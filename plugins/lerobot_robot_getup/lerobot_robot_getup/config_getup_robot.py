"""Configuration of the robot, as LeRobot's programs parse it from ``--robot.*``."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from getup_server.robot_request import RobotRequest
from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig

from humanoid_getup.jobs.errors import BadInputError

NO_RISE = "none"
OPTION = re.compile(r"--([a-z][a-z-]*)")
OWN_NAMES = {"robot": "model", "method": "rise", "from": "start"}
"""Names of fields that LeRobot's options give another meaning, or none."""


@RobotConfig.register_subclass("getup")
@dataclass(kw_only=True)
class GetupRobotConfig(RobotConfig):
    """A humanoid, how it is reached, and what it does after a fall."""

    model: str = "op3"
    """Name of a robot, or a folder with a robot.toml."""
    backend: str = "twin"
    """``twin``: MuJoCo twin; ``virtual``: virtual servos on a virtual bus; ``dynamixel``: a robot
    with Dynamixel servos."""
    port: str = ""
    """Serial port; for a robot with several, NAME=PATH of each, separated by commas. Without it,
    ``virtual`` serves a virtual robot of its own."""
    start: str | None = None
    """Where a simulated robot begins: ``supine``, ``prone``, ``left``, ``right`` or a posture
    file; None: it stands."""
    scene: str = "flat"
    """Name of a scene, or a scene file; for simulated robots."""
    seed: int = 0
    """Of the start and of plans."""
    realtime: bool = True
    """False: a simulated robot moves as fast as the computer can."""

    use_degrees: bool = True
    """``<joint>.pos`` in degrees from the zero of the model; False: from -100 at the lower end of
    the joint's range to 100 at the upper one."""
    torque_limit: float | None = None
    """Torque limit per servo, of rises too [N·m]; None for stall torque."""
    limit_by: str | None = None
    """What the torque limit acts on: ``current`` or ``pwm``; None for the robot's own."""
    max_speed: float | None = None
    """Highest speed of the targets of actions [deg/s]; None for that of the servos. Rises keep the
    speeds of their plans."""
    approach_speed: float = 60.0
    """Speed at which targets go to the first action after the start or a rise [deg/s]."""

    rise: str = "plan"
    """How it gets up after a fall: ``plan`` a motion, by a ``policy``, ``auto`` for what has the
    better record; ``none``: it does not, and falls are not looked for."""
    policy: str | None = None
    """Name of a policy of the robot, or an .onnx file; None for the robust one."""
    attempts: int = 3
    """Number of attempts to get up."""
    fallen_tilt: float = 45.0
    """Tilt of the torso from which the robot counts as fallen [deg]."""

    cameras: dict[str, CameraConfig] = field(default_factory=dict)

    def make_request(self) -> RobotRequest:
        """Make the request by which the library opens the robot.

        Raises:
            BadInputError: naming every option that does not fit, under its name here.
        """
        request = RobotRequest(
            robot=self.model,
            backend=_as(self.backend),
            port=tuple(filter(None, self.port.split(","))),
            origin=self.start,
            scene=self.scene,
            seed=self.seed,
            torque_limit=self.torque_limit,
            limit_by=_as(self.limit_by),
            method=_as("plan" if self.rise == NO_RISE else self.rise),
            policy=self.policy,
            attempts=self.attempts,
        )
        problems = self._find_problems()
        try:
            RobotRequest.accept(request)
        except BadInputError as error:
            problems += [OPTION.sub(_rename, problem) for problem in error.problems]
        if problems:
            raise BadInputError("; ".join(problems))
        return request

    def _find_problems(self) -> list[str]:
        """Report values that only this configuration has."""
        speeds = {"approach_speed": self.approach_speed, "max_speed": self.max_speed}
        problems = [
            f"--robot.{name} is {speed:g} deg/s, expected more than 0 deg/s"
            for name, speed in speeds.items()
            if speed is not None and not speed > 0.0
        ]
        if not 0.0 < self.fallen_tilt < 180.0:
            problems.append(
                f"--robot.fallen_tilt is {self.fallen_tilt:g} deg, expected between 0 and 180 deg"
            )
        return problems


def _as(text: str | None) -> Any:
    """Pass a text on as one of the choices of a request, which checks it."""
    return text


def _rename(option: re.Match[str]) -> str:
    """Name an option of the command line as LeRobot's programs do."""
    name = option[1]
    return f"--robot.{OWN_NAMES.get(name, name).replace('-', '_')}"
