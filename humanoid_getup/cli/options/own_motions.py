"""Options of `getup motions import`, `record` and `preview`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.cli.options.shared import BackendOptions, CommandOptions, RobotOption

MOST_PAGE = 255  # of an action file
KeyframesFile = Annotated[Path | None, arg(metavar="FILE")]


@dataclass(frozen=True, kw_only=True)
class NewKeysOptions(CommandOptions):
    """What becomes of new keys."""

    start: Literal["supine", "prone", "left", "right", "squat", "standing"] | None = None
    """Posture class from which the keys start; default: the one from which they come nearest to a
    stand in simulation."""
    out: KeyframesFile = None
    """Keyframes file (.toml) to which the keys are added; default: the robot's keyframes.toml."""


@dataclass(frozen=True, kw_only=True)
class ImportMotion(NewKeysOptions, RobotOption):
    """Add the keys of another program's file to the robot's keyframes.

    The file is a ROBOTIS action file (.bin), a JSON animation (.json) with keyframes of goals in
    degrees, or a table (.csv) with a column time and one for each joint.
    """

    file: Annotated[Positional[Path], arg(metavar="FILE")]
    """File of another program: .bin, .json or .csv."""
    page: Annotated[tuple[int, ...], arg(metavar="N,...")] = ()
    """Pages of an action file; those that follow one are played with it."""
    name: str = ""
    """Name of the motion; default: as in the file."""
    end: Literal["standing", "supine", "prone", "left", "right"] = "standing"
    """What the keys end in: a stand, or the side on which the robot lies."""
    clip: bool = False
    """Take the nearest angle where one is out of the joint's range, instead of refusing it."""

    def find_faults(self) -> list[str]:
        """Report pages that cannot be, too."""
        faults = super().find_faults()
        faults += [
            f"--page is {page}, expected 1 to {MOST_PAGE}"
            for page in self.page
            if not 1 <= page <= MOST_PAGE
        ]
        if len(set(self.page)) < len(self.page):
            faults.append("--page has a page twice, expected each once")
        if self.name and len(self.page) > 1:
            faults.append(f"--name is given with {len(self.page)} pages, expected one")
        return faults


@dataclass(frozen=True, kw_only=True)
class RecordMotion(NewKeysOptions, BackendOptions):
    """Record keys from a robot that is moved by hand, torque off.

    Enter or space takes the posture, backspace drops the last one, q finishes.
    """

    name: Positional[str]
    """Name of the new motion."""


@dataclass(frozen=True, kw_only=True)
class PreviewMotion(RobotOption):
    """Draw the keys of a motion, play them once as they are, and say how that ends.

    Above, each key without physics; below, the rollout, undisturbed and at full torque.
    """

    name: Positional[str]
    """Name of a motion in the keyframes."""
    keyframes: KeyframesFile = None
    """Keyframes file (.toml); default: the robot's keyframes.toml."""
    picture: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """Picture to write; default: NAME.png."""
