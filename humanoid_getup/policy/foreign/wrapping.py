"""Networks that were trained elsewhere, fitted to a robot and wrapped so that our runner runs them.

Graph nodes before the network turn our observation into its own: they reorder joints, count angles
from its posture, clip, scale and keep past steps. Nodes behind it turn its actions into shares of
ours. Nothing of observation or action is written twice.

The memory of the wrapped network is, from one policy step to the next: 1 (0 before the first
step), its last raw action (k), its last observation (size).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto, NodeProto, TensorProto, ValueInfoProto, compose, helper, numpy_helper

from humanoid_getup.policy.action import (
    HOMING_SHARE,
    SPEED_SHARE,
    ActionMode,
    ActionSpec,
    build_posture_spec,
)
from humanoid_getup.policy.foreign.description import (
    COMMAND,
    ForeignPolicy,
    ForeignRecord,
    Window,
    map_joints,
)
from humanoid_getup.policy.observation import list_terms
from robots import Robot

PREFIX = "foreign_"  # of the names in the network that is wrapped
NO_LEAD = 10.0  # rad of a target before its joint: more than joints turn, so none is cut
GAIN_SLACK = 0.01  # share of a servo's gain by which another one may exceed it
RATE_SLACK = 1e-6  # share
MOST_NAMED = 3  # joints in a message


@dataclass(frozen=True, kw_only=True, eq=False)
class Wrapping:
    """A policy, and the robot that it moves."""

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

    def to_record(self) -> str:
        """Write what the checks of an imported policy need, as JSON."""
        policy, names = self.policy, self.robot.joint_names
        record = ForeignRecord(
            joints=tuple(names[self.places[name]] for name in policy.joints),
            moved=tuple(names[self.places[name]] for name in policy.moved),
            windows=tuple(
                Window(name=t.name, quantity=t.quantity, size=t.size, history=t.history)
                for t in policy.observation
            ),
        )
        return msgspec.json.encode(record).decode()

    def list_notes(self) -> list[str]:
        """List what was assumed, and what differs from the training."""
        policy, robot, action = self.policy, self.robot, self.action
        notes = [f"{name}: {text}" for name, text in policy.sources.items() if "assumed" in text]
        if commands := [term.name for term in policy.observation if term.quantity == COMMAND]:
            notes.append(f"{', '.join(commands)}: zeros")
        if share := action.gain_share:
            notes.append(f"servos have {min(share):.0%} to {max(share):.0%} of their position gain")
        if policy.damping is not None:
            own = robot.torque_speed_slope[[self.places[name] for name in policy.joints]]
            notes.append(
                f"damping: {policy.damping.mean():.2g} N·m·s/rad in its training on average, the "
                f"servos have {own.mean():.2g}"
            )
        if still := [name for name in robot.joint_names if name not in action.names]:
            notes.append(f"{', '.join(still)}: no action moves them, they go to the stance")
        return notes


def fit_policy(
    policy: ForeignPolicy, robot: Robot, renamed: Mapping[str, str] | None = None
) -> Wrapping:
    """Fit a policy to a robot."""
    places = map_joints(policy.joints, robot, renamed)
    exact = 1.0 / (policy.rate * robot.control_period)
    cycles, shares, own = max(round(exact), 1), np.ones(robot.n), robot.position_gain
    joints = [places[name] for name in policy.joints]
    if policy.position_gain is not None:
        shares[joints] = policy.position_gain / own[joints]
    elif policy.p_gain is not None:
        shares[joints] = policy.p_gain / robot.p_gain[joints]
    # Servos that turn two joints together keep all of their gain.
    shares[[i for coupling in robot.couplings for i in coupling.joints]] = 1.0
    problems = []
    if abs(exact / cycles - 1.0) > RATE_SLACK:
        problems.append(
            f"it steps at {policy.rate:g} Hz, robot '{robot.name}' every {exact:.3g} control "
            f"periods of {1e3 * robot.control_period:g} ms: expected a whole number, as with "
            f"control_period = {1.0 / (policy.rate * cycles):.6g} in its robot.toml"
        )
    if wrong := [
        f"'{robot.joint_names[i]}' {shares[i] * own[i]:.3g} (the servo: {own[i]:.3g})"
        for i in np.flatnonzero(~((shares > 0.0) & (shares <= 1.0 + GAIN_SLACK)))
    ]:
        more = f" and {len(wrong) - MOST_NAMED} more" if len(wrong) > MOST_NAMED else ""
        problems.append(
            f"gains [N·m/rad] of {', '.join(wrong[:MOST_NAMED])}{more}: expected above 0 and at "
            "most the servo's; p_gain in robot.toml sets that, --gain another gain"
        )
    if problems:
        raise ValueError("; ".join(problems))
    # Actions reach every angle of a joint; the network limits them further.
    moved, spec = [places[name] for name in policy.moved], build_posture_spec(robot)
    way = robot.max_velocity * robot.control_period * cycles
    shares = np.minimum(shares, 1.0)
    action = replace(
        spec,
        mode=policy.mode,
        names=tuple(robot.joint_names[i] for i in moved),
        directions=np.eye(robot.n)[moved],
        scale=spec.scale if policy.mode is ActionMode.ABSOLUTE else robot.upper - robot.lower,
        reach=SPEED_SHARE * way,
        lead=NO_LEAD,
        homing=HOMING_SHARE * SPEED_SHARE * way,
        cycles=cycles,
        holds=True,
        gain_share=() if np.all(shares == 1.0) else tuple(shares.tolist()),
    )
    return Wrapping(robot=robot, policy=policy, places=places, action=action)


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
    ones = graph.add("Add", graph.add("MatMul", "obs", np.zeros((size, 1))), np.ones(1))
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
    starts, policy, robot = wrapping.find_starts(), wrapping.policy, wrapping.robot
    joints = np.array([wrapping.places[name] for name in policy.joints])
    memory, parts = starts["last_action"], list[str]()
    is_first = graph.add("Sub", np.ones(1), graph.gather([memory]))
    kept = memory + 1 + len(policy.moved)  # where the term begins in the last observation
    for term in policy.observation:
        rows = np.arange(term.size) + (term.quantity == "last_action")
        rows = joints if term.quantity in ("joint_pos", "joint_vel") else rows
        now = graph.gather(starts.get(term.quantity, 0) + rows)
        if term.quantity == COMMAND:
            now = graph.add("Mul", now, np.zeros(1))
        if term.quantity == "joint_pos":
            zero = policy.default_pos if term.is_offset else 0.0
            now = graph.add("Add", now, robot.standing.joint_pos[joints] - zero)
        now = graph.add("Mul", graph.clip(now, term.lower, term.upper), term.scale)
        if past := term.history - 1:
            # All past steps are as the first one. The last observation is 0 then.
            begin = graph.add("Mul", graph.add("Concat", *[now] * past, axis=1), is_first)
            last = graph.gather(kept + term.size + np.arange(term.size * past))
            parts.append(graph.add("Add", begin, last))
        parts.append(now)
        kept += term.size * term.history
    return graph.add("Concat", *parts, axis=1)


def _act(graph: _GraphBuilder, wrapping: Wrapping, raw: str) -> None:
    """Add nodes that turn the policy's raw actions into ours."""
    policy = wrapping.policy
    target = graph.add("Mul", raw, policy.scale)
    if policy.mode is ActionMode.ABSOLUTE:
        target = graph.add("Add", target, policy.offset)
    if policy.limits is not None:
        target = graph.clip(target, *policy.limits)
    joints = [wrapping.places[name] for name in policy.moved]
    scale, home = wrapping.action.scale[joints], np.zeros(len(joints))
    if policy.mode is ActionMode.ABSOLUTE:
        home = wrapping.robot.standing.joint_pos[joints]
    share = graph.add("Add", graph.add("Mul", target, 1.0 / scale), -home / scale)
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

    def gather(self, columns: Any) -> str:
        """Take columns of our observation."""
        return self.add("Gather", "obs", np.asarray(columns), axis=1)

    def clip(self, vector: str, lower: Any, upper: Any) -> str:
        """Clip a vector to ranges, if any is finite."""
        if np.isfinite(lower).any():
            vector = self.add("Max", vector, np.atleast_1d(lower))
        return self.add("Min", vector, np.atleast_1d(upper)) if np.isfinite(upper).any() else vector

    def _constant(self, values: NDArray[Any]) -> str:
        name = next(self._names)
        is_whole = np.issubdtype(values.dtype, np.integer)
        array = values.astype(np.int64 if is_whole else np.float32)
        self.constants.append(numpy_helper.from_array(array, name))
        return name
