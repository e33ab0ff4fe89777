"""`getup prior`, `train` and `export`: from planned rises to a policy in one file."""

from __future__ import annotations

from humanoid_getup.commands.console import console_for, showing
from humanoid_getup.commands.exit_codes import DID_IT
from humanoid_getup.jobs.make_prior import make_prior as make
from humanoid_getup.jobs.requests.learning import ExportRequest, PriorRequest, TrainRequest
from humanoid_getup.jobs.train_policy import export as write_policy
from humanoid_getup.jobs.train_policy import train as learn

CHECKPOINT = "checkpoint.pt"


def make_prior(command: PriorRequest) -> int:
    """Collect rises, fit the prior, write both."""
    with showing() as report:
        made = make(command, report)
    left = made.unexplained
    fit = "" if left is None else f"; the decoder leaves {100.0 * left:.1f} % of the variance"
    console_for().print(
        f"{command.out}: {made.rises} rises, {made.postures} postures; {made.size} latent "
        f"parameters{fit}"
    )
    return DID_IT


def train(command: TrainRequest) -> int:
    """Train, or continue a training."""
    try:
        with showing() as report:
            trained = learn(command, report)
    except KeyboardInterrupt as interrupt:
        if (command.out / CHECKPOINT).exists():
            hint = "the last checkpoint is kept: the same command continues from it"
        else:
            hint = "there is no checkpoint yet: the same command starts again"
        raise KeyboardInterrupt(hint) from interrupt
    if trained.leads:
        console_for().print(f"{command.out}: {trained}")
        if trained.recent and not trained.is_learning:
            console_for().print(
                f"{trained.assess()}; the same command with more --iterations continues",
                markup=False,
            )
    return DID_IT


def export(command: ExportRequest) -> int:
    """Export."""
    with showing() as report:
        exported = write_policy(command, report)
    console_for().print(
        f"{command.out}: {exported.size / 1e3:.0f} kB, after {exported.iterations} iterations; "
        f"torch and onnxruntime differ by {exported.difference:.1e} at most"
    )
    return DID_IT
