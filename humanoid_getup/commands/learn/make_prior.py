"""`getup prior`: plan rises, and fit the pose prior of styled policies to them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console
from tyro.conf import arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import needing, refusing
from humanoid_getup.commands.files import FOLDER, READ
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.options import EngineOptions, RobotOption, Seed
from humanoid_getup.commands.pieces import make_robot_absolute, starting
from humanoid_getup.commands.values import Items
from humanoid_getup.progress.callback import ProgressMonitor
from robots.storage.validation import at_least


@dataclass(frozen=True, kw_only=True)
class PriorRequest(EngineOptions, RobotOption):
    """Plan many rises and fit the pose prior of styled policies to them."""

    out: Annotated[Path, FOLDER, arg(metavar="DIR")]
    """Folder for prior.npz, rises.npz and the planned motions; the same command continues."""
    rises: Annotated[int, at_least(4, step=4)] = 1000
    """Number of rises to plan, equally many of each class; policies add half as many."""
    policies: Annotated[tuple[str, ...], READ, Items(none=True), arg(metavar="POLICY,...")] = (
        "robust",
        "gentle",
    )
    """Policies of the robot whose rises are added; '' for none."""
    epochs: Annotated[int, at_least(1)] = 100
    """Passes over the postures."""
    fitted: Annotated[Path | None, READ, arg(metavar="FILE.npz")] = None
    """Keep a prior that was fitted before, and only collect rises."""
    seed: Seed = 0


@dataclass(frozen=True, kw_only=True)
class MadePrior:
    """Figures of a fitted pose prior."""

    rises: int
    postures: int
    size: int
    """Latent parameters."""
    unexplained: float | None
    """Share of the variance that the decoder does not explain; None for a given prior."""


@command("prior")
def make_prior(request: PriorRequest, monitor: ProgressMonitor) -> MadePrior:
    """Collect rises and fit the prior; both are written to the request's folder."""
    robot = load_robot(request)
    monitor.begin("loading torch")
    with needing("train"):
        from sim2real.pose_prior import PRIOR, RISES, PosePrior, RiseSet
        from sim2real.prior_training.collect import collect_rises, load_policy
        from sim2real.prior_training.fit import FitOptions, fit_prior
    with refusing():
        policies = {name: load_policy(robot, name) for name in request.policies if name}
        prior = PosePrior.load(request.fitted, robot) if request.fitted else None
        found = collect_rises(
            robot,
            make_robot_absolute(request.robot),
            request.rises,
            request.seed,
            request.out,
            policies,
            partial(starting, request),
            monitor,
        )
        rises = RiseSet.join(robot, found)
        errors: list[float] = []
        if prior is None:
            advance = monitor.count("epochs", request.epochs)

            def note(_epoch: int, error: float) -> None:
                errors.append(error)
                advance(1)

            options = FitOptions(epochs=request.epochs)
            prior = fit_prior(rises, request.seed, options, note)
        rises.save(request.out / RISES)
        prior.save(request.out / PRIOR)
    return MadePrior(
        rises=len(rises),
        postures=len(rises.qpos),
        size=prior.size,
        unexplained=errors[-1] if errors else None,
    )


@make_prior.show
def _print(made: MadePrior, request: PriorRequest, console: Console) -> None:
    left = made.unexplained
    fit = "" if left is None else f"; the decoder leaves {100.0 * left:.1f} % of the variance"
    console.print(
        f"{request.out}: {made.rises} rises, {made.postures} postures; {made.size} latent "
        f"parameters{fit}"
    )
