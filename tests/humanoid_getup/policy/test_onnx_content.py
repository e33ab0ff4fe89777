"""A policy is one network in one file: no loops, no weights elsewhere, and sizes that fit."""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

pytest.importorskip("onnx")

import hashlib

import onnx
from nonempty import nonempty
from onnx import TensorProto, helper, numpy_helper
from tiny_policies import save_policy, weights_of

from humanoid_getup.policy import onnx_file
from humanoid_getup.policy.onnx_file import (
    CHECKSUM_ENTRY,
    CONTRACT_KEY,
    OnnxNetwork,
    read_model,
    seal_model,
)
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError, read_contract
from robots import Robot, load_robot

LOOPS = "the network has loops or branches, expected none"
ELSEWHERE = "its weights are in another file, expected all in this one"


def save_changed(file: Path, robot: Robot, change: Callable[[onnx.ModelProto], None]) -> Path:
    """Save a policy whose model was changed, with the checksum of what it is now."""
    model = onnx.load_model_from_string(save_policy(file, robot).read_bytes())
    change(model)
    del model.metadata_props[1:]  # the checksum
    file.write_bytes(seal_model(model.SerializeToString()))
    return file


def add_endless_loop(model: onnx.ModelProto) -> None:
    """Let the network's last step wait for a loop whose condition stays true."""
    graph, last, info = model.graph, model.graph.output[0].name, helper.make_tensor_value_info
    steps = [helper.make_node("Identity", [name], [f"{name}_out"]) for name in ("cond", "value")]
    bool_, float_ = TensorProto.BOOL, TensorProto.FLOAT
    inputs = [info("step", TensorProto.INT64, []), info("cond", bool_, [])]
    inputs.append(info("value", float_, None))
    outputs = [info("cond_out", bool_, []), info("value_out", float_, None)]
    body = helper.make_graph(steps, "body", inputs, outputs)
    graph.initializer.append(numpy_helper.from_array(np.array(True), "always"))
    graph.node.append(helper.make_node("Loop", ["", "always", last], ["end"], body=body))
    graph.output[0].name = "end"


def move_weights_out(model: onnx.ModelProto) -> None:
    """Name another file as the place of the first weights."""
    onnx.external_data_helper.set_external_data(model.graph.initializer[0], "weights.bin")
    model.graph.initializer[0].ClearField("raw_data")


def move_constant_out(model: onnx.ModelProto) -> None:
    tensor = numpy_helper.from_array(np.zeros(3, dtype=np.float32), "constant")
    onnx.external_data_helper.set_external_data(tensor, "constant.bin")
    tensor.ClearField("raw_data")
    model.graph.node.append(helper.make_node("Constant", [], ["unused"], value=tensor))


def add_function(model: onnx.ModelProto) -> None:
    identity = helper.make_node("Identity", ["x"], ["y"])
    opset = [helper.make_opsetid("", 18)]
    model.functions.append(helper.make_function("own", "same", ["x"], ["y"], [identity], opset))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (add_endless_loop, LOOPS),
        (move_weights_out, ELSEWHERE),
        (move_constant_out, ELSEWHERE),
        (add_function, "the model has functions, expected none"),
    ],
)
def test_what_is_no_network_in_one_file_is_refused(
    tiny: Robot, tmp_path: Path, change: Callable[[onnx.ModelProto], None], problem: str
):
    file = save_changed(tmp_path / "p.onnx", tiny, change)
    (tmp_path / "weights.bin").write_bytes(bytes(100_000))
    with pytest.raises(PolicyError) as refusal:
        OnnxPolicy.load(file, tiny)
    assert refusal.value.problems == (problem,)


def add_square(model: onnx.ModelProto, side: int, *, is_constant: bool) -> None:
    """Add the product of two matrices of a side's length, of the output or of a constant."""
    graph, last = model.graph, model.graph.output[0].name
    seed = numpy_helper.from_array(np.ones((1, 1), dtype=np.float32), "seed")
    shape = numpy_helper.from_array(np.array([side, side]), "shape")
    graph.initializer.extend([seed, shape])
    if not is_constant:
        graph.node.append(helper.make_node("ReduceMax", [last], ["one"], keepdims=1))
    wide = "seed" if is_constant else "one"
    graph.node.extend(
        [
            helper.make_node("Expand", [wide, "shape"], ["wide"]),
            helper.make_node("MatMul", ["wide", "wide"], ["square"]),
            helper.make_node("ReduceMax", ["square"], ["largest"], keepdims=1),
            helper.make_node("Add", [last, "largest"], ["end"]),
        ]
    )
    graph.output[0].name = "end"


@pytest.mark.parametrize("is_constant", [True, False])
def test_an_operator_without_end_in_sight_is_stopped(
    tiny: Robot, tmp_path: Path, is_constant: bool
):
    """A product of 20,000 x 20,000 takes minutes; 0.1 s are granted. A small one is run."""
    file = tmp_path / "p.onnx"
    save_changed(file, tiny, lambda model: add_square(model, 4, is_constant=is_constant))
    assert OnnxNetwork(file).faults == []
    save_changed(file, tiny, lambda model: add_square(model, 20_000, is_constant=is_constant))
    with pytest.raises(ValueError, match=r"^an inference takes more than 0\.1 s$"):
        OnnxNetwork(file, limit=0.1)


