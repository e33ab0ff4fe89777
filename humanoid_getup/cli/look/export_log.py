"""`getup log export LOG`: a flight log for other programs."""

from __future__ import annotations

import shlex

from humanoid_getup.cli.shared.console import console_for, showing
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.jobs.export_log import export_log as write_bag
from humanoid_getup.jobs.requests.logs import ExportLogRequest


def export_log(command: ExportLogRequest) -> int:
    """Export, and print what the bag contains."""
    with showing(command) as report:
        found = write_bag(command, report)
    write_json(found, command)
    console = console_for(command)
    cut = f", cut off or damaged: {found.lost_bytes} bytes lost" if found.truncated else ""
    console.print(f"{found.robot}, {found.started}, {found.duration_s:.2f} s{cut}", markup=False)
    for topic, count in found.topics.items():
        console.print(f" {topic}: {count} messages", markup=False)
    following = f"ros2 bag info {shlex.quote(str(found.bag))}"
    console.print(f"written to {found.bag}; next: {following}", markup=False, soft_wrap=True)
    return DID_IT
