"""A policy is one network in one file: no loops, no functions, no weights elsewhere."""

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

import onnx
from onnx import TensorProto, helper, numpy_helper
from tiny_policies import save_policy

from humanoid_getup.policy import onnx_network
from humanoid_getup.policy.onnx_file import NetworkError, seal_model
from humanoid_getup.policy.onnx_network import OnnxNetwork
from humanoid_getup.policy.onnx_policy import OnnxPolicy, PolicyError
from robots import Robot

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
    graph, last = model.graph, model.graph.output[0].name
    body = helper.make_graph(
        [helper.make_node("Identity", [name], [f"{name}_out"]) for name in ("cond", "value")],
        "body",
        [
            helper.make_tensor_value_info("step", TensorProto.INT64, []),
            helper.make_tensor_value_info("cond", TensorProto.BOOL, []),
            helper.make_tensor_value_info("value", TensorProto.FLOAT, None),
        ],
        [
            helper.make_tensor_value_info("cond_out", TensorProto.BOOL, []),
            helper.make_tensor_value_info("value_out", TensorProto.FLOAT, None),
        ],
    )
    graph.initializer.append(numpy_helper.from_array(np.array(True), "always"))
    loop = helper.make_node("Loop", ["", "always", last], ["end"], body=body)
    graph.node.append(loop)
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
    with pytest.raises(NetworkError, match=r"^an inference takes more than 0\.1 s$"):
        OnnxNetwork(file, limit=0.1)


def test_an_inference_that_ends_its_process_is_a_fault_of_the_file(
    tiny: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """As when the system is out of memory, or in onnxruntime itself."""
    monkeypatch.setattr(onnx_network, "_test", lambda *_: signal.raise_signal(signal.SIGKILL))
    with pytest.raises(NetworkError, match=r"^an inference ends its process \(-9\)$"):
        OnnxNetwork(save_policy(tmp_path / "p.onnx", tiny))


def test_a_policy_that_takes_many_periods_for_an_inference_is_refused(
    tiny: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    file = save_policy(tmp_path / "p.onnx", tiny)
    took = OnnxNetwork(file).inference_time
    assert 0.0 < took < 20 * tiny.control_period
    monkeypatch.setattr(onnx_network, "_test", lambda *_: ([], 4.8))
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

    monkeypatch.setattr(onnx_network, "_test", interrupt_parent)
    signal.signal(signal.SIGUSR1, stop)
    try:
        with pytest.raises(KeyboardInterrupt):
            OnnxNetwork(save_policy(tmp_path / "p.onnx", tiny))
    finally:
        signal.signal(signal.SIGUSR1, signal.SIG_IGN)
    assert multiprocessing.active_children() == []
