"""Trains a get-up policy, and exports it to one ONNX file."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from humanoid_getup.jobs.errors import BadInputError, needing, refusing
from humanoid_getup.jobs.inputs import load_robot, load_robot_of
from humanoid_getup.jobs.requests.learning import ExportRequest, TrainRequest
from humanoid_getup.jobs.trained_policy import TrainedPolicy
from humanoid_getup.motions.motion_database import list_motions
from humanoid_getup.progress.callback import Cancel, Progress, ProgressMonitor, Report
from humanoid_getup.simulation.physics_engine import PhysicsEngine

if TYPE_CHECKING:
    from sim2real.training.export import Exported
    from sim2real.training.iteration_log import TrainReport


def train(
    request: TrainRequest, report: Report | None = None, cancel: Cancel | None = None
) -> TrainedPolicy:
    """Train into the request's folder, or continue the training in it.

    Raises:
        BadInputError: if the folder, a parent or a prior cannot be used, or torch is missing.
        CancelledError: if ``cancel`` ended it; the last checkpoint is kept.
    """
    TrainRequest.accept(request)
    parent, prior = request.parent, request.prior
    if parent is not None and not parent.is_dir() and parent.suffix != ".onnx":
        raise BadInputError(
            f"--parent is {parent}, expected the folder of a training, or a policy file"
        )
    if prior is not None and not prior.is_dir():
        raise BadInputError(f"--prior is {prior}, expected the folder of a pose prior")
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    monitor.begin("loading torch")
    with needing("train"):
        from sim2real.training.config import RECIPES
        from sim2real.training.distributed import DistributedProcess
        from sim2real.training.train import TrainingInputs, check_inputs, train
    _check_device(request.device)
    if request.physics == "warp":
        monitor.begin("loading mujoco-warp, whose kernels compile for minutes the first time")
        with needing("warp"):
            PhysicsEngine("warp").load()
    recipe = RECIPES[request.recipe]
    recipe = replace(
        recipe,
        iterations=request.iterations or recipe.iterations,
        robots=request.robots or recipe.robots,
        overlap=request.overlap,
        physics=request.physics,
    )
    motions = len(list_motions(robot))
    leads = DistributedProcess.from_environment(os.environ).leads
    trained = TrainedPolicy(leads=leads, motions=motions, lift=recipe.lift)

    def note(each: TrainReport) -> None:
        if said := trained.note(each):
            monitor.tell(said)
        text = f"{trained.describe()}, {each.steps / max(each.seconds, 1e-9):,.0f} steps/s"
        done = each.iteration + 1
        monitor.show(Progress(phase="training", done=done, total=recipe.iterations, note=text))

    inputs = TrainingInputs(
        parent=parent, prior=prior, device=request.device, threads=request.threads
    )
    with refusing():
        robot.require_imu_site()
        check_inputs(robot, recipe, request.out, parent, prior, request.device)
        train(robot, recipe, request.seed, request.out, inputs, note)
    return trained


def export(
    request: ExportRequest, report: Report | None = None, cancel: Cancel | None = None
) -> Exported:
    """Export the policy of a training, as far as it has come, to one ONNX file.

    Raises:
        BadInputError: if the folder is of no training, or torch is missing.
        CancelledError: if ``cancel`` ended it; then nothing is written.
    """
    ExportRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading torch")
    with needing("train"):
        from sim2real.training.config import TrainingRecord
        from sim2real.training.export import export_policy
    monitor.begin("exporting")
    with refusing():
        training = TrainingRecord.load(request.folder)
        robot = load_robot_of(request, training.robot, f"training {request.folder}")
        return export_policy(training, robot, request.out)


def _check_device(device: str) -> None:
    from torch import cuda

    has_gpu = cuda.is_available()
    name, _, number = device.partition(":")
    is_numbered = number.isdecimal() or device == name
    if is_numbered and (name == "cpu" or (name == "cuda" and has_gpu)):
        return
    expected = "cpu or cuda" if has_gpu else "cpu: torch finds no GPU here"
    raise BadInputError(f"--device is '{device}', expected {expected}")
