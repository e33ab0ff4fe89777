"""Write a styled policy without its ankle balance, to compare both by `getup eval`.

The graph stays the same but for the changes of joint angles that turn the torso, which become zero.

    python benchmarks/without_ankle_balance.py styled --out without.onnx
    getup eval styled --n 80 --seed 32 --scene rough:medium,rough:hard
    getup eval without.onnx --n 80 --seed 32 --scene rough:medium,rough:hard
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import tyro
from onnx import numpy_helper

from humanoid_getup.policy.onnx_file import CHECKSUM_ENTRY, read_model, seal_model
from humanoid_getup.policy.onnx_policy import find_policy
from robots import load_robot
from robots.storage.files import write_atomically

ANKLES = "ankles"
"""Name of the array in the graph, a buffer of `StyledNetwork`."""


def remove_ankle_balance(model: onnx.ModelProto) -> None:
    """Let ankles add nothing to the joint targets.

    Raises:
        ValueError: if the graph has no ankle balance.
    """
    found = [values for values in model.graph.initializer if values.name == ANKLES]
    if not found:
        raise ValueError("the policy has no ankle balance")
    for values in found:
        none = np.zeros_like(numpy_helper.to_array(values))
        values.CopyFrom(numpy_helper.from_array(none, ANKLES))


def main(policy: str, /, *, out: Path, robot: str = "op3") -> None:
    """Write a styled policy without its ankle balance.

    Args:
        policy: Name of a policy of the robot, or an .onnx file.
        out: File for the policy.
        robot: Name of a robot.
    """
    content = read_model(find_policy(load_robot(robot), policy))
    model = onnx.load_model_from_string(content.rpartition(CHECKSUM_ENTRY)[0])
    remove_ankle_balance(model)
    write_atomically(out, seal_model(model.SerializeToString()))


if __name__ == "__main__":
    tyro.cli(main)
