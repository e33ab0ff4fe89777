"""`getup studio`: the page in the browser."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.commands.command import program
from humanoid_getup.commands.console import phase
from humanoid_getup.commands.errors import DID_IT, needing
from humanoid_getup.commands.options import LoadOption, SceneOptions
from robots.storage.validation import between

LAST_PORT = 65535
LONGEST_WAIT = 1.0  # s


@dataclass(frozen=True, kw_only=True)
class StudioRequest(LoadOption, SceneOptions):
    """Open the studio, a page in the browser: pose a fall, plan its rise, look at it."""

    port: Annotated[int, between(0, LAST_PORT, ""), arg(metavar="N")] = 8090
    """Port of the page; 0 for any that is free."""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address at which the page is served; one that others can reach requires a token, which is
    part of the printed address."""
    folder: Annotated[tuple[Path, ...], arg(metavar="DIR,...")] = (Path(),)
    """Folders in which the page may read and write files, besides the robot's own, which it
    reads."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        missing = [folder for folder in self.folder if not folder.is_dir()]
        yield from (f"--folder {folder}: expected an existing folder" for folder in missing)


@program("studio")
def studio(options: StudioRequest) -> int:
    """Serve the page until interrupted; return the exit code."""
    with needing("studio"), phase("opening the studio"):
        from humanoid_getup.studio.studio import Studio

        opened = Studio(options, _announce)
    with opened:
        never = threading.Event()
        try:
            # A signal that comes just before a wait without end would be noticed by its end only.
            while not never.wait(LONGEST_WAIT):
                pass
        except KeyboardInterrupt:
            return DID_IT
    return DID_IT


def _announce(address: str) -> None:
    print(address, flush=True)
    print("getup: open this address in a browser; Ctrl-C ends the studio", file=sys.stderr)
