"""Imports a policy that was trained elsewhere: one file that our runner runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from humanoid_getup.jobs.errors import BadInputError, needing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.jobs.requests.policies import (
    DESCRIPTION_FILE,
    POLICY_FILE,
    ImportPolicyRequest,
)
from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    Given,
    NetworkShape,
)
from humanoid_getup.policy.foreign.fitting import fit_policy, list_notes, make_contract
from humanoid_getup.policy.foreign.reading import describe_policy, read_network
from humanoid_getup.policy.foreign.record import FOREIGN_KEY, to_record
from humanoid_getup.policy.foreign.wrapping import Wrapping, wrap_network
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, seal_model
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError, read_contract
from humanoid_getup.policy.pack import MANIFEST, POLICY, PackError, check_manifest, read_pack
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from robots import Robot
from robots.storage.encoding import to_json
from robots.storage.files import describe

if TYPE_CHECKING:
    from onnx import ModelProto


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
    """Write the policy of a request for its robot.

    Raises:
        BadInputError: naming what is missing, wrong or not possible on the robot.
        CancelledError: if ``cancel`` ended it; then nothing is written.
    """
    ImportPolicyRequest.accept(request)
    robot, monitor = load_robot(request), ProgressMonitor(report, cancel)
    monitor.begin("reading the policy")
    if request.network.is_dir() or request.network.name == MANIFEST:
        return _import_pack(request, robot, monitor)
    with needing("policies"):
        import onnx  # noqa: F401
        import yaml  # noqa: F401
    try:
        network = read_network(request.network)
        policy = _describe(request, network.shape)
        renamed = dict(pair.split("=") for pair in request.rename)
        wrapping = fit_policy(policy, robot, renamed)
    except (ForeignPolicyError, OSError) as error:
        raise BadInputError(f"policy file {request.network}: {describe(error)}") from error
    model = _build(network.model, wrapping, request.network)
    return _write(request, robot, model, _summarize(request, wrapping), monitor)


def _import_pack(
    request: ImportPolicyRequest, robot: Robot, monitor: ProgressMonitor
) -> PolicyImport:
    """Copy the file of a packed policy whose checksums are right and that fits the robot."""
    source = request.network if request.network.is_dir() else request.network.parent
    try:
        manifest, contents = read_pack(source)
        check_manifest(manifest, read_contract(source / POLICY))
    except PolicyError as error:
        raise BadInputError(str(error)) from error
    except (PackError, OSError) as error:
        missing = f"{error.filename}: " if isinstance(error, OSError) and error.filename else ""
        raise BadInputError(f"packed policy {source}: {missing}{describe(error)}") from error
    values = {
        "name": manifest.name,
        "robot": f"{manifest.robot.model}, {len(manifest.robot.joints)} joints",
        "kind": f"{manifest.kind}, from {manifest.entry_pose}",
        "rate": f"{manifest.robot.control_hz:g} Hz",
        "observation": f"{manifest.obs_len} numbers",
        "action": f"{manifest.action_len} numbers",
        "training": ", ".join(f"{key} {value}" for key, value in manifest.training.items()),
    }
    found = PolicyImport(
        file=str(request.out / POLICY_FILE),
        format="packed",
        robot=robot.name,
        fields=tuple(
            DescribedField(field=field, value=value, source=f"{MANIFEST} {field}")
            for field, value in values.items()
        ),
        joints={name: name for name in manifest.robot.joints},
        notes=(),
    )
    return _write(request, robot, contents[POLICY], found, monitor)


def _write(
    request: ImportPolicyRequest,
    robot: Robot,
    model: bytes,
    found: PolicyImport,
    monitor: ProgressMonitor,
) -> PolicyImport:
    """Write a policy and its description, if it can be loaded for the robot."""
    monitor.begin("writing the policy")
    with staging(request.out, (POLICY_FILE, DESCRIPTION_FILE)) as folder:
        file = folder / POLICY_FILE
        file.write_bytes(model)
        try:
            OnnxPolicy.load(file, robot)
        except PolicyError as error:
            problems = "; ".join(error.problems)
            raise BadInputError(f"policy file {request.network}: {problems}") from error
        (folder / DESCRIPTION_FILE).write_text(to_json(found))
        monitor.check()
    return found


def _describe(request: ImportPolicyRequest, shape: NetworkShape) -> ForeignPolicy:
    kind = ForeignFormat(request.format) if request.format else None
    given = Given(joints=request.joints, rate=request.rate, gain=request.gain)
    return describe_policy(shape, kind, [Path(file) for file in request.config], given)


def _build(model: ModelProto, wrapping: Wrapping, file: Path) -> bytes:
    """Wrap a network, and add contract and description to it."""
    from onnx import helper

    made = wrap_network(model, wrapping)
    contract = make_contract(
        wrapping, {"imported_from": str(wrapping.policy.format), "network": file.name}
    )
    properties = {CONTRACT_KEY: contract.to_json(), FOREIGN_KEY: to_record(wrapping)}
    helper.set_model_props(made, properties)
    return seal_model(made.SerializeToString())


def _summarize(request: ImportPolicyRequest, wrapping: Wrapping) -> PolicyImport:
    policy, robot = wrapping.policy, wrapping.robot
    rows = policy.describe()
    return PolicyImport(
        file=str(request.out / POLICY_FILE),
        format=str(policy.format),
        robot=robot.name,
        fields=tuple(DescribedField(field=f, value=v, source=s) for f, v, s in rows),
        joints={name: robot.joint_names[i] for name, i in wrapping.places.items()},
        notes=tuple(list_notes(wrapping)),
    )
