"""Networks that were trained elsewhere, wrapped so that our one runner runs them.

Graph nodes before the network turn our observation into its own: they reorder joints, count angles
from its posture, clip, scale and keep past steps. Nodes behind it turn its actions into shares of
ours. Nothing of observation or action is written twice.

The memory of the wrapped network is, from one policy step to the next: 1 (0 before the first
step), its last raw action (k), its last observation (size).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto, NodeProto, TensorProto, ValueInfoProto, compose, helper, numpy_helper

from humanoid_getup.policy.action import ActionMode, ActionSpec
from humanoid_getup.policy.foreign.description import (
    COMMAND,
    ForeignPolicy,
    ForeignRecord,
    Window,
)
from humanoid_getup.policy.observation import list_terms
from robots import Robot
from robots.quaternion import Array

PREFIX = "foreign_"  # of the names in the network that is wrapped


@dataclass(frozen=True, kw_only=True, eq=False)
class Wrapping:
    """Linear maps between a robot's observations and actions and those of a policy."""

    robot: Robot
    policy: ForeignPolicy
    places: dict[str, int]
    """The robot's joints by the policy's names."""
    action: ActionSpec

    @property
    def memory(self) -> int:
        """Return the size of the memory."""
        return 1 + len(self.policy.moved) + self.policy.observation_size

    def find_starts(self) -> dict[str, int]:
        """Return where the terms of our observation begin, and its size under ""."""
        terms = list_terms(self.robot, self.action, memory=self.memory)
        ends = itertools.accumulate((term.size for term in terms), initial=0)
        return dict(zip((*(term.name for term in terms), ""), ends, strict=True))

    def present(self) -> tuple[Array, Array]:
        """Return the map from our observation to the policy's present terms: (S, C) and (C,)."""
        starts, terms = self.find_starts(), self.policy.observation
        joints = np.array([self.places[name] for name in self.policy.joints])
        matrix = np.zeros((starts[""], sum(term.size for term in terms)))
        offset, end = np.zeros(matrix.shape[1]), 0
        for term in terms:
            columns = end + np.arange(term.size)
            end += term.size
            if term.quantity == COMMAND:
                continue
            # The memory begins with a 1.
            rows = np.arange(term.size) + (term.quantity == "last_action")
            rows = joints if term.quantity in ("joint_pos", "joint_vel") else rows
            matrix[starts[term.quantity] + rows, columns] = 1.0
            if term.quantity == "joint_pos":
                zero = self.policy.default_pos if term.is_offset else 0.0
                offset[columns] = self.robot.standing.joint_pos[joints] - zero
        return matrix, offset

    def windows(self) -> tuple[Array, Array, Array]:
        """Return the maps to the policy's observation, each to (F,).

        They are that of the present terms (C, F), that of the last observation (F, F), and that
        of the present terms into all past steps (C, F), which counts at the first step.
        """
        size = self.policy.observation_size
        newest, first = np.zeros((2, sum(term.size for term in self.policy.observation), size))
        shift, start, at = np.zeros((size, size)), 0, 0
        for term in self.policy.observation:
            own = np.arange(term.size)
            for _ in range(term.history - 1):
                first[start + own, at + own] = 1.0
                shift[at + term.size + own, at + own] = 1.0
                at += term.size
            newest[start + own, at + own] = 1.0
            start, at = start + term.size, at + term.size
        return newest, shift, first

    def actions(self) -> tuple[Array, Array]:
        """Return factor and offset from a target [rad] to an action of ours, (k,) each."""
        joints = [self.places[name] for name in self.policy.moved]
        scale, home = self.action.scale[joints], np.zeros(len(joints))
        if self.policy.mode is ActionMode.ABSOLUTE:
            home = self.robot.standing.joint_pos[joints]
        return 1.0 / scale, -home / scale

    def to_record(self) -> str:
        """Write what the checks of an imported policy need, as JSON."""
        policy, names = self.policy, self.robot.joint_names
        windows = (
            Window(name=t.name, quantity=t.quantity, size=t.size, history=t.history)
            for t in policy.observation
        )
        record = ForeignRecord(
            format=policy.format,
            joints=tuple(names[self.places[name]] for name in policy.joints),
            moved=tuple(names[self.places[name]] for name in policy.moved),
            windows=tuple(windows),
            scale=tuple(policy.scale.tolist()),
            damping=() if policy.damping is None else tuple(policy.damping.tolist()),
        )
        return msgspec.json.encode(record).decode()


