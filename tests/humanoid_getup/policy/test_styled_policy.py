"""A policy with style curves observes them, remembers, and says what it follows."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("onnx")

from tiny_policies import save_styled_policy, state_of

from humanoid_getup.policy.observation import UPRIGHT, Sensed
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.policy.slope_legs import SlopeLegs
from humanoid_getup.policy.style_follower import StyleFollower
from humanoid_getup.style.features import FeatureSense
from humanoid_getup.style.style import Style, load_style
from robots import Robot, quaternion

SUPINE = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -0.5 * np.pi)
PRONE = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.5 * np.pi)
STEP = 0.048  # s


def find_places(policy: OnnxPolicy) -> dict[str, slice]:
    """Find where each term of the observation is."""
    ends = np.cumsum([term.size for term in policy.contract.observation])
    pairs = zip(policy.contract.observation, ends, strict=True)
    return {term.name: slice(int(end) - term.size, int(end)) for term, end in pairs}


def observe_all(policy: OnnxPolicy, robot: Robot, monkeypatch, steps: int) -> np.ndarray:
    """Run a policy on a robot that lies still; return what it observed, (steps, size)."""
    seen = []
    act = policy.act
    monkeypatch.setattr(policy, "act", lambda rows: seen.append(rows[0].copy()) or act(rows))
    state = state_of(robot, orientation=SUPINE)
    policy.reset(state)
    for cycle in range(policy.action.cycles * steps):
        policy.step(state_of(robot, cycle * 0.008, orientation=SUPINE))
    return np.array(seen)


def test_it_observes_its_curves_from_where_it_lies(op3, tmp_path, monkeypatch):
    style = load_style("side-sit", op3)
    policy = OnnxPolicy.load(save_styled_policy(tmp_path / "p.onnx", op3), op3, style=style)
    seen, at = observe_all(policy, op3, monkeypatch, 40), find_places(policy)
    measured = FeatureSense(op3)(np.array([[-1.0, 0.0, 0.0]]), op3.standing.joint_pos[None])[0]
    assert seen[0, at["style_features"]] == pytest.approx(measured - UPRIGHT, abs=1e-6)
    targets = seen[:, at["style_targets"]].reshape(40, 4, 3) + UPRIGHT
    assert targets[0, 0] == pytest.approx(measured, abs=1e-6)  # entered from what is measured
    supine = style.curves[0]
    late = np.arange(20, 40)  # behind the first quarter, in which the curves are entered
    for column, ahead in enumerate((0.0, 0.1, 0.2, 0.3)):
        wanted = supine.sample(late * STEP + ahead)
        assert targets[late, column] == pytest.approx(wanted, abs=1e-5)
    assert policy.guidance.wanted == pytest.approx(targets[-1, 0], abs=1e-5)
    assert policy.guidance.measured == pytest.approx(measured)
    other = OnnxPolicy.load(tmp_path / "p.onnx", op3)  # without a style: the nearest of all
    assert [each.style.name for each in (other.following(style), other)] == ["side-sit", "any"]


def test_what_it_remembers_is_what_it_observes_next(op3, tmp_path, monkeypatch):
    plain = OnnxPolicy.load(save_styled_policy(tmp_path / "p.onnx", op3), op3)
    at = find_places(plain)
    size = plain.contract.observation_size
    keep = np.zeros((size, 2))
    keep[at["torque_share"], 0] = 0.5  # constant
    keep[at["last_action"].start + 1, 1] = 1.0  # counts by the constant before it
    keep[at["last_action"].start, 1] = 1.0
    file = save_styled_policy(tmp_path / "q.onnx", op3, memory=keep)
    policy = OnnxPolicy.load(file, op3)
    remembered = observe_all(policy, op3, monkeypatch, 5)[:, at["last_action"]]
    assert remembered[:, 0] == pytest.approx([0.0, 0.5, 0.5, 0.5, 0.5])
    assert remembered[:, 1] == pytest.approx([0.0, 0.0, 0.5, 1.0, 1.5])
    policy.reset(state_of(op3, orientation=SUPINE))
    again = observe_all(policy, op3, monkeypatch, 2)[:, at["last_action"]]
    assert again[0] == pytest.approx([0.0, 0.0])  # a new rise begins without memory


def test_a_robot_that_stays_lying_begins_again_without_memory(op3, tmp_path, monkeypatch):
    plain = OnnxPolicy.load(save_styled_policy(tmp_path / "p.onnx", op3), op3)
    at = find_places(plain)
    keep = np.zeros((plain.contract.observation_size, 2))
    keep[at["torque_share"], 0] = 0.5
    file = save_styled_policy(tmp_path / "q.onnx", op3, memory=keep)
    style = load_style("long-sit", op3)
    policy = OnnxPolicy.load(file, op3, style=style)
    seen = observe_all(policy, op3, monkeypatch, 100)
    memory = seen[:, at["last_action"].start]
    again = 1 + int(np.argmax(memory[1:] == 0.0))
    assert 0.5 * style.curves[0].duration < again * STEP < style.curves[0].duration + 1.0
    targets = seen[:, at["style_targets"]]
    assert targets[again] == pytest.approx(targets[0], abs=1e-5)
    assert targets[again + 10] == pytest.approx(targets[10], abs=1e-5)


def test_a_robot_that_lies_where_no_curves_begin_is_given_up(op3, tmp_path):
    supine = load_style("long-sit", op3).curves[0]
    style = Style(name="supine alone", curves=(supine,))
    policy = OnnxPolicy.load(save_styled_policy(tmp_path / "p.onnx", op3), op3, style=style)
    for _ in range(2):  # attempts
        time = 0.0
        policy.reset(state_of(op3, orientation=PRONE))
        assert not policy.done
        while not policy.done:
            policy.step(state_of(op3, time, orientation=PRONE))
            time += 0.008
        assert 3.0 < time < 4.5 < policy.longest
        assert policy.followed.restarts == 0
        assert str(policy.followed).startswith("not followed")
        assert "; the curves begin 165° from how it lay" in str(policy.followed)


def test_a_robot_that_is_up_before_its_curves_is_not_given_up(op3, tmp_path):
    slow = load_style("long-sit", op3).curves[0].lasting(30.0)
    style = Style(name="slow", curves=(slow,))
    file = save_styled_policy(tmp_path / "p.onnx", op3)
    policy = OnnxPolicy.load(file, op3, style=style, longest=60.0)
    policy.reset(state_of(op3, orientation=SUPINE))
    for cycle in range(400):
        policy.step(state_of(op3, cycle * 0.008, orientation=SUPINE))
    for cycle in range(400, 900):  # 4 s, in which the curves ask for sitting
        policy.step(state_of(op3, cycle * 0.008))
    assert not policy.done


FACE_UP, FACE_DOWN = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])


def lie(robot: Robot, gravity: np.ndarray) -> Sensed:
    still = np.zeros(robot.n)
    return Sensed(
        gravity=gravity, gyro=np.zeros(3), joint_pos=robot.standing.joint_pos, joint_vel=still
    )


def follow(robot: Robot, style: Style) -> StyleFollower:
    return StyleFollower(robot, lambda _, seen: style.choose(seen))


def test_each_of_many_robots_follows_as_it_would_alone(op3: Robot):
    """One lies on its back, one on its front; errors are those of the first curves."""
    style, lying = load_style("long-sit", op3), [lie(op3, FACE_UP), lie(op3, FACE_DOWN)]
    both = Sensed(
        **{name: np.stack([getattr(one, name) for one in lying]) for name in vars(lying[0])}
    )
    alone = [follow(op3, style) for _ in lying]
    together = StyleFollower(op3, lambda _, seen: style.choose(seen), n=2)
    for _ in range(60):
        again = together.update(both, STEP)
        own = [one.update(sensed, STEP).size for one, sensed in zip(alone, lying, strict=True)]
        assert again.tolist() == np.flatnonzero(own).tolist()
    assert together.restarts.sum() >= 1
    for row, one in enumerate(alone):
        np.testing.assert_array_equal(together.wanted[row], one.wanted[0])
        np.testing.assert_array_equal(together.mean_error[row], one.mean_error[0])
        assert together.restarts[row] == one.restarts[0]


def test_on_a_slope_it_observes_level_ground_and_moves_the_legs_to_the_slope(
    op3, tmp_path, monkeypatch
):
    """Servos that are where they were sent: only what is sent tells the slope."""
    file = save_styled_policy(tmp_path / "p.onnx", op3)
    slope, heading = np.radians(20.0), quaternion.from_yaw(2.5)  # that of the IMU: another by 1
    start = replace(op3.standing, orientation=quaternion.from_yaw(1.5))
    level = OnnxPolicy.load(file, op3, style=load_style("side-sit", op3))
    sloping = level.following(level.style, slope, start)
    seen, sent = {}, {}
    for name, policy in (("level", level), ("sloping", sloping)):
        rows, act = [], policy.act
        monkeypatch.setattr(policy, "act", lambda o, r=rows, a=act: r.append(o[0]) or a(o))
        state = state_of(op3, orientation=heading)
        policy.reset(state)
        for cycle in range(policy.action.cycles * 10):
            command = policy.step(state)
            state = state_of(
                op3, (cycle + 1) * 0.008, orientation=heading, joint_pos=command.joint_pos
            )
        seen[name], sent[name] = np.array(rows), command.joint_pos
    np.testing.assert_allclose(seen["sloping"], seen["level"], atol=1e-5)
    (shift,) = SlopeLegs(op3, 1, slope).compute(start.orientation[np.newaxis], np.ones(1))
    np.testing.assert_allclose(sent["sloping"] - sent["level"], shift, atol=1e-6)
    assert np.abs(shift).max() > 0.3