def test_an_inference_that_ends_its_process_or_takes_many_periods_is_refused(
    tiny: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """As when the system is out of memory, or in onnxruntime itself."""
    file = save_policy(tmp_path / "p.onnx", tiny)
    assert 0.0 < OnnxNetwork(file).inference_time < 20 * tiny.control_period
    monkeypatch.setattr(onnx_file, "_test", lambda *_: signal.raise_signal(signal.SIGKILL))
    with pytest.raises(ValueError, match=r"^an inference ends its process \(-9\)$"):
        OnnxNetwork(file)
    monkeypatch.setattr(onnx_file, "_test", lambda *_: ([], 4.8))
    message = r"an inference takes 4\.8 s, expected at most 20 control periods of 0\.008 s$"
    with pytest.raises(PolicyError, match=message):
        OnnxPolicy.load(file, tiny)


def test_a_signal_ends_the_wait_for_an_inference(
    tiny: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    came: list[int] = []

    def interrupt_parent(*_: object) -> None:
        for _ in range(1000):
            os.kill(os.getppid(), signal.SIGUSR1)
            time.sleep(0.01)

    def stop(number: int, frame: FrameType | None) -> None:
        """Interrupt the wait once: what is raised in a hook of the fork is ignored."""
        while frame is not None and frame.f_code is not Connection.recv.__code__:
            frame = frame.f_back
        if frame is not None and not came:
            came.append(number)
            raise KeyboardInterrupt

    monkeypatch.setattr(onnx_file, "_test", interrupt_parent)
    signal.signal(signal.SIGUSR1, stop)
    try:
        with pytest.raises(KeyboardInterrupt):
            OnnxNetwork(save_policy(tmp_path / "p.onnx", tiny))
    finally:
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    assert multiprocessing.active_children() == []


def save_network(file: Path, inputs: int, outputs: int, kind: int = TensorProto.FLOAT) -> Path:
    """Write a network that passes each input on, or the first one as several outputs."""
    ends = [f"out{k}" for k in range(outputs)]
    graph = helper.make_graph(
        [helper.make_node("Identity", [f"in{k % inputs}"], [end]) for k, end in enumerate(ends)],
        "identity",
        [helper.make_tensor_value_info(f"in{k}", kind, ["N", 4]) for k in range(inputs)],
        [helper.make_tensor_value_info(end, kind, ["N", 4]) for end in ends],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    helper.set_model_props(model, {CONTRACT_KEY: "{}"})
    file.write_bytes(seal_model(model.SerializeToString()))
    return file


def test_a_network_of_another_kind_is_refused(tmp_path: Path):
    for inputs, outputs, fault in (
        (1, 3, "3 outputs, expected 1, or 2 with a memory"),
        (2, 3, "2 inputs, expected 1 and 3 outputs, expected 1, or 2 with a memory"),
    ):
        with pytest.raises(ValueError, match=f"^the network has {fault}$"):
            OnnxNetwork(save_network(tmp_path / "p.onnx", inputs, outputs))


def test_a_model_that_is_newer_than_the_library_is_called_so(tmp_path: Path):
    file = save_network(tmp_path / "p.onnx", 1, 1)
    model = onnx.load(file)
    model.ir_version = 99
    del model.metadata_props[-1]  # its checksum
    file.write_bytes(seal_model(model.SerializeToString()))
    with pytest.raises(
        ValueError, match=r"^onnxruntime \S+ cannot load it: Uns.* 99, .*; expected"
    ):
        OnnxNetwork(file)


def test_every_size_and_type_that_does_not_fit_is_named(tmp_path: Path):
    network = OnnxNetwork(save_network(tmp_path / "p.onnx", 1, 2, TensorProto.DOUBLE))
    assert network.find_problems(4, 3) == ["the network has 2 outputs, expected 1"]
    assert network.find_problems(4, 3, 5) == [
        "network input: tensor(double), expected tensor(float)",
        "network output: tensor(double), expected tensor(float)",
        "network output: shape ['N', 4], expected (N, 3)",
        "network memory: tensor(double), expected tensor(float)",
        "network memory: shape ['N', 4], expected (N, 5)",
    ]


def test_without_a_memory_of_its_own_it_remembers_the_clipped_actions(tiny: Robot, tmp_path: Path):
    file = save_policy(tmp_path / "p.onnx", tiny, weight=weights_of(tiny, torque_share=1.0))
    seen = np.zeros((3, len(weights_of(tiny))), dtype=np.float32)
    seen[:, -1] = [-4.0, 0.5, 3.0]
    actions, memory = OnnxNetwork(file)(seen)
    assert actions == pytest.approx(np.array([[-4.0], [0.5], [3.0]]))
    assert memory == pytest.approx(np.array([[-1.0], [0.5], [1.0]]))


TINY = load_robot("tests/robots/tiny")


def test_no_flipped_bit_is_accepted(tmp_path: Path):
    """At every byte of the file: in graph, weights, contract and the checksum itself."""
    file = save_policy(tmp_path / "p.onnx", TINY, weight=weights_of(TINY, gyro=0.1))
    content = file.read_bytes()
    for at in nonempty(range(len(content))):
        flipped = bytearray(content)
        flipped[at] ^= 1 << at % 8
        file.write_bytes(bytes(flipped))
        with pytest.raises(ValueError):
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
