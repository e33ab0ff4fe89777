"""LeRobot plugin: a servo humanoid behind a safety guard that gets up after a fall.

LeRobot imports it by the name of its distribution; ``--robot.type=getup`` is the robot.
"""

import lerobot.robots

import robots

if robots is lerobot.robots or robots.__file__ == lerobot.robots.__file__:
    raise ImportError(
        "package 'robots' is LeRobot's own folder, which LeRobot adds to the search path: install "
        "humanoid-getup from its wheel, or with: "
        "pip install -e . --config-settings editable_mode=compat"
    )

from lerobot_robot_getup.config_getup_robot import GetupRobotConfig
from lerobot_robot_getup.getup_robot import GetupRobot
from lerobot_robot_getup.swing_teleop import SwingTeleop, SwingTeleopConfig

__all__ = ["GetupRobot", "GetupRobotConfig", "SwingTeleop", "SwingTeleopConfig"]
