"""`getup robots import`: a robot folder from a model file."""

from __future__ import annotations

from humanoid_getup.commands.console import console_for, showing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.commands.output import write_json
from humanoid_getup.jobs.import_robot import import_robot as make_folder
from humanoid_getup.jobs.requests.robots import ImportRequest


def import_robot(command: ImportRequest) -> int:
    """Import the model, and report findings and guesses."""
    with showing(command) as report:
        found = make_folder(command, report)
    write_json(found, command)
    console = console_for(command)
    console.print(
        f"{found.name}: {found.dof} joints, {found.mass:.2f} kg, torso '{found.torso}', servos "
        f"{', '.join(found.servos)} at {found.supply_voltage:g} V",
        markup=False,
    )
    for title, lines in (("note", found.notes), ("guessed", found.guesses)):
        for line in lines:
            console.print(f"{title}: {line}", markup=False)
    console.print(f"written to {command.out}; next: getup robots check {command.out}", markup=False)
    return DID_IT
