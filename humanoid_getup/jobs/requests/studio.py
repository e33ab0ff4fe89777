"""Request to open the studio."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.jobs.requests.shared import BodyOption, SceneOptions
from humanoid_getup.jobs.requests.values import between

LAST_PORT = 65535


@dataclass(frozen=True, kw_only=True)
class StudioRequest(BodyOption, SceneOptions):
    """Open the studio, a page in the browser: pose a fall, plan its rise, look at it."""

    port: Annotated[int, between(0, LAST_PORT, ""), arg(metavar="N")] = 8090
    """Port of the page; 0 for any that is free."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address at which the page is served; one that others can reach requires a token, which is
    part of the printed address."""
    folder: Annotated[tuple[Path, ...], arg(metavar="DIR,...")] = (Path(),)
    """Folders in which the page may read and write files, besides the robot's own, which it
    reads."""

    def find_problems(self) -> list[str]:
        """Report folders that do not exist as well."""
        missing = [folder for folder in self.folder if not folder.is_dir()]
        problems = [f"--folder {folder}: expected an existing folder" for folder in missing]
        return super().find_problems() + problems
