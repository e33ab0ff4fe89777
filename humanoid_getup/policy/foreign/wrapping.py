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
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.action import ActionMode, ActionSpec
from humanoid_getup.policy.foreign.description import ForeignPolicy, ForeignTerm, Quantity
from humanoid_getup.policy.observation import Term, list_terms
from robots import Robot
from robots.quaternion import Array

if TYPE_CHECKING:
    from onnx import ModelProto

PREFIX = "foreign_"  # of the names in the network that is wrapped
PLACES = {
    Quantity.GYRO: "gyro",
    Quantity.GRAVITY: "gravity",
    Quantity.JOINT_POS: "joint_pos",
    Quantity.JOINT_VEL: "joint_vel",
    Quantity.LAST_ACTION: "last_action",
}
"""Terms of our observation that hold the quantities; commands are zero."""


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

    @property
    def terms(self) -> tuple[Term, ...]:
        """Return the terms of our observation."""
        return list_terms(self.robot, self.action, memory=self.memory)

    def find_place(self, name: str) -> int:
        """Return where a term of our observation begins."""
        before = itertools.takewhile(lambda term: term.name != name, self.terms)
        return sum(term.size for term in before)

    def present(self) -> tuple[Array, Array]:
        """Return the map from our observation to the policy's present terms: (S, C) and (C,)."""
        blocks = [self._map_term(term) for term in self.policy.observation]
        return (
            np.concatenate([matrix for matrix, _ in blocks], axis=1),
            np.concatenate([offset for _, offset in blocks]),
        )

    def _map_term(self, term: ForeignTerm) -> tuple[Array, Array]:
        matrix = np.zeros((sum(each.size for each in self.terms), term.size))
        offset = np.zeros(term.size)
        if term.quantity is Quantity.COMMAND:
            return matrix, offset
        rows = self._find_rows(term)
        matrix[rows, np.arange(term.size)] = 1.0
        if term.quantity is Quantity.JOINT_POS:
            joints = [self.places[name] for name in self.policy.joints]
            zero = self.policy.default_pos if term.is_offset else 0.0
            offset = self.robot.standing.joint_pos[joints] - zero
        return matrix, offset

    def _find_rows(self, term: ForeignTerm) -> NDArray[np.int_]:
        """Find the entries of our observation that a term consists of."""
        start = self.find_place(PLACES[term.quantity])
        if term.quantity in (Quantity.JOINT_POS, Quantity.JOINT_VEL):
            return start + np.array([self.places[joint] for joint in self.policy.joints])
        first = 1 if term.quantity is Quantity.LAST_ACTION else 0  # the memory begins with a 1
        return start + first + np.arange(term.size)

    def windows(self) -> tuple[Array, Array, Array]:
        """Return the maps to the policy's observation, each to (F,).

        They are that of the present terms (C, F), that of the last observation (F, F), and that
        of the present terms into all past steps (C, F), which counts at the first step.
        """
        size = self.policy.observation_size
        present = sum(term.size for term in self.policy.observation)
        newest, first = np.zeros((2, present, size))
        shift, start = np.zeros((size, size)), 0
        for term, window in self.policy.windows():
            own = np.arange(term.size)
            for step in range(term.history):
                at = window.start + step * term.size + own
                is_newest = step == term.history - 1
                (newest if is_newest else first)[start + own, at] = 1.0
                if not is_newest:
                    shift[at + term.size, at] = 1.0
            start += term.size
        return newest, shift, first

    def actions(self) -> tuple[Array, Array]:
        """Return factor and offset from a target [rad] to an action of ours, (k,) each."""
        joints = [self.places[name] for name in self.policy.moved]
        scale = self.action.scale[joints]
        is_absolute = self.policy.mode is ActionMode.ABSOLUTE
        home = self.robot.standing.joint_pos[joints] if is_absolute else np.zeros(len(joints))
        return 1.0 / scale, -home / scale


def wrap_network(model: ModelProto, wrapping: Wrapping) -> ModelProto:
    """Return a model that maps our observations to our actions and to its memory."""
    from onnx import compose, helper

    inner = compose.add_prefix(model, PREFIX)
    graph = _GraphBuilder()
    size = sum(term.size for term in wrapping.terms)
    seen = _observe(graph, wrapping)
    batch = _find_batch(inner)
    graph.nodes.append(helper.make_node("Identity", [seen], [find_input(inner).name]))
    graph.nodes.extend(inner.graph.node)
    raw = _act(graph, wrapping, inner.graph.output[0].name)
    ones = graph.add("Add", graph.matmul("obs", np.zeros((size, 1))), np.ones(1))
    graph.nodes.append(helper.make_node("Concat", [ones, raw, seen], ["memory"], axis=1))
    made = helper.make_graph(
        graph.nodes,
        "wrapped_policy",
        [_vector("obs", batch, size)],
        [
            _vector("actions", batch, wrapping.action.size),
            _vector("memory", batch, wrapping.memory),
        ],
        [*graph.constants, *inner.graph.initializer],
        sparse_initializer=list(inner.graph.sparse_initializer),
    )
    return helper.make_model(made, opset_imports=inner.opset_import, ir_version=inner.ir_version)


