"""`getup robots export`: a robot for other programs."""

from __future__ import annotations

from humanoid_getup.commands.console import console_for
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.output import write_json
from humanoid_getup.jobs.requests.robots import ExportRobotRequest
from humanoid_getup.jobs.robots import export_robot as write_files


def export_robot(command: ExportRobotRequest) -> int:
    """Export, and print what the files cannot express."""
    found = write_files(command)
    write_json(found, command)
    console = console_for(command)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    written = " and ".join(map(str, found.files))
    console.print(f"{found.name}: written to {written}", markup=False, soft_wrap=True)
    return DID_IT
