"""Robot descriptions: one folder a robot, and the types that load it."""

from robots.posture import Posture
from robots.robot import Joint, Robot, load_robot
from robots.servo import Servo, ServoModel

__all__ = ["Joint", "Posture", "Robot", "Servo", "ServoModel", "load_robot"]
