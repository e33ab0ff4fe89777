"""Wrapped networks: what they observe and do is what their own project would compute."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
import onnx
from foreign_policies import save_network
from paths import NODDING
from tiny_policies import state_of

from humanoid_getup.commands.learn.foreign_policy import ImportPolicyRequest, import_policy
from humanoid_getup.policy.foreign.description import ForeignNetwork, ForeignPolicy, map_joints
from humanoid_getup.policy.foreign.reading import describe_policy
from humanoid_getup.policy.foreign.wrapping import fit_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import Robot, load_robot, quaternion

STEPS = 6


@pytest.fixture(scope="module")
def nodding() -> Robot:
    return load_robot(NODDING)


def bring_in(folder: Path, network: Path, **options) -> Path:
    import_policy(
        ImportPolicyRequest(network=network, robot=str(NODDING), out=folder / "ours", **options)
    )
    return folder / "ours" / "policy.onnx"


def bring_in_env(folder: Path, text: str, weight: np.ndarray, batch: int | str = "N") -> Path:
    (folder / "env.yaml").write_text(text)
    network = save_network(folder / "their.onnx", weight, batch=batch)
    return bring_in(folder, network, config=folder / "env.yaml", joints=made.JOINTS)


def make_states(robot: Robot) -> list:
    """States at every policy step: at first near the default posture, then at any, and any speed.

    So near that no target is cut by the speed of the servos.
    """
    rng = np.random.default_rng(1)
    begin = np.array(made.DEFAULT)[made.OURS] + rng.uniform(-0.03, 0.03, 3)
    return [
        state_of(
            robot,
            step * 0.016,
            joint_pos=rng.uniform(-0.4, 0.4, 3) if step else begin,
            joint_vel=rng.normal(0.0, 2.0, 3),
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

    Targets are clipped to ``reach`` around the default posture, which the memory does not notice.
    """

    def __init__(self, weight, histories, scales, clips, scale, *, reach=np.inf):
        self.weight, self.histories, self.scales = weight, histories, scales
        self.clips, self.scale, self.reach = clips, np.array(scale), reach
        self.past = [[] for _ in histories]
        self.action = np.zeros(3)

    def step(self, gyro, gravity, joint_pos, joint_vel) -> np.ndarray:
        angles, speeds = joint_pos[made.THEIRS] - made.DEFAULT, joint_vel[made.THEIRS]
        seen = []
        for i, term in enumerate((gyro, gravity, angles, speeds, self.action)):
            value = np.clip(term, *self.clips[i]) * self.scales[i]
            self.past[i] = self.past[i] or [value] * (self.histories[i] - 1)
            self.past[i] = [*self.past[i], value][-self.histories[i] :]
            seen += self.past[i]
        self.action = np.concatenate(seen) @ self.weight
        change = np.clip(self.scale * self.action, -self.reach, self.reach)
        return (made.DEFAULT + change)[made.OURS]


def compare(policy: OnnxPolicy, theirs: TheirPipeline, robot: Robot) -> None:
    states = make_states(robot)
    wanted = []
    for state in states:
        sensed = policy.sense(state)
        wanted.append(theirs.step(sensed.gyro, sensed.gravity, state.joint_pos, state.joint_vel))
    ways = np.diff([states[0].joint_pos, *wanted], axis=0)
    assert np.all(np.abs(ways) < policy.action.reach)
    assert np.all((robot.lower < wanted) & (wanted < robot.upper))
    np.testing.assert_allclose(play(policy, states), wanted, atol=2e-6)


def test_a_network_with_metadata_acts_as_in_its_own_project(nodding: Robot, tmp_path: Path):
    """Its commands are zeros."""
    names, weight = list(made.PLAIN), made.weights(sum(made.SIZES) + 3)
    names.insert(2, "velocity_commands")
    metadata = made.mjlab_metadata(observation_names=",".join(names))
    network = save_network(tmp_path / "their.onnx", weight, metadata)
    policy = OnnxPolicy.load(bring_in(tmp_path, network, rate=made.RATE), nodding)
    no_clip, seen = [(-np.inf, np.inf)] * 5, np.delete(weight, slice(6, 9), axis=0)
    compare(policy, TheirPipeline(seen, [1] * 5, [1.0] * 5, no_clip, made.SCALE), nodding)


