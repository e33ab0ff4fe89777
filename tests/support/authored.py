"""The keyframes that are authored for a robot."""

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from robots import Robot


def load_robot_keyframes(robot: Robot) -> list[Keyframes]:
    return load_keyframes(robot.folder / KEYFRAMES, robot)
