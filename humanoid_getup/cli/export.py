"""`getup export FOLDER`: write the policy of a training as one ONNX file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.cli.errors import BadInputError, needing, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.options import RobotOption
from humanoid_getup.cli.output import console_for, find_file_faults, phase


@dataclass(frozen=True, kw_only=True)
class Export(RobotOption):
    """Export the policy of a training, as far as it has come, to one ONNX file."""

    folder: Annotated[Positional[Path], arg(metavar="FOLDER")]
    """Folder of the training."""
    out: Annotated[Path, arg(metavar="FILE")]
    """ONNX file to write; an existing file is replaced."""

    def run(self) -> int:
        """Export."""
        if faults := find_file_faults(self.out):
            raise BadInputError("; ".join(faults))
        robot = self.load_robot()
        with phase("loading torch"), needing("train"):
            from sim2real.training.export import Training, export_policy
        with phase("exporting"), refusing():
            export = export_policy(Training.load(self.folder), robot, self.out)
        console_for(None).print(
            f"{self.out}: {export.size / 1e3:.0f} kB, after {export.iterations} iterations; "
            f"torch and onnxruntime differ by {export.difference:.1e} at most"
        )
        return DID_IT
