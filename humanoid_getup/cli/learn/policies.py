"""`getup policy import` and `check`: policies of other projects."""

from __future__ import annotations

from humanoid_getup.commands.console import console_for, do
from humanoid_getup.commands.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.jobs.foreign_policy import check_policy as compare
from humanoid_getup.jobs.foreign_policy import import_policy as read_and_write
from humanoid_getup.jobs.requests.learning import CheckPolicyRequest, ImportPolicyRequest


def import_policy(command: ImportPolicyRequest) -> int:
    """Import a policy; print its description with sources, and notes."""
    found = do(read_and_write, command)
    console = console_for(command)
    console.print(f"{command.network}: {found.format}, for robot '{found.robot}'", markup=False)
    for row in found.fields:
        text = f"  {row.field}: {row.value} ({row.source})"
        console.print(text, markup=False, soft_wrap=True)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    run = f"getup run {found.file} --robot {command.robot} --from supine"
    console.print(f"written to {command.out}; next: {run}", markup=False, soft_wrap=True)
    return DID_IT


def check_policy(command: CheckPolicyRequest) -> int:
    """Compare a policy with a trace; print a line for observations and one for actions."""
    found = do(compare, command)
    console = console_for(command)
    for compared in found.comparisons:
        console.print(compared.describe(), markup=False, soft_wrap=True)
    return DID_IT if found.agrees else DID_NOT_STAND
