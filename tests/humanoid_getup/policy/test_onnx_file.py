"""The checksum of a policy file: no changed bit is accepted."""

import hashlib
from pathlib import Path

import pytest
from nonempty import nonempty

pytest.importorskip("onnx")

import onnx
from tiny_policies import save_policy, weights_of

from humanoid_getup.policy.onnx_file import (
    CHECKSUM_ENTRY,
    NetworkError,
    read_model,
)
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError, read_contract
from robots import Robot, load_robot

TINY = load_robot("tests/robots/tiny")


def test_no_flipped_bit_is_accepted(tmp_path: Path):
    """At every byte of the file: in graph, weights, contract and the checksum itself."""
    file = save_policy(tmp_path / "p.onnx", TINY, weight=weights_of(TINY, gyro=0.1))
    content = file.read_bytes()
    for at in nonempty(range(len(content))):
        flipped = bytearray(content)
        flipped[at] ^= 1 << at % 8
        file.write_bytes(bytes(flipped))
        with pytest.raises(NetworkError):
            read_model(file)


def test_the_shipped_policies_are_valid_onnx_and_load(op3: Robot):
    for file in nonempty(sorted(Path(op3.folder, "policies").glob("*.onnx"))):
        onnx.checker.check_model(onnx.load(str(file)))
        policy = OnnxPolicy.load(file, op3, op3.control_period)
        assert policy.failure is None
        assert repr(policy).startswith("OnnxPolicy(op3: gravity, ")


def test_a_policy_without_a_checksum_is_refused_with_what_to_do(tmp_path: Path):
    file = save_policy(tmp_path / "p.onnx", TINY)
    file.write_bytes(file.read_bytes().rpartition(CHECKSUM_ENTRY)[0])
    with pytest.raises(PolicyError, match="no checksum: export it again with `getup export`"):
        OnnxPolicy.load(file, TINY, TINY.control_period)


def test_a_checksum_that_a_shipped_policy_tells_is_that_of_a_shipped_file():
    for robot in ("op3", "wolfgang"):
        files = [*Path(load_robot(robot).folder, "policies").iterdir()]
        shipped = {hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
        told = [read_contract(file).provenance for file in files if file.suffix == ".onnx"]
        sums = {value for facts in told for key, value in facts.items() if key.endswith("sha256")}
        assert told
        assert sums <= shipped, robot
