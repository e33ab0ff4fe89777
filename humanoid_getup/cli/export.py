"""`getup export FOLDER`: write the policy of a training as one ONNX file."""

from __future__ import annotations

from humanoid_getup.cli.errors import needing, refusing
from humanoid_getup.cli.exit_codes import DID_IT
from humanoid_getup.cli.inputs import load_robot_of
from humanoid_getup.cli.options.policies import Export
from humanoid_getup.cli.output import console_for, phase


def export(command: Export) -> int:
    """Export."""
    with phase("loading torch"), needing("train"):
        from sim2real.training.export import TrainingRecord, export_policy
    with phase("exporting"), refusing():
        training = TrainingRecord.load(command.folder)
        robot = load_robot_of(command, training.robot, f"training {command.folder}")
        exported = export_policy(training, robot, command.out)
    console_for(None).print(
        f"{command.out}: {exported.size / 1e3:.0f} kB, after {exported.iterations} iterations; "
        f"torch and onnxruntime differ by {exported.difference:.1e} at most"
    )
    return DID_IT
