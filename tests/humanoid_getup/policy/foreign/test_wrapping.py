"""Wrapped networks: what they observe and do is what their own project would compute."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
from bus_stories import TINY
from foreign_policies import save_network
from tiny_policies import state_of

from humanoid_getup.jobs.import_policy import import_policy
from humanoid_getup.jobs.requests.policies import ImportPolicyRequest
from humanoid_getup.policy.foreign.description import ForeignPolicyError
from humanoid_getup.policy.foreign.joint_names import map_joints
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot, load_robot, quaternion

STEPS = 6


@pytest.fixture(scope="module")
def tiny() -> Robot:
    return load_robot(TINY)


def bring_in(folder: Path, network: Path, **options) -> Path:
    import_policy(
        ImportPolicyRequest(network=network, robot=str(TINY), out=folder / "ours", **options)
    )
    return folder / "ours" / "policy.onnx"


def make_states(robot: Robot) -> list:
    """States at every policy step, at any posture and speed."""
    rng = np.random.default_rng(1)
    return [
        state_of(
            robot,
            step * 0.016,
            joint_pos=rng.uniform(-0.4, 0.4, 2),
            joint_vel=rng.normal(0.0, 2.0, 2),
            gyro=rng.normal(0.0, 2.0, 3),
            orientation=quaternion.normalize(rng.normal(size=4)),
        )
        for step in range(STEPS)
    ]


def play(policy: OnnxPolicy, states: list) -> list[np.ndarray]:
    """Return the targets at the end of each policy step."""
    policy.reset(states[0])
    return [[policy.step(state).joint_pos for _ in range(2)][-1] for state in states]


class TheirPipeline:
    """The loop of the other project, written down once more: lists of past terms, one joint order.

    Their joints are right, left; ours are left, right.
    """

    def __init__(self, weight, histories, scales, clips, scale):
        self.weight, self.histories, self.scales = weight, histories, scales
        self.clips, self.scale = clips, scale
        self.past = [[] for _ in histories]
        self.action = np.zeros(2)

    def step(self, gyro, gravity, joint_pos, joint_vel) -> np.ndarray:
        terms = (gyro, gravity, joint_pos[::-1] - made.DEFAULT, joint_vel[::-1], self.action)
        seen = []
        for i, term in enumerate(terms):
            value = np.clip(term, *self.clips[i]) * self.scales[i]
            self.past[i] = self.past[i] or [value] * (self.histories[i] - 1)
            self.past[i] = [*self.past[i], value][-self.histories[i] :]
            seen += self.past[i]
        self.action = np.concatenate(seen) @ self.weight
        return (made.DEFAULT + np.array(self.scale) * self.action)[::-1]


def compare(policy: OnnxPolicy, theirs: TheirPipeline, robot: Robot) -> None:
    states = make_states(robot)
    wanted = []
    for state in states:
        sensed = policy.sense(state)
        wanted.append(theirs.step(sensed.gyro, sensed.gravity, state.joint_pos, state.joint_vel))
    reach, last = policy.action.reach, states[0].joint_pos
    expected = []
    for target in wanted:  # no faster than the servos turn
        last = last + np.clip(np.clip(target, robot.lower, robot.upper) - last, -reach, reach)
        expected.append(last)
    np.testing.assert_allclose(play(policy, states), expected, atol=2e-6)


def test_a_network_with_metadata_acts_as_in_its_own_project(tiny: Robot, tmp_path: Path):
    network = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    policy = OnnxPolicy.load(bring_in(tmp_path, network, rate=made.RATE), tiny)
    no_clip = [(-np.inf, np.inf)] * 5
    compare(policy, TheirPipeline(made.weights(), [1] * 5, [1.0] * 5, no_clip, made.SCALE), tiny)


@pytest.mark.parametrize("batch", ["N", 1])
def test_a_network_with_history_clips_and_scales_acts_as_in_its_own_project(
    tiny: Robot, tmp_path: Path, batch: int | str
):
    weight = made.weights(made.DEPLOY_SIZE)
    network = save_network(tmp_path / "their.onnx", weight, batch=batch)
    config = tmp_path / "deploy.yaml"
    config.write_text(made.DEPLOY)
    file = bring_in(tmp_path, network, config=(str(config),), joints=made.MOTORS)
    clips = [(-np.inf, np.inf)] * 5
    clips[2] = (-0.5, 0.5)
    scales = [0.2, 1.0, np.array([1.0, 2.0]), 0.05, 1.0]
    theirs = TheirPipeline(weight, [3, 1, 2, 1, 1], scales, clips, made.SCALE)
    compare(OnnxPolicy.load(file, tiny), theirs, tiny)


def test_a_policy_begins_anew_after_a_reset(tiny: Robot, tmp_path: Path):
    weight = made.weights(made.DEPLOY_SIZE)
    network = save_network(tmp_path / "their.onnx", weight)
    (tmp_path / "deploy.yaml").write_text(made.DEPLOY)
    file = bring_in(tmp_path, network, config=(str(tmp_path / "deploy.yaml"),), joints=made.MOTORS)
    policy, states = OnnxPolicy.load(file, tiny), make_states(tiny)
    np.testing.assert_array_equal(play(policy, states), play(policy, states))


def test_targets_are_reached_as_fast_as_the_servos_turn_and_held(tiny: Robot, tmp_path: Path):
    weight = np.zeros((sum(made.SIZES), 2))
    network = save_network(tmp_path / "their.onnx", weight, made.mjlab_metadata())
    policy = OnnxPolicy.load(bring_in(tmp_path, network, rate=31.25), tiny)
    policy.reset(state_of(tiny))
    sent = np.array([policy.step(state_of(tiny)).joint_pos for _ in range(4)])
    cycle = policy.action.reach / 4
    np.testing.assert_allclose(sent[0], np.clip([-0.2, 0.1], -cycle, cycle), atol=1e-6)
    np.testing.assert_allclose(sent[-1], np.clip([-0.2, 0.1], -4 * cycle, 4 * cycle), atol=1e-6)


def test_the_gain_of_the_training_is_a_share_of_the_servos(tiny: Robot, tmp_path: Path):
    network = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    policy = OnnxPolicy.load(bring_in(tmp_path, network, rate=made.RATE), tiny)
    policy.reset(state_of(tiny))
    share = policy.step(state_of(tiny)).gain_scale
    np.testing.assert_allclose(share * tiny.position_gain, [2.0, 2.0])


def test_a_register_value_is_a_share_of_the_servos_own(tiny: Robot, tmp_path: Path):
    network = save_network(tmp_path / "their.onnx", made.weights(), made.microduck_metadata())
    policy = OnnxPolicy.load(bring_in(tmp_path, network), tiny)
    np.testing.assert_allclose(policy.action.gain_share, 200.0 / tiny.p_gain)


def test_names_of_joints_are_matched_by_their_words(tiny: Robot):
    assert map_joints(("RightHip", "hip_left_joint"), tiny) == {
        "RightHip": 1,
        "hip_left_joint": 0,
    }
    assert map_joints(("a", "b"), tiny, {"a": "r_hip", "b": "l_hip"}) == {"a": 1, "b": 0}


@pytest.mark.parametrize(
    ("names", "renamed", "message"),
    [
        (("left_hip", "neck"), {}, "has no neck, expected l_hip, r_hip; --rename"),
        (("left_hip", "l_hip"), {}, "two names mean one joint: l_hip"),
        (("left_hip",), {"left_hip": "tail"}, "--rename names tail, expected joints"),
    ],
)
def test_names_that_mean_no_joint_are_refused(tiny: Robot, names, renamed, message: str):
    with pytest.raises(ForeignPolicyError, match=message):
        map_joints(names, tiny, renamed)
