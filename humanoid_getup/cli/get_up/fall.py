"""`getup fall`: drops a limp robot, and writes how it lies."""

from __future__ import annotations

import json

import numpy as np

from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.inputs import FALL, find_start, load_world
from humanoid_getup.jobs.requests.rise import FallRequest
from robots.description.posture_file import format_posture
from robots.storage.files import write_atomically


def fall(command: FallRequest) -> int:
    """Write the posture of a sampled fall; return the exit code."""
    FallRequest.accept(command)
    world = load_world(command)
    lying = find_start(world, command.origin, np.random.default_rng(command.seed))
    record = json.loads(format_posture(lying.posture, world.robot)) | {FALL: command.origin}
    write_json(record, command)
    if command.out is not None:
        command.out.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(command.out, json.dumps(record, indent=1) + "\n")
        console_for(command).print(
            f"{world.robot.name} lies {lying.start_class}, seed {command.seed}: {command.out}",
            markup=False,
            soft_wrap=True,
        )
    return DID_IT