def wrap_network(model: ModelProto, wrapping: Wrapping) -> ModelProto:
    """Return a model that maps our observations to our actions and to its memory."""
    inner = compose.add_prefix(model, PREFIX)
    (entry,) = find_inputs(inner)
    has_one_row = entry.type.tensor_type.shape.dim[0].HasField("dim_value")
    batch, size = 1 if has_one_row else "robots", wrapping.find_starts()[""]
    graph = _GraphBuilder()
    seen = _observe(graph, wrapping)
    graph.nodes.append(helper.make_node("Identity", [seen], [entry.name]))
    graph.nodes.extend(inner.graph.node)
    raw = inner.graph.output[0].name
    _act(graph, wrapping, raw)
    ones = graph.add("Add", graph.matmul("obs", np.zeros((size, 1))), np.ones(1))
    graph.nodes.append(helper.make_node("Concat", [ones, raw, seen], ["memory"], axis=1))
    sizes = {"obs": size, "actions": wrapping.action.size, "memory": wrapping.memory}
    first, *others = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [batch, size])
        for name, size in sizes.items()
    )
    made = helper.make_graph(
        graph.nodes,
        "wrapped_policy",
        [first],
        others,
        [*graph.constants, *inner.graph.initializer],
        sparse_initializer=list(inner.graph.sparse_initializer),
    )
    return helper.make_model(made, opset_imports=inner.opset_import, ir_version=inner.ir_version)


def find_inputs(model: ModelProto) -> list[ValueInfoProto]:
    """Return the inputs of a network; old files list constants as inputs, too."""
    constants = {each.name for each in model.graph.initializer}
    return [each for each in model.graph.input if each.name not in constants]


def _observe(graph: _GraphBuilder, wrapping: Wrapping) -> str:
    """Add nodes that build the policy's observation; return its name."""
    matrix, offset = wrapping.present()
    terms = wrapping.policy.observation
    sizes = [term.size for term in terms]
    present = graph.clip(
        graph.add("Add", graph.matmul("obs", matrix), offset),
        np.repeat([term.lower for term in terms], sizes),
        np.repeat([term.upper for term in terms], sizes),
    )
    present = graph.add("Mul", present, np.concatenate([term.scale for term in terms]))
    if all(term.history == 1 for term in terms):
        return present
    newest, shift, first = wrapping.windows()
    start = wrapping.find_starts()["last_action"]
    begun = graph.add("Gather", "obs", np.arange(start, start + 1), axis=1)
    seen = start + 1 + len(wrapping.policy.moved)
    last = graph.add("Gather", "obs", np.arange(seen, start + wrapping.memory), axis=1)
    is_first = graph.add("Sub", np.ones(1), begun)
    past = graph.add("Mul", graph.matmul(present, first), is_first)
    held = graph.add("Add", graph.matmul(last, shift), past)
    return graph.add("Add", graph.matmul(present, newest), held)


def _act(graph: _GraphBuilder, wrapping: Wrapping, raw: str) -> None:
    """Add nodes that turn the policy's raw actions into ours."""
    policy = wrapping.policy
    target = graph.add("Mul", raw, policy.scale)
    if policy.mode is ActionMode.ABSOLUTE:
        target = graph.add("Add", target, policy.offset)
    if policy.limits is not None:
        target = graph.clip(target, *policy.limits)
    factor, offset = wrapping.actions()
    share = graph.add("Add", graph.add("Mul", target, factor), offset)
    graph.nodes.append(helper.make_node("Identity", [share], ["actions"]))


class _GraphBuilder:
    """Collects nodes and constants; every node has one output."""

    def __init__(self) -> None:
        self.nodes: list[NodeProto] = []
        self.constants: list[TensorProto] = []
        self._names = (f"wrap_{number}" for number in itertools.count())

    def add(self, operation: str, *inputs: str | NDArray[Any], **attributes: Any) -> str:
        """Add a node whose inputs are names or constants; return the name of its output."""
        names = [each if isinstance(each, str) else self._constant(each) for each in inputs]
        output = next(self._names)
        self.nodes.append(helper.make_node(operation, names, [output], **attributes))
        return output

    def matmul(self, vector: str, matrix: Array) -> str:
        """Multiply a vector by a constant matrix."""
        return self.add("MatMul", vector, matrix)

    def clip(self, vector: str, lower: Array, upper: Array) -> str:
        """Clip a vector to ranges, if any is finite."""
        if np.isfinite(lower).any():
            vector = self.add("Max", vector, lower)
        return self.add("Min", vector, upper) if np.isfinite(upper).any() else vector

    def _constant(self, values: NDArray[Any]) -> str:
        name = next(self._names)
        is_whole = np.issubdtype(values.dtype, np.integer)
        array = values.astype(np.int64 if is_whole else np.float32)
        self.constants.append(numpy_helper.from_array(array, name))
        return name
