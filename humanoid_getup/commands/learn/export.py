"""`getup export`: the policy of a training, in one ONNX file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import needing, refusing
from humanoid_getup.commands.files import MADE, ROBOT
from humanoid_getup.commands.inputs import load_robot_of
from humanoid_getup.commands.options import RobotOption
from humanoid_getup.progress.callback import ProgressMonitor

if TYPE_CHECKING:
    from sim2real.training.export import Exported


@dataclass(frozen=True, kw_only=True)
class ExportRequest(RobotOption):
    """Export the policy of a training, as far as it has come, to one ONNX file."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the training."""
    out: Annotated[Path, MADE, arg(metavar="FILE")]
    """ONNX file to write; an existing file is replaced."""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: the training's."""


@command("export")
def export(request: ExportRequest, monitor: ProgressMonitor) -> Exported:
    """Export the policy of a training, as far as it has come, to one ONNX file."""
    monitor.begin("loading torch")
    with needing("train"):
        from sim2real.training.config import TrainingRecord
        from sim2real.training.export import export_policy
    monitor.begin("exporting")
    with refusing():
        training = TrainingRecord.load(request.folder)
        robot = load_robot_of(request, training.robot, f"training {request.folder}")
        return export_policy(training, robot, request.out)


@export.show
def _print(exported: Exported, request: ExportRequest, console: Console) -> None:
    console.print(
        f"{request.out}: {exported.size / 1e3:.0f} kB, after {exported.iterations} iterations; "
        f"torch and onnxruntime differ by {exported.difference:.1e} at most"
    )
