import pytest

from humanoid_getup.rehearsal import Stage
from humanoid_getup.scene import load_scene
from robots import Robot, load_robot


@pytest.fixture(scope="session")
def op3() -> Robot:
    return load_robot("op3")


@pytest.fixture(scope="session")
def stage(op3: Robot) -> Stage:
    return Stage.build(op3, load_scene("flat"))
