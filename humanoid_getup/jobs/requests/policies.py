"""Requests about policies of others: import, check, pack."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from humanoid_getup.jobs.requests.files import READ, Written
from humanoid_getup.jobs.requests.shared import RobotOption
from humanoid_getup.jobs.requests.values import Items, between

POLICY_FILE, DESCRIPTION_FILE = "policy.onnx", "description.json"
Format = Literal["mjlab", "microduck", "unitree", "isaac", "legged-gym"]


@dataclass(frozen=True, kw_only=True)
class ImportPolicyRequest(RobotOption):
    """Make a policy that was trained elsewhere one that runs here.

    What describes it is read from its metadata or its configuration file, each field with its
    source; nothing in these files is run.
    """

    network: Annotated[Positional[Path], READ, arg(metavar="FILE")]
    """Network that was trained elsewhere (.onnx)."""
    out: Annotated[Path, Written((POLICY_FILE, DESCRIPTION_FILE)), arg(metavar="DIR")]
    """Folder for policy.onnx and description.json."""
    format: Annotated[Format | None, arg(name="from")] = None
    """Project that it comes from; default: guessed from its metadata or --config."""
    config: Annotated[tuple[str, ...], READ, arg(metavar="FILE,...")] = ()
    """Its deploy.yaml, env.yaml or config.py; for legged_gym with the files of base classes."""
    joints: Annotated[tuple[str, ...], arg(metavar="NAME,...")] = ()
    """Names of its joints where files only number them: in the order of the motors for a
    deploy.yaml, of the simulator for an env.yaml."""
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
