"""Spoiling a robot's folder, and hearing what is said of it."""

from pathlib import Path

import pytest

from robots import RobotError, load_robot


def spoil(folder: Path, old: str, new: str, file: str = "robot.toml") -> None:
    path = folder / file
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")


def complaint(folder: Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(folder)
    message = str(caught.value)
    assert message.isprintable(), "one line is enough"
    assert str(folder / "robot.toml") in message
    return message.partition("robot.toml: ")[2]
