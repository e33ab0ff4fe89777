"""Packed policies: a folder with the policy file, a manifest, and the checksum of every file."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any, Literal

import msgspec

from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.onnx_file import MAX_BYTES
from robots.storage.encoding import as_kept, to_json
from robots.storage.files import describe, read_bounded

MANIFEST, POLICY, EVALUATION = "manifest.json", "policy.onnx", "eval.json"
SCHEMA = 1
MAX_MANIFEST = 2**20  # bytes

Kind = Literal["episodic", "perpetual"]
EntryPosture = Literal["lying", "supine", "prone", "left", "right", "standing", "any"]


class PackError(ValueError):
    """A packed policy is damaged or incomplete; the message is one line."""


class PackedFile(msgspec.Struct, frozen=True, kw_only=True):
    """A file of a packed policy."""

    file: Literal["policy.onnx", "eval.json"]
    sha256: str
    size: int = msgspec.field(name="bytes")


class PackedRobot(msgspec.Struct, frozen=True, kw_only=True):
    """The robot of a packed policy."""

    model: str
    joints: tuple[str, ...]
    control_hz: float
    """Policy steps per second."""


class Manifest(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a packed policy is."""

    schema_version: int = SCHEMA
    name: str
    description: str = ""
    kind: Kind
    """Whether it ends by itself, episodic, or goes on until it is stopped."""
    entry_pose: EntryPosture
    """How the robot is when it begins."""
    robot: PackedRobot
    obs_len: int
    action_len: int
    training: dict[str, Any]
    """How it was made: the provenance of its contract."""
    eval: dict[str, Any] | None = None
    """For each case of an evaluation, how many of n falls ended standing."""
    files: tuple[PackedFile, ...]
    sha256: str = ""
    """Checksum of the manifest with this text empty."""

    def sealed(self) -> Manifest:
        """Return it with its own checksum."""
        blank = msgspec.structs.replace(self, sha256="")
        return msgspec.structs.replace(self, sha256=_digest(to_json(blank).encode()))


def make_manifest(
    contract: PolicyContract,
    contents: dict[str, bytes],
    *,
    name: str,
    kind: Kind,
    entry_pose: EntryPosture,
    description: str = "",
) -> Manifest:
    """Make the manifest of a policy from its contract and the contents of its files.

    Raises:
        PackError: if the evaluation is not what `getup eval` writes.
    """
    files = [
        PackedFile(file=file, sha256=_digest(content), size=len(content))  # type: ignore[arg-type]
        for file, content in contents.items()
    ]
    return Manifest(
        name=name,
        description=description,
        kind=kind,
        entry_pose=entry_pose,
        robot=_describe_robot(contract),
        obs_len=contract.observation_size,
        action_len=contract.action.size,
        training=contract.provenance,
        eval=_read_evaluation(contents[EVALUATION]) if EVALUATION in contents else None,
        files=tuple(files),
    ).sealed()


def check_manifest(manifest: Manifest, contract: PolicyContract) -> None:
    """Refuse a manifest that says of its policy what the contract does not.

    Raises:
        PackError: naming what differs.
    """
    wrong = [
        name
        for name, found, wanted in (
            ("robot", manifest.robot, _describe_robot(contract)),
            ("obs_len", manifest.obs_len, contract.observation_size),
            ("action_len", manifest.action_len, contract.action.size),
            ("training", manifest.training, as_kept(contract.provenance)),
        )
        if found != wanted
    ]
    if wrong:
        raise PackError(f"{MANIFEST}: {', '.join(wrong)}: not as in the contract of {POLICY}")
    texts = (manifest.name, manifest.description)
    if not all(text.isprintable() for text in texts):
        raise PackError(f"{MANIFEST}: name or description cannot be printed, expected one line")


def read_pack(folder: Path) -> tuple[Manifest, dict[str, bytes]]:
    """Read a packed policy, and compare every checksum.

    Raises:
        OSError: if a file cannot be read.
        PackError: naming the file that differs, or what is wrong with the manifest.
    """
    manifest = _read_manifest(folder / MANIFEST)
    contents = {each.file: _read(folder / each.file, MAX_BYTES) for each in manifest.files}
    changed = [each.file for each in manifest.files if _digest(contents[each.file]) != each.sha256]
    if changed:
        raise PackError(f"{', '.join(changed)}: sha256 differs from {MANIFEST}: it was changed")
    if POLICY not in contents:
        raise PackError(f"{MANIFEST} lists no {POLICY}")
    return manifest, contents


def _describe_robot(contract: PolicyContract) -> PackedRobot:
    return PackedRobot(model=contract.robot, joints=contract.joints, control_hz=contract.rate_hz)


def _read_manifest(file: Path) -> Manifest:
    try:
        manifest = msgspec.json.decode(_read(file, MAX_MANIFEST), type=Manifest)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise PackError(f"{MANIFEST} is malformed: {describe(error)}") from error
    if manifest.schema_version != SCHEMA:
        raise PackError(f"{MANIFEST} has schema {manifest.schema_version}, expected {SCHEMA}")
    if manifest.sealed() != manifest:
        raise PackError(f"{MANIFEST}: sha256 differs from its content: it was changed")
    return manifest


def _read_evaluation(content: bytes) -> dict[str, Any]:
    """Read how many falls ended standing, by case."""
    try:
        cases = msgspec.json.decode(content)["cases"]
        return {
            str(label): {"n": int(case["all"]["n"]), "stood": int(case["all"]["stood"])}
            for label, case in cases.items()
        }
    except (msgspec.MsgspecError, LookupError, TypeError, ValueError, AttributeError) as error:
        raise PackError("it holds no result of `eval`, as that writes with --json") from error


def _read(file: Path, most: int) -> bytes:
    try:
        return read_bounded(file, most)
    except ValueError as error:
        raise PackError(f"{file.name}: {error}") from error


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
