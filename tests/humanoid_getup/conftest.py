import pytest

from humanoid_getup.scene import load_scene
from humanoid_getup.stage import Stage
from robots import Robot, load_robot


@pytest.fixture(scope="session")
def op3() -> Robot:
    return load_robot("op3")


@pytest.fixture(scope="session")
def stage(op3: Robot) -> Stage:
    return Stage.build(op3, load_scene("flat"))
