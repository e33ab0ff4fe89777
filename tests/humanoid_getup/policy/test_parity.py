"""Parity with the program that trained a policy: each planted fault is named at its term."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

import foreign_policies as made
from foreign_policies import save_network
from paths import NODDING

from humanoid_getup.commands.learn.foreign_policy import ImportPolicyRequest, import_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.policy.parity import Trace, compare_policy, load_trace
from robots import Robot, load_robot, quaternion
from robots.storage.arrays import ArchiveError

STEPS = 40
WEIGHT = made.weights(seed=3)
WEIGHT[-3:] = 0.0  # it ignores the action before, so that other actions are its own
STARTS = np.cumsum([0, *made.SIZES])


@pytest.fixture(scope="module")
def nodding() -> Robot:
    return load_robot(NODDING)


def bring_in(folder: Path, robot: Robot, **metadata: str) -> OnnxPolicy:
    network = save_network(folder / "their.onnx", WEIGHT, made.mjlab_metadata(**metadata))
    import_policy(
        ImportPolicyRequest(network=network, robot=str(NODDING), out=folder, rate=made.RATE)
    )
    return OnnxPolicy.load(folder / "policy.onnx", robot)


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory, nodding: Robot) -> OnnxPolicy:
    return bring_in(tmp_path_factory.mktemp("right"), nodding)


def make_trace(**changes) -> dict:
    """What the other program writes: its own observations of a robot that swings, in its order."""
    rng = np.random.default_rng(1)
    raw = {
        "time": np.arange(STEPS) / made.RATE,
        "orientation": quaternion.normalize(rng.normal(size=(STEPS, 4))),
        "gyro": rng.normal(size=(STEPS, 3)),
        "joint_pos": rng.normal(size=(STEPS, 3)),
        "joint_vel": rng.normal(size=(STEPS, 3)),
    }
    gravity = quaternion.gravity_in_body(raw["orientation"])
    terms = [raw["gyro"], gravity, raw["joint_pos"] - made.DEFAULT, raw["joint_vel"]]
    seen, action = [], np.zeros(3)
    for row in range(STEPS):
        seen.append(np.concatenate([*(term[row] for term in terms), action]))
        action = seen[-1] @ WEIGHT
    observation = np.array(seen)
    return {
        "joints": np.array(made.JOINTS),
        **raw,
        "observation": observation,
        "action": observation @ WEIGHT,
        **changes,
    }


def load(folder: Path, robot: Robot, arrays: dict) -> Trace:
    np.savez(folder / "trace.npz", **arrays)
    return load_trace(folder / "trace.npz", robot)


def put(term: int, change) -> dict:
    """A trace in which a term of the observation is changed."""
    trace = make_trace()
    window = np.s_[:, STARTS[term] : STARTS[term + 1]]
    trace["observation"][window] = change(trace["observation"][window], trace)
    return trace


def test_a_trace_of_the_program_that_trained_a_policy_agrees(policy, nodding: Robot, tmp_path):
    found = compare_policy(policy, load(tmp_path, nodding, make_trace()))
    assert [compared.agrees for compared in found] == [True, True]
    assert [compared.cause for compared in found] == ["", ""]
    assert max(compared.difference for compared in found) < 1e-5


def late(values, _trace=None):
    return np.concatenate((values[:1], values[:-1]))


@pytest.mark.parametrize(
    ("term", "change", "cause"),
    [
        (0, lambda v, _: 0.25 * v, "'base_ang_vel': 'entry 0' is 0.25 times as large in the"),
        (1, lambda v, _: -v, "'projected_gravity': 'entry 0' is -1 times as large in the trace"),
        (2, lambda _, t: t["joint_pos"], "'joint_pos': 'head' is off by +0.300 in the trace"),
        (3, late, "'joint_vel': one policy step late in the trace"),
        (3, lambda v, _: v[:, [2, 1, 0]], "'joint_vel': 'r_hip' and 'l_hip' are swapped"),
        (1, lambda _, t: t["gyro"], "'projected_gravity': 'entry "),
    ],
)
def test_what_differs_first_is_named_with_its_likely_cause(
    policy: OnnxPolicy, nodding: Robot, tmp_path: Path, term: int, change, cause: str
):
    seen, action = compare_policy(policy, load(tmp_path, nodding, put(term, change)))
    assert seen.agrees is False and seen.cause.startswith(cause) and ";" not in seen.cause
    assert (action.agrees, action.cause) == (None, "the observation differs")


def test_another_order_of_joints_is_named(nodding: Robot, tmp_path: Path):
    """In positions although each has a zero of its own, and in both terms of joints."""
    right, head, left = made.JOINTS
    wrong = bring_in(tmp_path, nodding, joint_names=f"{head},{left},{right}")
    cause = compare_policy(wrong, load(tmp_path, nodding, make_trace()))[0].cause
    names = "'r_hip' for 'head', 'head' for 'l_hip', 'l_hip' for 'r_hip'"
    order = f"another order in the trace: {names}"
    assert cause == f"'joint_pos': {order}; 'joint_vel': {order}"


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda a: 2.0 * a, "'r_hip' is 2 times as large in the trace: another scale"),
        (lambda a: a[:, [1, 0, 2]], "'r_hip' and 'head' are swapped in the trace"),
        (lambda a: a + np.random.default_rng(0).normal(size=a.shape), "at step"),
    ],
)
def test_actions_that_differ_are_named(policy, nodding: Robot, tmp_path: Path, change, cause: str):
    trace = make_trace()
    trace["action"] = change(trace["action"])
    trace["observation"][1:, -3:] = trace["action"][:-1]
    seen, action = compare_policy(policy, load(tmp_path, nodding, trace))
    assert seen.agrees and action.agrees is False
    assert cause in action.cause


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"action": np.zeros((STEPS, 2))}, ArchiveError, "action has 2 columns, expected 3"),
        ({"time": np.arange(STEPS) / 31.25}, ArchiveError, "rows are 31.25 Hz, expected 62.5 Hz"),
        ({"time": np.zeros(3)}, ArchiveError, "has 3 rows, expected at least 8"),
        ({"orientation": np.ones((STEPS, 4))}, ArchiveError, "not of length 1"),
        ({"gyro": np.zeros((STEPS, 2))}, ArchiveError, r"gyro has shape \(40, 2\), expected"),
        ({"joints": np.array(["head", "l_hip"])}, ArchiveError, "joints lacks r_hip"),
        ({"torque": np.zeros(3)}, ArchiveError, "unknown key 'torque'"),
    ],
)
def test_a_trace_that_does_not_fit_is_refused(policy, nodding, tmp_path, changes, error, message):
    with pytest.raises(error, match=message):
        compare_policy(policy, load(tmp_path, nodding, make_trace(**changes)))
