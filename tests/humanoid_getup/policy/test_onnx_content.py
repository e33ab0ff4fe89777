"""A policy is one network in one file: no loops, no functions, no weights elsewhere."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

import onnx
from onnx import TensorProto, helper, numpy_helper
from tiny_policies import save_policy, weights_of

from humanoid_getup.policy.onnx_content import find_content_problems
from humanoid_getup.policy.onnx_file import add_checksum
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
    file.write_bytes(model.SerializeToString())
    add_checksum(file)
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


def test_an_ordinary_policy_has_no_problems(tiny: Robot, tmp_path: Path):
    file = save_policy(tmp_path / "p.onnx", tiny, weight=weights_of(tiny, gyro=0.1))
    assert find_content_problems(file.read_bytes()) == []


def test_an_inference_without_end_in_sight_is_stopped(tiny: Robot, tmp_path: Path):
    """Each of 2,000 products of 500 x 500 takes milliseconds; 0.1 s are granted."""

    def slow_down(model: onnx.ModelProto) -> None:
        graph, last = model.graph, model.graph.output[0].name
        size = graph.output[0].type.tensor_type.shape.dim[1].dim_value
        ones = numpy_helper.from_array(np.ones((size, 500), dtype=np.float32), "widen")
        square = numpy_helper.from_array(np.eye(500, dtype=np.float32), "square")
        graph.initializer.extend([ones, square])
        graph.node.append(helper.make_node("MatMul", [last, "widen"], ["row"]))
        shape = numpy_helper.from_array(np.array([500, 500]), "shape")
        graph.initializer.append(shape)
        graph.node.append(helper.make_node("Expand", ["row", "shape"], ["m0"]))
        for k in range(2000):
            graph.node.append(helper.make_node("MatMul", [f"m{k}", "square"], [f"m{k + 1}"]))
        graph.node.append(helper.make_node("MatMul", ["m2000", "narrow"], ["end"]))
        narrow = numpy_helper.from_array(np.ones((500, size), dtype=np.float32), "narrow")
        graph.initializer.append(narrow)
        graph.output[0].name = "end"

    file = save_changed(tmp_path / "p.onnx", tiny, slow_down)
    network = OnnxNetwork(file)
    size = len(weights_of(tiny))
    assert network.try_out(size, limit=0.1) == ["an inference takes more than 0.1 s"]
