"""Plays the keys of a motion once as they are, and draws them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import find_keyframes, load_robot
from humanoid_getup.commands.output_files import find_file_problems
from humanoid_getup.jobs.requests.motions import PreviewRequest
from humanoid_getup.motions.build import try_out
from humanoid_getup.motions.trial import Trial
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from humanoid_getup.reporting.film_strip import NoRendererError
from humanoid_getup.reporting.motion_strip import draw_trial
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.world import World


@dataclass(frozen=True, kw_only=True, eq=False)
class PreviewedMotion:
    """Outcome of keys that are played as they are."""

    trial: Trial
    picture: Path
    undrawn: str
    """Reason why there is no picture; "" if there is one."""


def preview(
    request: PreviewRequest, report: Report | None = None, cancel: Cancel | None = None
) -> PreviewedMotion:
    """Play the keys of a motion once, undisturbed and at full torque, and draw them.

    Raises:
        BadInputError: if there are no such keys, or the picture cannot be written.
        CancelledError: if ``cancel`` ended it; then nothing is drawn.
    """
    PreviewRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    (keyframes,) = find_keyframes(robot, [request.name], request.keyframes)
    picture, undrawn = request.picture or Path(f"{keyframes.name}.png"), ""
    if problems := find_file_problems(picture):
        raise BadInputError("; ".join(problems))
    monitor.begin("playing the keys")
    trial = try_out(World(robot, FLAT_SCENE), keyframes)
    monitor.begin("drawing")
    try:
        draw_trial(trial, picture)
    except NoRendererError as error:
        undrawn = str(error)
    return PreviewedMotion(trial=trial, picture=picture, undrawn=undrawn)
