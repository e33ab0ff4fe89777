"""The steps that are done, kept in a file."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import msgspec

from humanoid_getup.cli.robot.first_steps.step import FirstStep
from humanoid_getup.jobs.errors import BadInputError, refusing
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

STEPS_FILE = "first_steps.json"


class FinishedStep(msgspec.Struct, frozen=True, kw_only=True):
    """A step that is done."""

    name: str
    command: str
    skipped: bool
    at: datetime
    """Time of day when it ended."""


class FinishedSteps(msgspec.Struct, frozen=True, kw_only=True):
    """The steps of a robot that are done, in the order in which they were."""

    robot: str
    steps: tuple[FinishedStep, ...]

    @classmethod
    def load(cls, folder: Path, robot: str) -> FinishedSteps:
        """Load the steps that a folder keeps; none if it keeps none yet.

        Raises:
            BadInputError: if the file is damaged, or keeps the steps of another robot.
        """
        file = folder / STEPS_FILE
        if not file.exists():
            return cls(robot=robot, steps=())
        with refusing():
            try:
                found = msgspec.json.decode(file.read_bytes(), type=cls)
            except msgspec.DecodeError as error:
                raise BadInputError(
                    f"{file} is damaged ({error}): remove it, or choose another folder with --out"
                ) from error
        if found.robot != robot:
            raise BadInputError(
                f"{file} keeps the steps of '{found.robot}', expected '{robot}': choose another "
                "folder with --out"
            )
        return found

    def add(self, step: FirstStep, command: str, *, skipped: bool) -> FinishedSteps:
        """Return the steps with one more, in place of an earlier time that it was done."""
        now = datetime.now().astimezone()
        done = FinishedStep(name=step.name, command=command, skipped=skipped, at=now)
        others = [each for each in self.steps if each.name != step.name]
        return FinishedSteps(robot=self.robot, steps=(*others, done))

    def save(self, folder: Path) -> None:
        """Keep the steps in a folder."""
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / STEPS_FILE, to_json(self))

    def has(self, step: FirstStep) -> bool:
        """Return whether a step is done."""
        return step.name in {each.name for each in self.steps}

    def find_next(self, steps: Sequence[FirstStep]) -> FirstStep | None:
        """Return the first step that is not done; None if all are."""
        return next((step for step in steps if not self.has(step)), None)
