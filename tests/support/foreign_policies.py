"""Policies as other projects export them, small enough to be written by hand."""

import json
from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper

JOINTS = ("right_hip_joint", "head_joint", "left_hip_joint")
"""The joints of the nodding robot, as others call and order them."""
THEIRS, OURS = [1, 2, 0], [2, 0, 1]
"""Brings joints from the robot's order (left, right, head) to theirs, and back: a cycle, whose
inverse is another one."""
DEFAULT = (0.1, 0.3, -0.2)
SCALE = (0.3, 0.4, 0.5)
RATE = 62.5  # Hz; two control periods of the nodding robot
PLAIN = ("base_ang_vel", "projected_gravity", "joint_pos", "joint_vel", "actions")
SIZES = (3, 3, 3, 3, 3)


def save_network(
    file: Path, weight: np.ndarray, metadata: dict[str, str] | None = None, batch: int | str = "N"
) -> Path:
    """Write a network that multiplies its input by a matrix, with metadata."""
    sizes = weight.shape
    graph = helper.make_graph(
        [helper.make_node("MatMul", ["obs", "weight"], ["actions"])],
        "foreign",
        [helper.make_tensor_value_info("obs", TensorProto.FLOAT, [batch, sizes[0]])],
        [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [batch, sizes[1]])],
        [numpy_helper.from_array(np.float32(weight), "weight")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    helper.set_model_props(model, metadata or {})
    file.write_bytes(model.SerializeToString())
    return file


def weights(size: int = sum(SIZES), seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, 0.02, (size, len(JOINTS)))


def mjlab_metadata(**changes: str) -> dict[str, str]:
    """Lists with commas, as its exporter writes them."""
    made = {
        "run_path": "none",
        "joint_names": ",".join(JOINTS),
        "joint_stiffness": "2.000,3.000,4.000",
        "joint_damping": "0.100,0.200,0.300",
        "default_joint_pos": "0.100,0.300,-0.200",
        "command_names": "",
        "observation_names": ",".join(PLAIN),
        "action_scale": "0.300,0.400,0.500",
    }
    return {key: value for key, value in {**made, **changes}.items() if value is not None}


def microduck_metadata(**changes) -> dict[str, str]:
    record = {
        "schema_version": 1,
        "control_hz": RATE,
        "joint_names": JOINTS,
        "default_joint_pos": DEFAULT,
        "action_scale": 0.4,
        "kp_fw": 200,
        "observation": list(zip(PLAIN, SIZES, strict=True)),
    }
    return {"microduck": json.dumps({**record, **changes})}


ENV = """\
sim: {dt: 0.004}
decimation: 4
scene:
  robot:
    init_state:
      joint_pos: {right_.*: 0.1, head_joint: 0.3, left_hip_joint: -0.2}
    actuators:
      hips:
        joint_names_expr: [.*_hip_.*]
        stiffness: {right_.*: 2.0, left_.*: 4.0}
        damping: 0.1
      neck:
        joint_names_expr: [head_joint]
        stiffness: {.*: 3.0}
        damping: 0.1
observations:
  policy:
    concatenate_terms: true
    history_length: null
    turn: {func: "isaaclab.envs.mdp.observations:base_ang_vel", clip: null, scale: 0.2}
    down: {func: "isaaclab.envs.mdp.observations:projected_gravity", clip: null, scale: null}
    angles: {func: "isaaclab.envs.mdp.observations:joint_pos_rel", scale: null}
    speeds: {func: "isaaclab.envs.mdp.observations:joint_vel_rel", scale: 0.05}
    before: {func: "isaaclab.envs.mdp.observations:last_action"}
actions:
  joint_pos:
    class_type: isaaclab.envs.mdp.actions.joint_actions:JointPositionAction
    joint_names: [.*]
    scale: {right_.*: 0.3, head_.*: 0.4, left_.*: 0.5}
    offset: 0.0
    use_default_offset: true
  gripper: null
rewards: !!python/object/apply:builtins.slice [null, null, null]
"""
