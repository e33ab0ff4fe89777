"""`getup fall`: drop a limp robot, and write how it lies."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from tyro.conf import arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.files import WRITTEN
from humanoid_getup.commands.inputs import FALL, find_start, load_world
from humanoid_getup.commands.options import LoadOption, SceneOptions
from humanoid_getup.progress.callback import ProgressMonitor
from robots.description.posture_file import format_posture
from robots.storage.files import write_atomically


@dataclass(frozen=True, kw_only=True)
class FallRequest(LoadOption, SceneOptions):
    """Drop a limp robot until it comes to lie on a side, and write how it lies as a posture file.

    `getup rise --from FILE` with the same options gets it up as `getup rise --from SIDE` does.
    """

    origin: Annotated[
        Literal["supine", "prone", "left", "right"],
        arg(name="from", help="Side on which the robot comes to lie."),
    ]
    out: Annotated[Path | None, WRITTEN, arg(metavar="FILE.json")] = None
    """Posture file to write."""

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        if self.out is None and not getattr(self, "json", None):
            yield "--out is missing, expected a posture file to write, or --json -"


@command("fall", json=True)
def fall(request: FallRequest, monitor: ProgressMonitor) -> dict[str, Any]:
    """Drop a robot; return the content of the posture file, which is written as requested."""
    monitor.begin("falling")
    world = load_world(request)
    lying = find_start(world, request.origin, np.random.default_rng(request.seed), monitor.tell)
    record = json.loads(format_posture(lying.posture, world.robot)) | {FALL: request.origin}
    if request.out is not None:
        request.out.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(request.out, json.dumps(record, indent=1) + "\n")
        monitor.tell(
            f"{world.robot.name} lies {lying.start_class}, seed {request.seed}: {request.out}"
        )
    return record
