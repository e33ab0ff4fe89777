"""Requests to make a pose prior, to train, to export and to evaluate a policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from humanoid_getup.commands.files import READ, ROBOT, Written
from humanoid_getup.commands.options import (
    PolicyName,
    RobotOption,
)
from humanoid_getup.commands.values import Items, between

MOST_THREADS = 256
POLICY_FILE, DESCRIPTION_FILE = "policy.onnx", "description.json"


@dataclass(frozen=True, kw_only=True)
class ImportPolicyRequest(RobotOption):
    """Make a policy that was trained elsewhere one that runs here.

    What describes it is read from its metadata (mjlab, microduck) or from Isaac Lab's env.yaml,
    each field with its source; nothing in these files is run.
    """

    network: Annotated[Positional[Path], READ, arg(metavar="FILE")]
    """Network that was trained elsewhere (.onnx)."""
    out: Annotated[Path, Written((POLICY_FILE, DESCRIPTION_FILE)), arg(metavar="DIR")]
    """Folder for policy.onnx and description.json."""
    config: Annotated[Path | None, READ, arg(metavar="FILE.yaml")] = None
    """Isaac Lab's env.yaml, for a policy that was trained with it."""
    joints: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Names of its joints in the order of the simulator, which an env.yaml does not state."""
    rename: Annotated[tuple[str, ...], Items(), arg(metavar="THEIRS=OURS,...")] = ()
    """Joints that the robot calls otherwise; sides (left, l) and the word joint need none."""
    rate: Annotated[float | None, between(0.1, 10_000.0, "Hz"), arg(metavar="HZ")] = None
    """Policy steps per second [Hz]; default: what is described, or 50 for mjlab."""
    gain: Annotated[float | None, between(1e-3, 1e4, "N·m/rad"), arg(metavar="N·m/rad")] = None
    """Position gain of all joints in its training [N·m/rad]; default: what is described."""

    def find_problems(self) -> list[str]:
        """Report names without an equals sign as well."""
        problems = super().find_problems()
        wrong = [pair for pair in self.rename if len(pair.split("=")) != 2 or "" in pair.split("=")]
        if wrong:
            problems.append(f"--rename is {', '.join(wrong)}, expected THEIRS=OURS,...")
        return problems


@dataclass(frozen=True, kw_only=True)
class CheckPolicyRequest(RobotOption):
    """Compare a policy with a trace of it: observations and actions.

    Terms and joints that differ are named, each with its likely cause.
    """

    policy: Positional[PolicyName]
    trace: Annotated[Path, READ, arg(metavar="FILE.npz")]
    """What the program that trained it measured, observed and did, policy step by policy step."""
    robot: Annotated[str, ROBOT] = ""
    """Name of a robot, or a folder with a robot.toml; default: that of a policy file, else op3."""
