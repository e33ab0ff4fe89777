"""`getup policy import` and `check`: a policy that was trained elsewhere, and its traces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
from rich.console import Console
from tyro.conf import Positional, arg

from humanoid_getup.commands.command import command
from humanoid_getup.commands.errors import DID_IT, DID_NOT_STAND, BadInputError, needing
from humanoid_getup.commands.files import READ, ROBOT, Written, staging
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.options import PolicyName, RobotOption
from humanoid_getup.commands.policies import load_policy, name_robot
from humanoid_getup.commands.values import Items
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.foreign.description import FOREIGN_KEY
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, seal_model
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError
from humanoid_getup.policy.parity import Comparison, compare_policy, load_trace
from humanoid_getup.progress.callback import ProgressMonitor
from robots.storage.encoding import to_json
from robots.storage.validation import between, reading

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

    def _find_problems(self) -> Iterator[str]:
        yield from super()._find_problems()
        wrong = [pair for pair in self.rename if len(pair.split("=")) != 2 or "" in pair.split("=")]
        if wrong:
            yield f"--rename is {', '.join(wrong)}, expected THEIRS=OURS,..."


class DescribedField(msgspec.Struct, frozen=True, kw_only=True):
    """A property of an imported policy, and where it comes from."""

    field: str
    value: str
    source: str


class PolicyImport(msgspec.Struct, frozen=True, kw_only=True):
    """What was imported, and from where each property comes."""

    file: str
    format: str
    robot: str
    fields: tuple[DescribedField, ...]
    joints: dict[str, str]
    """The robot's joints by the policy's names."""
    notes: tuple[str, ...]
    """What differs from the training, or was assumed."""


@command("policy import", json=True)
def import_policy(request: ImportPolicyRequest, monitor: ProgressMonitor) -> PolicyImport:
    """Write the policy of a request for its robot."""
    robot = load_robot(request)
    monitor.begin("reading the policy")
    with needing("policies"):
        import yaml  # noqa: F401
        from onnx import helper

        from humanoid_getup.policy.foreign.reading import describe_policy, read_network
        from humanoid_getup.policy.foreign.wrapping import fit_policy, wrap_network
    with reading(f"policy file {request.network}", BadInputError):
        network = read_network(request.network)
        policy = describe_policy(
            network, request.config, joints=request.joints, rate=request.rate, gain=request.gain
        )
        wrapping = fit_policy(policy, robot, dict(pair.split("=") for pair in request.rename))
    made = wrap_network(network.model, wrapping)
    provenance = {"imported_from": policy.format, "network": request.network.name}
    contract = PolicyContract.of(
        robot, wrapping.action, robot.control_period, provenance, memory=wrapping.memory
    )
    properties = {CONTRACT_KEY: contract.to_json(), FOREIGN_KEY: wrapping.to_record()}
    helper.set_model_props(made, properties)
    found = PolicyImport(
        file=str(request.out / POLICY_FILE),
        format=policy.format,
        robot=robot.name,
        fields=tuple(DescribedField(field=f, value=v, source=s) for f, v, s in policy.describe()),
        joints={name: robot.joint_names[i] for name, i in wrapping.places.items()},
        notes=tuple(wrapping.list_notes()),
    )
    monitor.begin("writing the policy")
    with staging(request.out, (POLICY_FILE, DESCRIPTION_FILE)) as folder:
        (folder / POLICY_FILE).write_bytes(seal_model(made.SerializeToString()))
        try:
            OnnxPolicy.load(folder / POLICY_FILE, robot)
        except PolicyError as error:
            problems = "; ".join(error.problems)
            raise BadInputError(f"policy file {request.network}: {problems}") from error
        (folder / DESCRIPTION_FILE).write_text(to_json(found))
        monitor.check()
    return found


@import_policy.show
def _print(found: PolicyImport, request: ImportPolicyRequest, console: Console) -> None:
    console.print(f"{request.network}: {found.format}, for robot '{found.robot}'", markup=False)
    for row in found.fields:
        text = f"  {row.field}: {row.value} ({row.source})"
        console.print(text, markup=False, soft_wrap=True)
    for note in found.notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    run = f"getup run {found.file} --robot {request.robot} --from supine"
    console.print(f"written to {request.out}; next: {run}", markup=False, soft_wrap=True)


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


class PolicyCheck(msgspec.Struct, frozen=True, kw_only=True):
    """How a policy compares with a trace."""

    agrees: bool
    steps: int
    """Policy steps of the trace."""
    comparisons: tuple[Comparison, ...]


@command("policy check", json=True)
def check_policy(request: CheckPolicyRequest, monitor: ProgressMonitor) -> PolicyCheck:
    """Compare observations and actions of the policy of a request with those of a trace."""
    monitor.begin("comparing")
    request = name_robot(request, request.policy)
    robot = load_robot(request)
    policy = load_policy(robot, request.policy, None)
    with reading(f"trace {request.trace}", BadInputError):
        trace = load_trace(request.trace, robot)
        comparisons = compare_policy(policy, trace)
    return PolicyCheck(
        agrees=all(compared.agrees for compared in comparisons),
        steps=len(trace["time"]),
        comparisons=comparisons,
    )


@check_policy.show
def _print_check(found: PolicyCheck, _: CheckPolicyRequest, console: Console) -> int:
    for compared in found.comparisons:
        console.print(compared.describe(), markup=False, soft_wrap=True)
    return DID_IT if found.agrees else DID_NOT_STAND
