"""Imports a clip of motion capture as a motion of a robot."""

from __future__ import annotations

import math

from humanoid_getup.clips.clip_file import read_clip
from humanoid_getup.commands.errors import refusing
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.jobs.requests.motions import ClipRequest
from humanoid_getup.motions.mocap.retarget_clip import ClipRetargeter, RetargetedClip
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report


def import_clip(
    request: ClipRequest, report: Report | None = None, cancel: Cancel | None = None
) -> RetargetedClip:
    """Retarget the clip, and write the motion to the request's target.

    Raises:
        BadInputError: if the clip cannot be used.
        CancelledError: if ``cancel`` ended it; then nothing is written.
    """
    ClipRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    monitor.begin("reading")
    with refusing():
        clip = read_clip(request.clip, request.skeleton, request.rate, request.up)
        found = ClipRetargeter(robot).retarget(
            clip,
            name=request.motion_name,
            begin=request.begin or 0.0,
            end=math.inf if request.end is None else request.end,
            finish=request.finish,
            report=lambda share: monitor.begin(f"pointing the limbs: {share:.0%}"),
        )
        request.target.parent.mkdir(parents=True, exist_ok=True)
        found.motion.save(request.target)
    return found
