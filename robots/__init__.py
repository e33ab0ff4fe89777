"""Robot descriptions: one folder a robot, and the types that load it."""

import mujoco

from robots.bus_settings import BoardSettings, BusSettings
from robots.description.loading import load_robot, reshape
from robots.description.posture_file import load_posture
from robots.imu import ImuSettings
from robots.posture import Posture
from robots.proportions import ORIGINAL, Body, BodyError
from robots.robot import Joint, Robot, RobotError, list_robots
from robots.servo import Servo, ServoModel
from robots.torque_limit import FULL_TORQUE, TorqueLimit

# MuJoCo's own log goes to the terminal, not to MUJOCO_LOG.TXT in the working folder.
_log = mujoco.MjLogConfig.get()
_log.logto_file = False
mujoco.MjLogConfig.set(_log)

__all__ = [
    "FULL_TORQUE",
    "ORIGINAL",
    "BoardSettings",
    "Body",
    "BodyError",
    "BusSettings",
    "ImuSettings",
    "Joint",
    "Posture",
    "Robot",
    "RobotError",
    "Servo",
    "ServoModel",
    "TorqueLimit",
    "list_robots",
    "load_posture",
    "load_robot",
    "reshape",
]
