"""`getup sweep`: where a design stops getting up."""

from __future__ import annotations

from humanoid_getup.cli.look.bench import write_results
from humanoid_getup.cli.shared.console import console_for, showing
from humanoid_getup.cli.shared.repeat import hinting_resume
from humanoid_getup.jobs.requests.sweep import SWEEP_PAGE, SweepRequest
from humanoid_getup.jobs.sweep_designs import is_begun
from humanoid_getup.jobs.sweep_designs import sweep as run_sweep


def sweep(command: SweepRequest) -> int:
    """Get up with many designs; print the main figures and the place of the page."""
    with hinting_resume("sweep", command, is_begun), showing(command) as report:
        result = run_sweep(command, report)
    code = write_results(result, command)
    console_for(command).print(f"written to {command.out / SWEEP_PAGE}", markup=False)
    return code