def find_input(model: ModelProto) -> Any:
    """Return the one input of a network; old files list constants as inputs, too."""
    constants = {each.name for each in model.graph.initializer}
    return next(each for each in model.graph.input if each.name not in constants)


def _observe(graph: _GraphBuilder, wrapping: Wrapping) -> str:
    """Add nodes that build the policy's observation; return its name."""
    matrix, offset = wrapping.present()
    terms = wrapping.policy.observation
    present = graph.add("Add", graph.matmul("obs", matrix), offset)
    present = graph.clip(
        present,
        np.concatenate([np.full(term.size, term.lower) for term in terms]),
        np.concatenate([np.full(term.size, term.upper) for term in terms]),
    )
    present = graph.add("Mul", present, np.concatenate([term.scale for term in terms]))
    if all(term.history == 1 for term in terms):
        return present
    newest, shift, first = wrapping.windows()
    begun, last = _split_memory(graph, wrapping)
    is_first = graph.add("Sub", np.ones(1), begun)
    past = graph.add("Mul", graph.matmul(present, first), is_first)
    held = graph.add("Add", graph.matmul(last, shift), past)
    return graph.add("Add", graph.matmul(present, newest), held)


def _split_memory(graph: _GraphBuilder, wrapping: Wrapping) -> tuple[str, str]:
    """Add nodes that read from the memory whether there was a step, and the last observation."""
    start = wrapping.find_place("last_action")
    seen = start + 1 + len(wrapping.policy.moved)
    return (
        graph.take("obs", np.arange(start, start + 1)),
        graph.take("obs", np.arange(seen, start + wrapping.memory)),
    )


def _act(graph: _GraphBuilder, wrapping: Wrapping, output: str) -> str:
    """Add nodes that turn the policy's actions into ours; return the name of the raw ones."""
    from onnx import helper

    policy, limit = wrapping.policy, wrapping.policy.action_limit
    raw = graph.clip(output, np.full(len(policy.moved), -limit), np.full(len(policy.moved), limit))
    target = graph.add("Mul", raw, policy.scale)
    if policy.mode is ActionMode.ABSOLUTE:
        target = graph.add("Add", target, policy.offset)
    if policy.lower is not None and policy.upper is not None:
        target = graph.clip(target, policy.lower, policy.upper)
    factor, offset = wrapping.actions()
    share = graph.add("Add", graph.add("Mul", target, factor), offset)
    graph.nodes.append(helper.make_node("Identity", [share], ["actions"]))
    return raw


def _find_batch(model: ModelProto) -> int | str:
    """Return the fixed batch size of a network, or a name for any size."""
    size = find_input(model).type.tensor_type.shape.dim[0]
    return 1 if size.HasField("dim_value") else "robots"


def _vector(name: str, batch: int | str, size: int) -> Any:
    from onnx import TensorProto, helper

    return helper.make_tensor_value_info(name, TensorProto.FLOAT, [batch, size])


class _GraphBuilder:
    """Collects nodes and constants; every node has one output."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []
        self._names = (f"wrap_{number}" for number in range(10_000))

    def add(self, operation: str, *inputs: str | NDArray[Any], **attributes: Any) -> str:
        """Add a node whose inputs are names or constants; return the name of its output."""
        from onnx import helper

        names = [each if isinstance(each, str) else self._constant(each) for each in inputs]
        output = next(self._names)
        self.nodes.append(helper.make_node(operation, names, [output], **attributes))
        return output

    def matmul(self, vector: str, matrix: Array) -> str:
        """Multiply a vector by a constant matrix."""
        return self.add("MatMul", vector, matrix)

    def take(self, vector: str, places: NDArray[np.int_]) -> str:
        """Take entries of a vector."""
        return self.add("Gather", vector, places, axis=1)

    def clip(self, vector: str, lower: Array, upper: Array) -> str:
        """Clip a vector to ranges, if any is finite."""
        if np.isfinite(lower).any():
            vector = self.add("Max", vector, lower)
        return self.add("Min", vector, upper) if np.isfinite(upper).any() else vector

    def _constant(self, values: NDArray[Any]) -> str:
        from onnx import numpy_helper

        name = next(self._names)
        is_whole = np.issubdtype(values.dtype, np.integer)
        array = values.astype(np.int64 if is_whole else np.float32)
        self.constants.append(numpy_helper.from_array(array, name))
        return name
