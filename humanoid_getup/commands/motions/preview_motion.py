"""`getup motions preview`: the keys of a motion, drawn and played once as they are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.markup import escape
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND
from humanoid_getup.commands.files import PICTURE, READ, check_file
from humanoid_getup.commands.inputs import find_keyframes, load_robot
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.reporting.film_strip import NoRendererError, draw_trial
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World


@dataclass(frozen=True, kw_only=True)
class PreviewRequest(RobotOption):
    """Draw the keys of a motion, play them once as they are, and print the outcome.

    Above, each key without physics; below, the rollout, undisturbed and at full torque.
    """

    name: Positional[str]
    """Name of a motion in the keyframes."""
    keyframes: Annotated[Path | None, READ, arg(metavar="FILE")] = None
    """Keyframes file (.toml); default: the robot's keyframes.toml."""
    picture: Annotated[Path | None, PICTURE, arg(metavar="FILE.png")] = None
    """Picture to write; default: NAME.png."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviewedMotion:
    """Outcome of keys that are played as they are."""

    trial: Trial
    picture: Path
    undrawn: str = ""
    """Reason why there is no picture; "" if there is one."""


@command("motions preview")
def preview(request: PreviewRequest, monitor: ProgressMonitor) -> PreviewedMotion:
    """Play the keys of a motion once, undisturbed and at full torque, and draw them."""
    robot = load_robot(request)
    (keyframes,) = find_keyframes(robot, [request.name], request.keyframes)
    picture = request.picture or Path(f"{keyframes.name}.png")
    check_file(picture)
    monitor.begin("playing the keys")
    trial = try_out(World(robot, FLAT_SCENE), keyframes)
    monitor.begin("drawing")
    try:
        draw_trial(trial, picture)
    except NoRendererError as error:
        return PreviewedMotion(trial=trial, picture=picture, undrawn=str(error))
    return PreviewedMotion(trial=trial, picture=picture)


@preview.show
def _print(found: PreviewedMotion, _: PreviewRequest, console: Console) -> int:
    trial = found.trial
    console.print(f"{trial.keyframes.name}, as it is: {escape(trial.describe())}")
    drawn = f"no film strip: {found.undrawn}" if found.undrawn else f"film strip in {found.picture}"
    console.print(drawn, markup=False)
    return DID_IT if trial.succeeded else DID_NOT_STAND
