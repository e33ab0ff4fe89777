"""Spoiling a text or a robot's folder, and hearing what is said of it."""

from pathlib import Path

import pytest

from robots import RobotError, load_robot


def spoiled(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new)


def spoil(folder: Path, old: str, new: str, file: str = "robot.toml") -> None:
    path = folder / file
    path.write_text(spoiled(path.read_text("utf-8"), old, new), "utf-8")


def complaint(folder: Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(folder)
    message = str(caught.value)
    assert message.isprintable(), "one line is enough"
    assert str(folder / "robot.toml") in message
    return message.partition("robot.toml: ")[2]
