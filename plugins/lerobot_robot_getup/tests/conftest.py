"""Robots of the tests."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

pytest.importorskip("lerobot.robots", reason="needs LeRobot", exc_type=ImportError)

from lerobot_robot_getup import GetupRobot, GetupRobotConfig

from robots import Robot, load_robot


@pytest.fixture(scope="session")
def op3() -> Robot:
    return load_robot("op3")


@pytest.fixture(autouse=True)
def lerobot_home(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep tests away from the user's LeRobot folder."""
    monkeypatch.setenv("HF_LEROBOT_HOME", str(tmp_path_factory.mktemp("lerobot")))
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")


@pytest.fixture
def make(tmp_path: Path) -> Callable[..., GetupRobot]:
    def make(**options) -> GetupRobot:
        return GetupRobot(GetupRobotConfig(id="test", calibration_dir=tmp_path, **options))

    return make


@pytest.fixture
def connect(make: Callable[..., GetupRobot]) -> Iterator[Callable[..., GetupRobot]]:
    robots: list[GetupRobot] = []

    def connect(**options) -> GetupRobot:
        robots.append(make(**({"realtime": False} | options)))
        robots[-1].connect()
        return robots[-1]

    yield connect
    for robot in robots:
        if robot.is_connected:
            robot.disconnect()
