"""`getup studio`: the page in the browser."""

from __future__ import annotations

import sys
import threading

from humanoid_getup.commands.console import phase
from humanoid_getup.commands.errors import needing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.jobs.requests.look import StudioRequest

LONGEST_WAIT = 1.0  # s


def studio(command: StudioRequest) -> int:
    """Serve the page until interrupted; return the exit code."""
    with needing("studio"), phase("opening the studio"):
        from humanoid_getup.studio.studio import Studio

        opened = Studio(command, _announce)
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
