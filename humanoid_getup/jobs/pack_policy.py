"""Packs a policy for others: its file, a manifest, and the checksum of every file."""

from __future__ import annotations

from humanoid_getup.jobs.errors import BadInputError, refusing
from humanoid_getup.jobs.inputs import load_robot
from humanoid_getup.jobs.output_files import staging
from humanoid_getup.jobs.policies import load_policy, name_robot
from humanoid_getup.jobs.requests.policies import PackPolicyRequest
from humanoid_getup.policy.onnx_policy import find_policy
from humanoid_getup.policy.pack import (
    EVALUATION,
    MANIFEST,
    POLICY,
    Manifest,
    PackError,
    make_manifest,
)
from humanoid_getup.progress.callback import Cancel, ProgressMonitor, Report
from robots.storage.encoding import to_json
from robots.storage.files import describe, read_bounded


def pack_policy(
    request: PackPolicyRequest, report: Report | None = None, cancel: Cancel | None = None
) -> Manifest:
    """Write a folder with the policy of a request, as it runs on its robot, and a manifest.

    Raises:
        BadInputError: if the policy does not fit its robot, or the evaluation is none.
        CancelledError: if ``cancel`` ended it; then nothing is written.
    """
    PackPolicyRequest.accept(request)
    monitor = ProgressMonitor(report, cancel)
    monitor.begin("loading")
    request = name_robot(request, request.policy)
    robot = load_robot(request)
    policy = load_policy(robot, request.policy, None)
    with refusing():
        file = find_policy(robot, request.policy)
        contents = {POLICY: file.read_bytes()}
    if request.evaluation is not None:
        contents[EVALUATION] = _read_evaluation(request)
    try:
        manifest = make_manifest(
            policy.contract,
            contents,
            name=request.name or file.stem,
            kind=request.kind,
            entry_pose=request.entry,
            description=request.description,
        )
    except PackError as error:
        raise BadInputError(f"--evaluation is {request.evaluation}: {error}") from error
    monitor.begin("writing")
    with staging(request.out, (POLICY, EVALUATION, MANIFEST)) as folder:
        for name, content in contents.items():
            (folder / name).write_bytes(content)
        (folder / MANIFEST).write_text(to_json(manifest))
        monitor.check()
    return manifest


def _read_evaluation(request: PackPolicyRequest) -> bytes:
    assert request.evaluation is not None
    try:
        return read_bounded(request.evaluation, 2**22)
    except (OSError, ValueError) as error:
        raise BadInputError(f"--evaluation is {request.evaluation}: {describe(error)}") from error
