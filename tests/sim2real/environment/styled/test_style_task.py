"""Rewards, curves and ends of a training with style curves, and ankles that turn a torso back."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from nonempty import nonempty

pytest.importorskip("torch")

import mujoco
from made_up_rises import make_prior
from styled_env import make_library, make_styled_env

from humanoid_getup.policy.action import build_posture_spec
from humanoid_getup.simulation.world import World
from humanoid_getup.style.features import mirror_features, torso_angles
from robots import Robot, quaternion
from robots.kinematics import place
from sim2real.environment.action_heads import BEGIN, LARGEST, AnkleBalance, PriorHead
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.starts import StartPool
from sim2real.environment.style_task import (
    GRACE,
    HEAD_UP,
    NEAR,
    TERMINATION_TIME,
    CurveLibrary,
    StyleTask,
)

RIGHT = np.pi / 2
STEP = 0.048  # s


@pytest.fixture
def head(op3: Robot) -> PriorHead:
    return PriorHead(build_posture_spec(op3), make_prior(op3))


@pytest.fixture
def env(op3: Robot, pool: StartPool, head: PriorHead) -> GetUpEnv:
    return make_styled_env(op3, pool, head)


def step_on(env: GetUpEnv) -> StyleTask:
    """Advance the curves by a policy step in which the robots stay as they are."""
    env.style.follow(env.sim, env.sensed, env.memory)
    return env.style


def test_outputs_that_lead_to_a_posture_lead_there(op3, head):
    """Through the filter, within what outputs reach."""
    rng = np.random.default_rng(0)
    wanted, fallen = rng.uniform(0.4, 1.6, (5, 3)), np.tile([0.3, 0.4, RIGHT], (5, 1))
    memory = rng.normal(0.0, 0.3, (5, len(head.names)))
    posture = head.prior.decode(rng.normal(size=(5, 3)), wanted)
    posture = posture + rng.normal(0.0, 0.02, posture.shape)
    spec = build_posture_spec(op3)
    for _ in range(12):
        outputs = head.invert(posture, memory, wanted, fallen)
        action, memory = head.decode(outputs, memory, wanted, fallen)
    assert spec.home + spec.scale * action == pytest.approx(posture, abs=1e-3)
    memory = head.remember(posture, wanted, fallen)
    resting, _ = head.decode(memory, memory, wanted, fallen)
    assert spec.home + spec.scale * resting == pytest.approx(posture, abs=1e-3)


def test_mirrored_outputs_lead_to_mirrored_actions(op3, head):
    rng = np.random.default_rng(1)
    outputs, memory = rng.normal(size=(2, 6, len(head.names)))
    flip = np.array([1.0, -1.0, 1.0])
    wanted, measured = rng.uniform(0.2, 2.0, (2, 6, 3))
    away = np.array([0.0, 2.0 * RIGHT, 0.0])
    action, after = head.decode(outputs, memory, wanted, measured)
    other, mirrored = head.decode(
        head.mirror(outputs), head.mirror(memory), away + flip * wanted, away + flip * measured
    )
    assert mirrored == pytest.approx(head.mirror(after))
    assert other == pytest.approx(op3.mirror_joints(action), abs=1e-5)


def test_curves_are_drawn_among_those_that_begin_near_named_ones_as_often_as_asked(op3, pool):
    library, rng = make_library(op3, pool.qpos[:4]), np.random.default_rng(2)
    supine = np.tile([0.3, RIGHT, 0.3], (400, 1))
    drawn = library.starts[library.draw_near(supine, rng)]
    assert np.abs(drawn[:, 1:] - supine[:, 1:]).max() <= NEAR
    upside_down = np.tile([0.9, RIGHT + 1.2, RIGHT - 0.4], (3, 1))
    assert len(set(library.draw_near(upside_down, rng).tolist())) == 1  # the nearest of all
    alike = np.tile(library.pieces[:1], (len(library.pieces), 1, 1, 1))
    object.__setattr__(library, "pieces", alike)
    drawn = library.draw_near(np.tile(library.starts[0], (2000, 1)), rng)
    assert np.mean(drawn >= 2) == pytest.approx(0.5, abs=0.05)
    durations = library.draw_durations(drawn, rng)
    assert np.ptp(durations[drawn == 0]) > 0.5  # those of rises are stretched
    assert np.ptp(durations[drawn == 3]) == 0.0


def test_a_robot_that_deviates_from_its_curves_ends_its_episode_after_a_while(env):
    ends = []
    lost = SimpleNamespace(task=np.where(np.arange(12) == 4, 0.05, 0.5))
    state = SimpleNamespace(head_contact=np.zeros(12, dtype=bool))
    while not ends or not ends[-1].any():
        ends.append(step_on(env).find_terminated(lost, state, STEP))
    assert np.flatnonzero(ends[-1]).tolist() == [4]
    assert len(ends) * STEP == pytest.approx(max(TERMINATION_TIME, GRACE), abs=1.01 * STEP)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_a_robot_that_deviated_restarts_where_it_is(env, monkeypatch, share):
    env.options = replace(env.options, restarts=share)
    task, everyone = env.style, np.ones(12, dtype=bool)
    monkeypatch.setattr(task, "find_terminated", lambda *_: everyone)
    monkeypatch.setattr(CurveLibrary, "find_near", lambda _, seen: np.arange(len(seen)) < 5)
    ended = []
    monkeypatch.setattr(env.sim, "place", lambda ids, _: ended.append(ids.tolist()))
    before = env.sim.read("qpos").copy()
    observation, _, terminated, _, _ = env.step(np.ones(env.action_space.shape))
    assert terminated.all()
    assert ended == [list(range(5 if share else 0, 12))], "the others are reset"
    assert np.abs(env.sim.read("qpos") - before).max() < 0.5
    assert env.episodes.age.tolist() == [0] * 12
    ends = np.cumsum([term.size for term in env.terms])
    at = [term.name for term in env.terms].index("last_action")
    seen = observation[:5, ends[at - 1] : ends[at]]
    assert not share or np.all(seen == 0.0), "it begins again without memory"
    assert task.tracker.time[:5].max() == 0.0 or not share
    left = task.tracker.duration - task.tracker.time
    assert env.episodes.length * STEP == pytest.approx(left + 3.0, abs=STEP)


def test_a_head_on_the_ground_counts_once_the_neck_should_be_up(env):
    task = env.style
    fine = SimpleNamespace(task=np.ones(12))
    down = SimpleNamespace(head_contact=np.ones(12, dtype=bool))
    early = [row for row in range(12) if task.tracker.wanted[row, 0] < HEAD_UP]
    assert early
    for _ in range(8):
        task.tracker.time[early] = 0.0
        lost = step_on(env).find_terminated(fine, down, STEP)
    assert not lost[early].any()
    for _ in range(120):
        lost = step_on(env).find_terminated(fine, down, STEP)
    assert lost.all()


def test_an_interrupted_environment_continues_to_the_bit(env, head):
    rng = np.random.default_rng(5)
    actions = rng.normal(0.0, 0.5, (9, 12, len(head.names)))
    for action in actions[:4]:
        env.step(action)
    kept = env.save_state()
    one = [env.step(action) for action in actions[4:]]
    env.restore_state(kept)
    again = [env.step(action) for action in actions[4:]]
    for before, after in nonempty(zip(one, again, strict=True)):
        for left, right in nonempty(zip(before[:4], after[:4], strict=True)):
            assert np.array_equal(left, right)


STANCE = np.array([[1.0, RIGHT, RIGHT]])


@pytest.fixture
def balance(op3: Robot) -> AnkleBalance:
    return AnkleBalance(op3)


@pytest.mark.parametrize("lean", [[0.2, 0.0], [-0.2, 0.0], [0.0, 0.2], [0.0, -0.2]])
def test_with_the_feet_held_the_correction_lessens_the_lean(op3: Robot, world: World, lean):
    """The torso's angles, as the ankles turn it over feet that stay, by forward kinematics."""
    model = world.model
    data, layout = mujoco.MjData(model), op3.layout(model)
    correction = AnkleBalance(op3).correct(STANCE, STANCE + np.array([0.0, *lean]))[0]
    soles, angles = [], []
    for joint_pos in (op3.standing.joint_pos, op3.standing.joint_pos + correction):
        data.qpos[:] = place(op3, model, op3.standing)
        data.qpos[layout.qpos] = joint_pos
        mujoco.mj_kinematics(model, data)
        soles.append(data.site(op3.sole_sites[0]).xmat.reshape(3, 3).copy())
        angles.append(torso_angles(quaternion.gravity_in_body(op3.standing.orientation)))
    # Gravity as the torso sees it once the foot is back as it was.
    turned = soles[0] @ soles[1].T
    down = turned.T @ np.array([0.0, 0.0, -1.0])
    conjugate = op3.standing.orientation * [1.0, -1.0, -1.0, -1.0]
    moved = torso_angles(quaternion.rotate(conjugate, down)) - angles[0]
    assert np.sign(moved[np.argmax(np.abs(lean))]) == -np.sign(sum(lean))
    assert np.abs(correction).max() <= LARGEST


def test_a_robot_that_is_low_or_as_it_should_be_is_left_alone(balance):
    low = np.array([[BEGIN - 0.01, RIGHT + 0.3, RIGHT - 0.3]])
    assert not balance.correct(STANCE, low).any()
    assert not balance.correct(STANCE, STANCE).any()


def test_mirrored_leans_have_mirrored_corrections(op3: Robot, balance):
    leaning = STANCE + np.array([0.0, 0.1, -0.2])
    mirrored = balance.correct(mirror_features(STANCE), mirror_features(leaning))
    assert mirrored[0] == pytest.approx(op3.mirror_joints(balance.correct(STANCE, leaning)[0]))
