"""Imports a policy that was trained elsewhere: one file that our runner runs."""

from __future__ import annotations

import msgspec

from humanoid_getup.commands.errors import BadInputError, needing
from humanoid_getup.commands.inputs import load_robot
from humanoid_getup.commands.output_files import staging
from humanoid_getup.commands.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.learning import (
    DESCRIPTION_FILE,
    POLICY_FILE,
    CheckPolicyRequest,
    ImportPolicyRequest,
)
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.foreign.description import FOREIGN_KEY
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, seal_model
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError
from humanoid_getup.policy.parity import Comparison, compare_policy, load_trace
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from robots.storage.encoding import to_json
from robots.storage.files import describe


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


def import_policy(
    request: ImportPolicyRequest, report: Report | None = None, cancel: Cancel | None = None
) -> PolicyImport:
    """Write the policy of a request for its robot."""
    ImportPolicyRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    monitor.begin("reading the policy")
    with needing("policies"):
        import yaml  # noqa: F401
        from onnx import helper

        from humanoid_getup.policy.foreign.reading import describe_policy, read_network
        from humanoid_getup.policy.foreign.wrapping import fit_policy, wrap_network
    try:
        network = read_network(request.network)
        policy = describe_policy(
            network,
            request.config,
            joints=request.joints,
            rate=request.rate,
            gain=request.gain,
        )
        wrapping = fit_policy(policy, robot, dict(pair.split("=") for pair in request.rename))
    except (ValueError, OSError) as error:
        raise BadInputError(f"policy file {request.network}: {describe(error)}") from error
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


class PolicyCheck(msgspec.Struct, frozen=True, kw_only=True):
    """How a policy compares with a trace."""

    agrees: bool
    steps: int
    """Policy steps of the trace."""
    comparisons: tuple[Comparison, ...]


def check_policy(
    request: CheckPolicyRequest, report: Report | None = None, cancel: Cancel | None = None
) -> PolicyCheck:
    """Compare observations and actions of the policy of a request with those of a trace."""
    CheckPolicyRequest.accept(request)
    ProgressMonitor(report, cancel).begin("comparing")
    request = name_robot(request, request.policy)
    robot = load_robot(request)
    policy = load_policy(robot, request.policy, None)
    try:
        trace = load_trace(request.trace, robot)
        comparisons = compare_policy(policy, trace)
    except (ValueError, OSError) as error:
        raise BadInputError(f"trace {request.trace}: {describe(error)}") from error
    return PolicyCheck(
        agrees=all(compared.agrees for compared in comparisons),
        steps=len(trace["time"]),
        comparisons=comparisons,
    )
