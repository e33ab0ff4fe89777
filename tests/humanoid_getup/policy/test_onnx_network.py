"""The network of a policy file: its inputs, its outputs, and what it remembers."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

import onnx
from onnx import TensorProto, helper
from tiny_policies import save_policy, weights_of

from humanoid_getup.policy.onnx_file import CONTRACT_KEY, NetworkError, seal_model
from humanoid_getup.policy.onnx_network import OnnxNetwork
from robots import Robot


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


@pytest.mark.parametrize(
    ("inputs", "outputs", "fault"),
    [
        (2, 1, "2 inputs, expected 1"),
        (1, 3, "3 outputs, expected 1, or 2 with a memory"),
        (2, 3, "2 inputs, expected 1 and 3 outputs, expected 1, or 2 with a memory"),
    ],
)
def test_a_network_of_another_kind_is_refused(
    tmp_path: Path, inputs: int, outputs: int, fault: str
):
    with pytest.raises(NetworkError, match=f"^the network has {fault}$"):
        OnnxNetwork(save_network(tmp_path / "p.onnx", inputs, outputs))


def test_a_model_that_is_newer_than_the_library_is_called_so(tmp_path: Path):
    file = save_network(tmp_path / "p.onnx", 1, 1)
    model = onnx.load(file)
    model.ir_version = 99
    del model.metadata_props[-1]  # its checksum
    file.write_bytes(seal_model(model.SerializeToString()))
    with pytest.raises(
        NetworkError, match=r"^onnxruntime \S+ cannot load it: Uns.* 99, .*; expected"
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
