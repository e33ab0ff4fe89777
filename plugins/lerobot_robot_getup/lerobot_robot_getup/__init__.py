"""LeRobot plugin: a servo humanoid behind a safety guard that gets up after a fall.

LeRobot imports it by the name of its distribution; ``--robot.type=getup`` is the robot.
"""

from lerobot_robot_getup.config_getup_robot import GetupRobotConfig
from lerobot_robot_getup.getup_robot import GetupRobot
from lerobot_robot_getup.swing_teleop import SwingTeleop, SwingTeleopConfig

__all__ = ["GetupRobot", "GetupRobotConfig", "SwingTeleop", "SwingTeleopConfig"]