@pytest.mark.parametrize(("batch", "reach"), [("N", np.inf), (1, 0.005)])
def test_a_network_with_history_clips_and_scales_acts_as_in_its_own_project(
    nodding: Robot, tmp_path: Path, batch: int | str, reach: float
):
    """With limits of its targets, too, which it does not see in its last action."""
    text = made.ENV.replace("scale: 0.2}", "scale: 0.2, history_length: 3}")
    clips = [(-np.inf, np.inf)] * 5
    clips[2] = (-0.02, 0.01)
    new = "clip: [-0.02, 0.01], history_length: 2, scale: [1.0, 2.0, 3.0]}"
    text = text.replace('joint_pos_rel", scale: null}', f'joint_pos_rel", {new}')
    if reach < np.inf:
        pairs = zip(made.JOINTS, made.DEFAULT, strict=True)
        limits = {joint: [zero - reach, zero + reach] for joint, zero in pairs}
        text = text.replace("offset: 0.0", f"clip: {limits}")
    weight = made.weights(9 + 3 + 6 + 3 + 3)
    file = bring_in_env(tmp_path, text, weight, batch=batch)
    scales = [0.2, 1.0, np.array([1.0, 2.0, 3.0]), 0.05, 1.0]
    theirs = TheirPipeline(weight, [3, 1, 2, 1, 1], scales, clips, made.SCALE, reach=reach)
    policy = OnnxPolicy.load(file, nodding)
    compare(policy, theirs, nodding)
    states = make_states(nodding)
    np.testing.assert_array_equal(play(policy, states), play(policy, states))  # after a reset


def describe_mjlab(rate: float) -> ForeignPolicy:
    network = ForeignNetwork(
        model=onnx.ModelProto(), metadata=made.mjlab_metadata(), observation=15, action=3
    )
    return describe_policy(network, rate=rate)


def test_another_rate_is_refused_with_a_period_that_fits(nodding: Robot):
    for rate in (26.0, 50.0, 62.0, 62.49, 84.0, 200.0):
        with pytest.raises(ValueError, match="expected a whole number") as refusal:
            fit_policy(describe_mjlab(rate), nodding)
        (period,) = re.findall(r"control_period = (\S+)", str(refusal.value))
        steps, now = 1.0 / (rate * float(period)), 1.0 / (rate * nodding.control_period)
        assert steps == pytest.approx(round(steps), rel=1e-5)
        assert abs(steps - now) <= 0.5 or round(steps) == 1


def test_the_gain_of_the_training_is_a_share_of_the_servos(nodding: Robot, tmp_path: Path):
    """Of their gain in N·m/rad, or of a register of theirs."""
    network = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    policy = OnnxPolicy.load(bring_in(tmp_path, network, rate=made.RATE), nodding)
    policy.reset(state_of(nodding))
    share = policy.step(state_of(nodding)).gain_scale
    np.testing.assert_allclose(share * nodding.position_gain, [4.0, 2.0, 3.0])
    save_network(network, made.weights(), made.microduck_metadata())
    policy = OnnxPolicy.load(bring_in(tmp_path, network), nodding)
    np.testing.assert_allclose(policy.action.gain_share, 200.0 / nodding.p_gain)


def fit_gain(robot: Robot, share: float) -> tuple[float, ...]:
    """Fit a policy whose gains are shares of a robot's; return the shares that servos get."""
    gains = ",".join(f"{share * gain}" for gain in robot.position_gain)
    names, ones = ",".join(robot.joint_names), ",".join(["1"] * robot.n)
    metadata = made.mjlab_metadata(
        joint_names=names, joint_stiffness=gains, joint_damping=ones, action_scale=ones
    )
    metadata |= {"default_joint_pos": ones, "observation_names": "joint_pos"}
    network = ForeignNetwork(
        model=onnx.ModelProto(), metadata=metadata, observation=robot.n, action=robot.n
    )
    return fit_policy(describe_policy(network, rate=50.0), robot).action.gain_share


def test_a_gain_above_the_servos_is_refused_and_coupled_servos_keep_theirs(nodding: Robot):
    slow = replace(nodding, control_period=0.01)
    np.testing.assert_allclose(fit_gain(slow, 0.5), 0.5)
    assert fit_gain(slow, 1.005) == ()
    with pytest.raises(ValueError, match=r"'l_hip' 19.3 \(the servo: 18.9\).*expected"):
        fit_gain(slow, 1.02)
    robot = replace(load_robot("toddlerbot"), control_period=0.01)
    coupled = [i for coupling in robot.couplings for i in coupling.joints]
    shares = np.array(fit_gain(robot, 0.5))
    assert len(coupled) >= 2 and np.all(shares[coupled] == 1.0)
    np.testing.assert_allclose(np.delete(shares, coupled), 0.5)


def test_names_of_joints_are_matched_by_their_words_or_refused(nodding: Robot):
    found = map_joints(("RightHip", "hip_left_joint"), nodding)
    assert found == {"RightHip": 1, "hip_left_joint": 0}
    assert map_joints(("a", "b"), nodding, {"a": "r_hip", "b": "l_hip"}) == {"a": 1, "b": 0}
    for names, renamed, message in (
        (("left_hip", "neck"), {}, "has no neck, expected l_hip, r_hip, head; --rename"),
        (("left_hip", "l_hip"), {}, "two names mean one joint: l_hip"),
        (("left_hip",), {"left_hip": "tail"}, "--rename names tail, expected joints"),
    ):
        with pytest.raises(ValueError, match=message):
            map_joints(names, nodding, renamed)
