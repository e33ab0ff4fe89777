"""Golden traces: a correct pair agrees, and each planted fault is named at its boundary."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
from foreign_policies import save_network
from paths import NODDING
from tiny_policies import actions_of, save_policy, weights_of

from drivers import Twin
from humanoid_getup.jobs.import_policy import import_policy
from humanoid_getup.jobs.requests.policies import ImportPolicyRequest
from humanoid_getup.policy.golden.checks import check_policy, order_trace
from humanoid_getup.policy.golden.comparison import Boundary, Comparison
from humanoid_getup.policy.golden.recording import record_trace
from humanoid_getup.policy.golden.trace import GoldenTrace
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Posture, Robot, load_robot, quaternion
from robots.storage.arrays import ArchiveError

STEPS = 40
GAIN, SCALE = 15.0, 0.55  # N·m/rad, rad
A, B, C, D = Boundary


@pytest.fixture(scope="module")
def nodding() -> Robot:
    return load_robot(NODDING)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("golden")


def bring_in(
    folder: Path, robot: Robot, name: str, *, forgets: bool = False, **metadata: str
) -> OnnxPolicy:
    """Import a policy that swings all joints, each in its own way, from metadata."""
    weight = np.random.default_rng(3).normal(0.0, 0.1, (sum(made.SIZES), 3))
    if forgets:
        weight[-3:] = 0.0
    changes = {
        "joint_stiffness": f"{GAIN}",
        "joint_damping": "0.85",
        "action_scale": f"{SCALE}",
        **metadata,
    }
    network = save_network(folder / f"{name}.onnx", weight, made.mjlab_metadata(**changes))
    request = ImportPolicyRequest(
        network=network, robot=str(NODDING), out=folder / name, rate=made.RATE
    )
    import_policy(request)
    return OnnxPolicy.load(folder / name / "policy.onnx", robot)


@pytest.fixture(scope="module")
def policy(folder: Path, nodding: Robot) -> OnnxPolicy:
    return bring_in(folder, nodding, "right")


def drop(robot: Robot) -> Twin:
    """A robot in the air, turned, so that it swings before it lands and then lies in contact."""
    turned = quaternion.from_axis_angle(np.array([0.6, 0.8, 0.0]), np.array(1.0))
    return Twin(
        robot,
        Posture(
            position=np.array([0.0, 0.0, 0.8]),
            orientation=turned,
            joint_pos=np.array([0.5, -0.4, 0.3]),
        ),
    )


@pytest.fixture(scope="module")
def trace(policy: OnnxPolicy, nodding: Robot) -> GoldenTrace:
    return record_trace(policy, drop(nodding), STEPS)


def late(values: np.ndarray) -> np.ndarray:
    """The values of the step before."""
    return np.concatenate((values[:1], values[:-1]))


def put(trace: GoldenTrace, term: int, values: np.ndarray) -> GoldenTrace:
    """Replace a term of the observations."""
    starts = np.cumsum([0, *made.SIZES])
    seen = trace.observation.copy()
    seen[:, starts[term] : starts[term + 1]] = values
    return replace(trace, observation=seen)


def first_difference(comparisons: list[Comparison]) -> Comparison:
    assert [compared.boundary for compared in comparisons] == list(Boundary)
    return next(compared for compared in comparisons if compared.agrees is False)


def test_a_correct_pair_agrees_at_every_boundary(policy: OnnxPolicy, trace: GoldenTrace):
    comparisons = check_policy(policy, trace)
    assert [compared.agrees for compared in comparisons] == [True] * 4
    assert [compared.cause for compared in comparisons] == [""] * 4


def test_a_trace_comes_back_from_its_file(policy: OnnxPolicy, trace: GoldenTrace, tmp_path: Path):
    trace.save(tmp_path / "trace.npz")
    back = GoldenTrace.load(tmp_path / "trace.npz")
    np.testing.assert_array_equal(back.observation, trace.observation)
    assert back.joints == trace.joints
    assert [compared.agrees for compared in check_policy(policy, back)] == [True] * 4


def test_one_of_our_own_policies_agrees_with_its_trace(nodding: Robot, tmp_path: Path):
    weight = weights_of(nodding, gyro=0.2, joint_vel=0.1, target_error=0.5)
    policy = OnnxPolicy.load(save_policy(tmp_path / "own.onnx", nodding, weight=weight), nodding)
    own = record_trace(policy, drop(nodding), STEPS)
    assert actions_of(nodding).size == own.action.shape[1]
    assert [compared.agrees for compared in check_policy(policy, own)[:3]] == [True] * 3


def test_a_gain_of_1_is_named(folder: Path, nodding: Robot, trace: GoldenTrace):
    """As mjlab writes it for actuators whose gain it does not know, but for one joint."""
    wrong = bring_in(folder, nodding, "soft", joint_stiffness="1.000,1.000,1.001")
    found = first_difference(check_policy(wrong, trace))
    assert found.boundary is C
    assert re.match(r"position gain kp: 1 N·m/rad here, (15|14\.9|15\.1) N·m/rad in", found.cause)


@pytest.mark.parametrize(
    ("order", "cause"),
    [
        ([2, 1, 0], "joints 'l_hip' and 'r_hip' are swapped"),
        ([1, 2, 0], "another order: 'r_hip' for 'head', 'head' for 'l_hip', 'l_hip' for 'r_hip'"),
    ],
)
def test_another_order_of_joints_is_named(
    folder: Path, nodding: Robot, trace: GoldenTrace, order: list[int], cause: str
):
    names = ",".join(made.JOINTS[i] for i in order)
    wrong = bring_in(folder, nodding, f"order{order[0]}", joint_names=names)
    found = first_difference(check_policy(wrong, trace))
    assert found.boundary is A
    assert cause in found.cause


@pytest.mark.parametrize(
    ("order", "cause"),
    [
        ([1, 0, 2], "joints 'r_hip' and 'l_hip' are swapped"),
        (made.THEIRS, "another order: 'head' for 'r_hip', 'l_hip' for 'head', 'r_hip' for 'l_hip'"),
    ],
)
def test_another_order_of_joints_in_the_actions_alone_is_named(
    policy: OnnxPolicy, trace: GoldenTrace, order: list[int], cause: str
):
    assert trace.target is not None
    found = first_difference(check_policy(policy, replace(trace, target=trace.target[:, order])))
    assert found.boundary is C
    assert cause in found.cause


def test_another_scale_of_actions_is_named(folder: Path, nodding: Robot, trace: GoldenTrace):
    wrong = bring_in(folder, nodding, "small", action_scale="0.35")
    found = first_difference(check_policy(wrong, trace))
    assert found.boundary is C
    assert "scale of actions: 0.35 rad in the policy, 0.55 rad in the trace" in found.cause


def test_gravity_in_the_world_frame_is_named(policy: OnnxPolicy, trace: GoldenTrace):
    found = first_difference(check_policy(policy, put(trace, 1, np.array([0, 0, -1.0]))))
    assert found.boundary is A
    assert found.cause == "'projected_gravity': gravity in the world frame, expected the torso's"


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (lambda t: -t.gravity, "points up, expected down"),
        (
            lambda t: quaternion.rotate(t.orientation, np.array([0.0, 0.0, -1.0])),
            "turned from torso to world",
        ),
        (
            lambda t: quaternion.gravity_in_body(np.roll(t.orientation, -1, axis=1)),
            "read as x y z w",
        ),
        (lambda t: late(t.gravity), "one policy step late"),
    ],
)
def test_other_mistakes_with_gravity_are_named(policy, trace: GoldenTrace, change, cause: str):
    found = first_difference(check_policy(policy, put(trace, 1, change(trace))))
    assert found.boundary is A and cause in found.cause


def test_a_velocity_one_step_late_is_named(policy: OnnxPolicy, trace: GoldenTrace):
    speeds = late(trace.joint_vel)[:, made.THEIRS]
    found = first_difference(check_policy(policy, put(trace, 3, speeds)))
    assert found.boundary is A
    assert found.cause == "'joint_vel': one policy step late"


def test_a_velocity_one_step_late_in_the_state_is_named(policy: OnnxPolicy, trace: GoldenTrace):
    assert trace.true_joint_vel is not None
    wrong = replace(trace, true_joint_vel=late(trace.true_joint_vel))
    for boundary, changed in ((C, wrong), (D, replace(wrong, target=None))):
        found = first_difference(check_policy(policy, changed))
        assert found.boundary is boundary
        assert found.cause == "joint speeds are one policy step late in the trace"


@pytest.mark.parametrize(
    ("term", "change", "cause"),
    [
        (0, lambda t: 0.25 * t.gyro, "0.25 times as large in the trace: another scale"),
        (0, lambda t: quaternion.rotate(t.orientation, t.gyro), "in the world frame"),
        (2, lambda t: t.joint_pos[:, made.THEIRS], "another zero, as of a posture"),
    ],
)
def test_other_mistakes_with_terms_are_named(policy, trace: GoldenTrace, term, change, cause):
    found = first_difference(check_policy(policy, put(trace, term, change(trace))))
    assert found.boundary is A and cause in found.cause


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (late, "one policy step late"),
        (lambda a: 2.0 * a, "2 times as large"),
        (lambda a: a + np.random.default_rng(0).normal(size=a.shape), "another network"),
    ],
)
def test_other_actions_are_named_at_the_network(folder, nodding: Robot, change, cause: str):
    """Of a network that ignores the action before, so that the other actions are its own."""
    policy = bring_in(folder, nodding, "forgets", forgets=True)
    trace = record_trace(policy, drop(nodding), STEPS)
    action = change(trace.action)
    before = np.concatenate((np.zeros_like(action[:1]), action[:-1]))
    found = first_difference(check_policy(policy, replace(put(trace, 4, before), action=action)))
    assert found.boundary is B and cause in found.cause


def test_joints_of_a_trace_may_be_in_any_order(policy: OnnxPolicy, trace: GoldenTrace):
    keys = ("joint_pos", "joint_vel", "target", "sent", "torque", "effort")
    keys += ("true_joint_pos", "true_joint_vel")
    turned = {key: getattr(trace, key)[..., made.THEIRS] for key in keys}
    other = replace(trace, joints=made.JOINTS, **turned)
    assert order_trace(other, policy.robot).joints == policy.robot.joint_names
    assert [compared.agrees for compared in check_policy(policy, other)] == [True] * 4


def test_what_a_trace_does_not_hold_is_not_compared(policy: OnnxPolicy, trace: GoldenTrace):
    bare = replace(trace, target=None, torque=None, effort=None, position=None)
    comparisons = check_policy(policy, bare)
    assert [compared.agrees for compared in comparisons] == [True, True, None, None]
    assert "the trace has no position, torque" in comparisons[3].cause


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: {"observation": t.observation[:, 1:]}, "observation has 14 columns"),
        (lambda t: {"time": 2.0 * t.time}, r"rows are 31.25 Hz, expected 62.5 Hz"),
        (lambda t: {"time": t.time + 1e9 * (t.time > 0.1)}, r"rows are 0.016 to 1e\+09 s apart"),
    ],
)
def test_a_trace_that_does_not_fit_is_refused(policy, trace: GoldenTrace, change, message: str):
    with pytest.raises(ArchiveError, match=message):
        check_policy(policy, replace(trace, **change(trace)))


def test_a_trace_of_numbers_beyond_all_units_is_refused(trace: GoldenTrace, tmp_path: Path):
    replace(trace, torque=1e200 * trace.action).save(tmp_path / "trace.npz")
    with pytest.raises(ArchiveError, match=r"torque has numbers beyond 1e\+12"):
        GoldenTrace.load(tmp_path / "trace.npz")
