"""The robot as LeRobot sees it."""

from __future__ import annotations

import atexit
import logging
import signal
import sys
import threading
from functools import cached_property
from typing import Any

import numpy as np
from lerobot.cameras import make_cameras_from_configs
from lerobot.processor import RobotAction, RobotObservation
from lerobot.robots import Robot
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from drivers.interrupts import deferred_interrupts
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import load_robot
from lerobot_robot_getup.config_getup_robot import NO_RISE, GetupRobotConfig
from lerobot_robot_getup.joints import JointUnits, find_calibration, name_positions
from lerobot_robot_getup.robot_thread import RobotThread
from robots.quaternion import Array

logger = logging.getLogger(__name__)

RISING = "getup.rising"
IMU = tuple(f"imu.{quantity}.{axis}" for quantity in ("gravity_b", "gyro_b") for axis in "xyz")


class GetupRobot(Robot):
    """A servo humanoid that obeys LeRobot's actions within the limits of a safety guard.

    After a fall it gets up before it obeys again. Until the first action its torque is off.
    """

    config_class = GetupRobotConfig
    name = "getup"

    def __init__(self, config: GetupRobotConfig) -> None:
        """Load the description of the robot; nothing is opened yet."""
        self._thread: RobotThread | None = None  # first: LeRobot's destructor asks for it
        self.config = config
        self._robot = load_robot(config.make_request())
        self._has_imu = self._robot.imu_kind is not None
        if config.rises and not self._has_imu:
            raise BadInputError(
                f"--robot.rise is '{config.rise}', but robot '{self._robot.name}' has no IMU to "
                f"notice a fall with, expected --robot.rise={NO_RISE}"
            )
        super().__init__(config)
        self._units = JointUnits(self._robot, use_degrees=config.use_degrees)
        self.cameras = make_cameras_from_configs(config.cameras)

    @cached_property
    def action_features(self) -> dict[str, type]:
        """Return the joints, ``<joint>.pos``."""
        return name_positions(self._robot)

    @cached_property
    def observation_features(self) -> dict[str, Any]:
        """Return joints, gravity and rates of the torso, whether it rises, and camera pictures."""
        others = (*(IMU if self._has_imu else ()), RISING)
        pictures = {name: (each.height, each.width, 3) for name, each in self.cameras.items()}
        return self.action_features | dict.fromkeys(others, float) | pictures

    @property
    def is_connected(self) -> bool:
        """Return whether the robot is open."""
        return self._thread is not None

    @property
    def is_calibrated(self) -> bool:
        """Return whether LeRobot's file says what the description of the robot says."""
        return self.calibration == find_calibration(self._robot)

    def connect(self, calibrate: bool = True) -> None:
        """Open the robot; its torque stays off until the first action."""
        if self._thread is not None:
            raise DeviceAlreadyConnectedError(f"{self} is already connected")
        if calibrate and not self.is_calibrated:
            self.calibrate()
        _end_on_signals()
        self._thread = RobotThread(self.config)
        atexit.register(self._close)
        try:
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self._close()
            raise

    def calibrate(self) -> None:
        """Write LeRobot's file from the zeros and directions of the robot, which does not move."""
        self.calibration = find_calibration(self._robot)
        self._save_calibration()
        logger.info("zeros are measured by: getup calibrate; wrote %s", self.calibration_fpath)

    def configure(self) -> None:
        """Do nothing: the driver checks and configures the servos as it connects."""

    def disconnect(self) -> None:
        """Switch torque off; joints that do not confirm are named by a `RobotStoppedError`."""
        self._require_thread()
        self._close()

    def _close(self) -> None:
        try:
            if self._thread is not None:
                with deferred_interrupts():  # a second Ctrl-C
                    self._thread.close()
        finally:
            self._thread = None
            atexit.unregister(self._close)
            for camera in self.cameras.values():
                if camera.is_connected:
                    camera.disconnect()

    def get_observation(self) -> RobotObservation:
        """Return the newest measurement; raise `RobotStoppedError` once torque is off for good."""
        thread = self._require_thread()
        state, sense = thread.observe(), thread.sense
        observation: dict[str, Any] = self._name(state.joint_pos)
        if sense is not None:
            imu = (*sense(state.orientation), *(sense.torso_from_imu @ state.gyro))
            observation |= dict(zip(IMU, map(float, imu), strict=True))
        observation[RISING] = float(thread.rising)
        return observation | {name: each.async_read() for name, each in self.cameras.items()}

    def send_action(self, action: RobotAction) -> RobotAction:
        """Move joints; return the targets that were really sent, of all joints.

        Joints that are not named keep their targets. While the robot rises, the action is dropped,
        and what the rise sends is returned.

        Raises:
            ValueError: if a joint is unknown, or a target no finite number: all targets are kept.
            RobotStoppedError: if torque is off, for good; the message says why.
        """
        return self._name(self._require_thread().act(self._convert(action)))

    def _convert(self, action: RobotAction) -> Array:
        """Convert an action to angles [rad], (n,), NaN for joints that it does not name."""
        numbers = {key: float(value) for key, value in action.items() if key.endswith(".pos")}
        expected = f"expected {', '.join(self._robot.joint_names)} of robot '{self._robot.name}'"
        problems = [
            f"joint '{key.removesuffix('.pos')}': target is {number}, expected a finite number"
            if key in self.action_features
            else f"unknown joint '{key.removesuffix('.pos')}', {expected}"
            for key, number in numbers.items()
            if key not in self.action_features or not np.isfinite(number)
        ]
        if problems:
            raise ValueError(f"action: {'; '.join(problems)}")
        wanted = [numbers.get(key, np.nan) for key in self.action_features]
        return self._units.to_angles(np.array(wanted))

    def _name(self, joint_pos: Array) -> dict[str, float]:
        numbers = self._units.from_angles(joint_pos).tolist()
        return dict(zip(self.action_features, numbers, strict=True))

    def _require_thread(self) -> RobotThread:
        if self._thread is None:
            raise DeviceNotConnectedError(f"{self} is not connected: call connect() first")
        return self._thread


def _end_on_signals() -> None:
    """Let signals that would kill or suspend the program end it, so that it disconnects."""
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, lambda number, _: sys.exit(128 + number))
