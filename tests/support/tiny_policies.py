"""Policies small enough to be written by hand: a matrix, a bias, and what follows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from drivers import State
from humanoid_getup.policy.action import ActionSpec, build_action_spec, build_posture_spec
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.observation import StyleInput, list_terms
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, seal_model
from robots import Robot, quaternion


def actions_of(robot: Robot) -> ActionSpec:
    """Let the first joint of each mirrored pair that rises move both sides."""
    return build_action_spec(robot, robot.rising_joints or robot.joint_names[:1])


def contract_of(made_for: Robot, **changes) -> PolicyContract:
    made = PolicyContract.of(made_for, actions_of(made_for), made_for.control_period, {"seed": 0})
    return change(made, **changes)


def change(contract: PolicyContract, **changes) -> PolicyContract:
    """Replace fields of a contract or of its action."""
    action = {key: changes.pop(key) for key in list(changes) if hasattr(contract.action, key)}
    return replace(contract, action=replace(contract.action, **action), **changes)


def save_policy(
    file: Path,
    robot: Robot,
    *,
    weight: np.ndarray | None = None,
    bias: np.ndarray | float = 0.0,
    then: tuple[str, ...] = (),
    contract: str | None = "",
) -> Path:
    """Write ``then(observation @ weight + bias)``; an empty contract is the right one."""
    size = sum(term.size for term in list_terms(robot, actions_of(robot)))
    k = actions_of(robot).size
    if weight is None:
        weight = np.zeros((size, k))
    bias = np.broadcast_to(np.asarray(bias, dtype=float), weight.shape[1:])
    nodes = [helper.make_node("Gemm", ["obs", "weight", "bias"], ["h0"])]
    nodes += [helper.make_node(op, [f"h{i}"], [f"h{i + 1}"]) for i, op in enumerate(then)]
    values = {"weight": weight, "bias": bias}
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("obs", TensorProto.FLOAT, ["N", weight.shape[0]])],
        [helper.make_tensor_value_info(f"h{len(then)}", TensorProto.FLOAT, ["N", weight.shape[1]])],
        [numpy_helper.from_array(np.float32(value), name) for name, value in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    if contract is not None:
        text = contract or contract_of(robot).to_json()
        helper.set_model_props(model, {CONTRACT_KEY: text})
    file.write_bytes(seal_model(model.SerializeToString()))
    return file


def weights_of(robot: Robot, **terms: np.ndarray | float) -> np.ndarray:
    """Make a matrix that gives some terms of the observation a weight, and the others none."""
    action = actions_of(robot)
    rows = [
        np.broadcast_to(terms.get(term.name, 0.0), (term.size, action.size))
        for term in list_terms(robot, action)
    ]
    return np.concatenate(rows)


def save_styled_policy(file: Path, robot: Robot, *, memory: np.ndarray | None = None) -> Path:
    """Write a policy with style curves that stands still; ``memory`` is what it remembers.

    That is a matrix, (size of the observation, m), by which the observation is multiplied; zeros
    for two numbers if there is none.
    """
    action = build_posture_spec(robot)
    style = StyleInput(memory=2 if memory is None else memory.shape[1])
    size = sum(term.size for term in list_terms(robot, action, style))
    values = {
        "stand": np.zeros((size, action.size)),
        "keep": np.zeros((size, 2)) if memory is None else memory,
    }
    real = TensorProto.FLOAT
    graph = helper.make_graph(
        [
            helper.make_node("MatMul", ["obs", "stand"], ["actions"]),
            helper.make_node("MatMul", ["obs", "keep"], ["memory"]),
        ],
        "styled",
        [helper.make_tensor_value_info("obs", real, ["N", size])],
        [
            helper.make_tensor_value_info("actions", real, ["N", action.size]),
            helper.make_tensor_value_info("memory", real, ["N", style.memory]),
        ],
        [numpy_helper.from_array(np.float32(value), name) for name, value in values.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    contract = PolicyContract.of(robot, action, robot.control_period, {"seed": 0}, style)
    helper.set_model_props(model, {CONTRACT_KEY: contract.to_json()})
    file.write_bytes(seal_model(model.SerializeToString()))
    return file


def state_of(robot: Robot, time: float = 0.0, **changes) -> State:
    """A robot at rest in its standing posture."""
    still = State(
        time=time,
        joint_pos=robot.standing.joint_pos,
        joint_vel=np.zeros(robot.n),
        joint_current=np.zeros(robot.n),
        gyro=np.zeros(3),
        orientation=quaternion.IDENTITY,
        temperature=np.full(robot.n, 30.0),
        voltage=12.0,
    )
    return replace(still, **changes)
