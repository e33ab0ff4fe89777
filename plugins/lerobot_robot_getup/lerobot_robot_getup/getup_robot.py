"""The robot as LeRobot sees it."""

from __future__ import annotations

import atexit
import logging
from functools import cached_property
from typing import Any

import numpy as np
from getup_server.messages import Setup, Snapshot
from getup_server.robot_client import RobotClient
from lerobot.cameras import make_cameras_from_configs
from lerobot.processor import RobotAction, RobotObservation
from lerobot.robots import Robot
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_robot
from lerobot_robot_getup.config_getup_robot import NO_RISE, GetupRobotConfig
from lerobot_robot_getup.joint_units import JointUnits
from lerobot_robot_getup.lerobot_calibration import find_calibration, save_calibration

logger = logging.getLogger(__name__)

POSITION = ".pos"
RISING = "getup.rising"
GRAVITY = tuple(f"imu.gravity_b.{axis}" for axis in "xyz")
GYRO = tuple(f"imu.gyro_b.{axis}" for axis in "xyz")


class GetupRobot(Robot):
    """A servo humanoid that obeys LeRobot's actions within the limits of a safety guard.

    After a fall it gets up before it obeys again. Until the first action its torque is off.
    """

    config_class = GetupRobotConfig
    name = "getup"

    def __init__(self, config: GetupRobotConfig) -> None:
        """Load the description of the robot; nothing is opened yet.

        Raises:
            BadInputError: if the configuration cannot be used.
        """
        self._client: RobotClient | None = None  # first: LeRobot's destructor asks for it
        self._request = config.make_request()
        self.config = config
        self._robot = load_robot(self._request)
        if config.rise != NO_RISE and not self._has_imu:
            raise BadInputError(
                f"--robot.rise is '{config.rise}', but robot '{self._robot.name}' has no IMU to "
                f"notice a fall with, expected --robot.rise={NO_RISE}"
            )
        super().__init__(config)
        self._units = JointUnits.of(self._robot, use_degrees=config.use_degrees)
        self.cameras = make_cameras_from_configs(config.cameras)
        self._phase = ""

    # What LeRobot asks an unconnected robot for ---------------------------------------------------

    @cached_property
    def action_features(self) -> dict[str, type]:
        """Return the joints, ``<joint>.pos``."""
        return {joint + POSITION: float for joint in self._robot.joint_names}

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """Return joints, gravity and rates of the torso, whether it rises, and camera pictures."""
        imu = (*GRAVITY, *GYRO) if self._has_imu else ()
        pictures = {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}
        return self.action_features | dict.fromkeys((*imu, RISING), float) | pictures

    @property
    def is_connected(self) -> bool:
        """Return whether the robot is open."""
        return self._client is not None and all(c.is_connected for c in self.cameras.values())

    @property
    def is_calibrated(self) -> bool:
        """Return whether LeRobot's file says what the description of the robot says."""
        return self.calibration == find_calibration(self._robot)

    # Connecting -----------------------------------------------------------------------------------

    def connect(self, calibrate: bool = True) -> None:
        """Open the robot; its torque stays off until the first action.

        Raises:
            DeviceAlreadyConnectedError: if it is open.
            RobotUnreachableError: if it cannot be opened.
        """
        if self.is_connected:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        if calibrate and not self.is_calibrated:
            self.calibrate()
        self._client = RobotClient(self._make_setup())
        atexit.register(self._close)
        try:
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self._close()
            raise
        self.configure()

    def calibrate(self) -> None:
        """Write LeRobot's file from the zeros and directions of the robot, which does not move.

        They are measured by ``getup calibrate``.
        """
        self.calibration = find_calibration(self._robot)
        save_calibration(self.calibration, self.calibration_fpath)
        logger.info(
            "%s: wrote %s from the robot's description; zeros are measured by: getup calibrate",
            self,
            self.calibration_fpath,
        )

    def configure(self) -> None:
        """Do nothing: the driver checks and configures the servos as it connects."""

    def disconnect(self) -> None:
        """Switch torque off and close the robot.

        Raises:
            DeviceNotConnectedError: if it is not open.
        """
        self._require_client()
        self._close()

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            atexit.unregister(self._close)
            client.close()
        for camera in self.cameras.values():
            if camera.is_connected:
                camera.disconnect()

    # The loop -------------------------------------------------------------------------------------

    def get_observation(self) -> RobotObservation:
        """Return the newest measurement.

        Raises:
            DeviceNotConnectedError: if it is not open.
            RobotUnreachableError: if its torque is off, for good; the message says why.
        """
        known = self._require_client().observe()
        self._report(known)
        observation: dict[str, Any] = self._name(known.joint_pos)
        if self._has_imu:
            observation |= dict(zip(GRAVITY, known.gravity_b.tolist(), strict=True))
            observation |= dict(zip(GYRO, known.gyro_b.tolist(), strict=True))
        observation[RISING] = float(known.rising)
        return observation | {name: each.async_read() for name, each in self.cameras.items()}

    def send_action(self, action: RobotAction) -> RobotAction:
        """Move joints; return the targets that were really sent, of all joints.

        Joints that are not named keep their targets. While the robot rises, the action is dropped,
        and what the rise sends is returned.

        Raises:
            ValueError: if the action names an unknown joint, or a target that is no finite number;
                the robot keeps its targets.
            DeviceNotConnectedError: if it is not open.
            RobotUnreachableError: if its torque is off, for good; the message says why.
        """
        client = self._require_client()
        numbers = {
            key.removesuffix(POSITION): float(value)
            for key, value in action.items()
            if key.endswith(POSITION)
        }
        known = client.act(self._convert(numbers))
        self._report(known)
        return self._name(known.targets)

    def _convert(self, numbers: dict[str, float]) -> dict[str, float]:
        """Convert numbers by joints to angles [rad]."""
        names = self._robot.joint_names
        if unknown := [name for name in numbers if name not in names]:
            raise ValueError(
                f"action: unknown joint {', '.join(map(repr, unknown))}, expected "
                f"{', '.join(names)} of robot '{self._robot.name}'"
            )
        if wrong := [name for name, number in numbers.items() if not np.isfinite(number)]:
            named = ", ".join(f"joint '{name}': target is {numbers[name]}" for name in wrong)
            raise ValueError(f"action: {named}, expected a finite number")
        given = np.array([numbers.get(name, 0.0) for name in names])
        angles = dict(zip(names, self._units.to_angles(given).tolist(), strict=True))
        return {name: angles[name] for name in numbers}

    def _name(self, joint_pos: np.ndarray) -> dict[str, float]:
        numbers = self._units.from_angles(joint_pos).tolist()
        return dict(zip(self.action_features, numbers, strict=True))

    def _report(self, known: Snapshot) -> None:
        """Log a phase that has begun."""
        if known.phase != self._phase:
            self._phase = known.phase
            logger.info("%s: %s", self, known.phase)

    @property
    def _has_imu(self) -> bool:
        return self._robot.imu_kind is not None

    def _require_client(self) -> RobotClient:
        if self._client is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._client

    def _make_setup(self) -> Setup:
        config = self.config
        speed = np.inf if config.max_speed is None else np.radians(config.max_speed)
        return Setup(
            request=self._request,
            rises=config.rise != NO_RISE,
            realtime=config.realtime,
            max_speed=float(speed),
            approach_speed=float(np.radians(config.approach_speed)),
            fallen_tilt=float(np.radians(config.fallen_tilt)),
        )
