"""Options of `getup first-steps`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from humanoid_getup.cli.options.hardware import ServiceOptions
from humanoid_getup.jobs.requests.files import FOLDER
from humanoid_getup.jobs.requests.values import between


@dataclass(frozen=True, kw_only=True)
class FirstSteps(ServiceOptions):
    """Lead from a port to the first rise: each step is a command, shown, and run after Enter.

    What is done is kept, so that the next start goes on where this one ended.
    """

    desk: bool = False
    """Loose servos on a desk instead of a robot."""
    torque_limit: Annotated[float | None, between(0.001, 1000.0, "N·m"), arg(metavar="N·m")] = None
    """Torque limit per servo of the first rise [N·m]; default: 60 % of the stall torque of the
    strongest."""
    out: Annotated[Path | None, FOLDER, arg(metavar="DIR")] = None
    """Folder for what is done, reports and flight logs; default: out/first-steps/ROBOT."""
