from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.disturbances import Scenarios
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.experiments.rollouts import Experiment, play
from humanoid_getup.filtering.candidate import Candidate, Slowdown, compose, straight_path
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.filtering.tracking import LONGEST_STRETCH
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.motions.target_search import TargetSearch
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots import TorqueLimit
from robots.kinematics import place
from robots.servo import LIMIT_MODES


@pytest.fixture(scope="module")
def fall(world):
    return sample_falls(world, {"prone": 1}, np.random.default_rng(2))[0].posture


@pytest.fixture(scope="module")
def rollouts(world, fall, database):
    candidates = _candidates(world, fall, database)
    dynamics_filter = DynamicsFilter(world)
    return dynamics_filter, candidates, dynamics_filter.roll_out(fall, candidates)


def _candidates(world, fall, database):
    period = world.robot.control_period
    return [
        Candidate(
            path=straight_path(fall, align(c.posture, fall), 3.0, period),
            connection=c,
            assistance=share,
        )
        for c in database.select(fall, 2)
        for share in (1.0, 0.0)
    ]


def test_targets_obey_the_guards_rules(world, fall, rollouts):
    robot = world.robot
    for one in nonempty(rollouts[2]):
        before = np.concatenate([fall.joint_pos[None], one.target[:-1]])
        speed = np.abs(one.target - before) / robot.control_period
        assert np.all(speed <= robot.max_velocity)
        assert np.all(one.target >= robot.lower)
        assert np.all(one.target <= robot.upper)


@pytest.mark.parametrize("by", ["pwm"])
def test_rollouts_and_checks_run_under_the_torque_limit_as_it_acts(world, fall, database, by):
    """A limited PWM leaves less torque to a servo that turns: the robot goes another way."""
    limited = DynamicsFilter(world, PlannerSettings(torque_limit=TorqueLimit(2.0, by)))
    candidate = _candidates(world, fall, database)[0]
    (one,) = limited.roll_out(fall, [candidate])
    starts = place(world.robot, world.model, fall)[None]
    same, other = (
        play(
            world,
            Scenarios(
                starts=starts,
                parameters=DomainParameters.nominal(world, 1, torque_limit=2.0, limit_by=mode),
            ),
            one.target[None],
        )
        for mode in (by, "ideal")
    )
    np.testing.assert_array_equal(same.qpos[0], one.qpos)
    assert np.abs(other.qpos[0] - one.qpos).max() > 0.01


def test_without_assistance_the_targets_are_the_reference_within_the_servos_limits(
    world, fall, rollouts
):
    _, candidates, results = rollouts
    assert 0.001 < np.abs(results[0].target - results[1].target).max() < 0.8
    c = candidates[1]
    reference = compose(world, c.path, c.connection.motion, c.connection.frame)
    expected = world.robot.limit_targets(reference.target, fall.joint_pos)
    np.testing.assert_allclose(results[1].target[: len(expected)], expected)


def test_targets_stand_still_from_the_end_of_the_reference_on(world, rollouts):
    """For a second: the virtual actuator has let go by then."""
    for one in nonempty(rollouts[2]):
        hold = one.target[one.moving :]
        assert len(hold) >= 125
        np.testing.assert_allclose(hold, np.tile(hold[-1], (len(hold), 1)), atol=1e-12)
        assert len(one.target) == len(one.qpos) == max(r.moving for r in rollouts[2]) + 125
        assert one.peak_neck < 1.1 * world.robot.standing_neck_height


@pytest.mark.parametrize(
    ("least", "falls", "share", "played"),
    [
        (0.0, (3, 7, 15), 13 / 16, [16]),
        (0.0, (0,), 0.0, [16]),
        (0.5, (1, 2, 3, 4, 5, 6, 7, 8), 0.5, [4, 12]),
        (0.5, (1, 2, 3, 4, 5, 6, 7, 8, 9), 0.0, [4, 12]),
        (0.9, (1, 2), 0.0, [4]),
    ],
)
def test_a_check_is_the_share_of_sixteen_and_ends_below_the_least(
    world, fall, monkeypatch, least, falls, share, played
):
    """What stood in one world or another is the same as in a check to its end."""
    checked = DynamicsFilter(world, PlannerSettings(torque_limit=TorqueLimit(2.0, "current")))
    target, sizes, seen = np.tile(fall.joint_pos, (200, 1)), [], []

    def compare(_, worlds, motions, *, give_up):
        assert give_up is (not seen), "a fall in the first world ends it"
        assert motions == [target]
        assert set(worlds.parameters.limit_by.tolist()) == {LIMIT_MODES.index("current")}
        assert np.all(worlds.parameters.torque_limit <= 2.0)
        first, count = len(seen), len(worlds.starts)
        sizes.append(count)
        seen.extend(worlds.starts)
        stood = np.array([[k not in falls for k in range(first, first + count)]])
        return SimpleNamespace(stood=stood, record=SimpleNamespace(duration=0.0))

    monkeypatch.setattr(Experiment, "compare", compare)
    assert checked.check(fall, target, np.random.default_rng(0), least=least) == share
    assert (sizes, checked.count) == (played, sum(played))
    np.testing.assert_array_equal(seen[0], place(world.robot, world.model, fall))
    assert len({row.tobytes() for row in seen}) == sum(played)


def test_a_prone_fall_has_a_rollout_that_stands_and_survives_disturbance(fall, rollouts):
    dynamics_filter, _, results = rollouts
    standing = [r for r in results if r.stood]
    assert standing
    assert dynamics_filter.check(fall, standing[0].target, np.random.default_rng(0)) >= 0.8


WEAK = TorqueLimit(1.6, "pwm")
SLOWDOWN = Slowdown(tolerance=0.15, band=0.15, slowest=0.2)


@pytest.fixture(scope="module")
def waiting(world, fall, database):
    """A candidate under a limit that is too weak for its speed, without slowdown and with it."""
    candidate = _candidates(world, fall, database)[1]
    weak = DynamicsFilter(world, PlannerSettings(torque_limit=WEAK))
    return weak.roll_out(fall, [candidate, replace(candidate, slowdown=SLOWDOWN)])


def test_a_motion_that_slows_down_waits_for_its_servos(world, waiting):
    layout = world.robot.layout(world.model)
    lag = []
    for one in waiting:
        behind = np.abs(one.target - one.qpos[:, layout.qpos])[: one.moving]
        lag.append(np.percentile(behind.max(axis=1), 90))
    plain, slowed = waiting
    longest = LONGEST_STRETCH * plain.moving + 1
    assert 1.2 * plain.moving < slowed.moving <= longest
    assert lag[1] < lag[0]


def test_at_half_speed_every_second_target_is_in_the_middle_of_two(world, fall, database):
    candidate = replace(_candidates(world, fall, database)[0], assistance=0.0)
    half = Slowdown(tolerance=-1.0, band=0.1, slowest=0.5)  # whatever the servos do
    plain, slowed = DynamicsFilter(world).roll_out(
        fall, [candidate, replace(candidate, slowdown=half)]
    )
    count = plain.moving
    assert count > 100
    assert slowed.moving == 2 * count
    quick, slow = plain.target[:count], slowed.target[: 2 * count]
    between = (quick[:-1] + quick[1:]) / 2.0
    for found, expected in ((slow[::2], quick), (slow[1:-1:2], between)):
        is_same = np.isclose(found, expected, atol=1e-9).all(axis=1)
        assert is_same.mean() > 0.95  # elsewhere joints cannot follow a step at full speed


def test_a_searched_rise_is_checked_in_fresh_worlds_and_searched_on_where_it_falls(
    fall, rollouts, monkeypatch
):
    dynamics_filter, _, results = rollouts
    target = results[0].target[: results[0].moving]
    searched, checked = [], []

    def search(_, worlds, target, _budget, _rng):
        searched.append(worlds)
        share = 1.0 if len(searched) < 3 else 15 / 16
        return SimpleNamespace(target=target, share=share, rollouts=1, simulated=1.0)

    def compare(_, worlds, _motions, *, give_up):
        assert give_up
        checked.append(worlds)
        stood = np.ones((1, 16), dtype=bool)
        stood[0, 16 - len(checked) :] = False
        return SimpleNamespace(stood=stood, record=SimpleNamespace(duration=1.0))

    monkeypatch.setattr(TargetSearch, "search", search)
    monkeypatch.setattr(Experiment, "compare", compare)
    better, share = dynamics_filter.search(fall, results[0], 100.0, np.random.default_rng(0))
    assert len(checked) == len(searched) == 3
    assert searched[1] is checked[0]
    assert searched[2] is checked[1]
    assert all(worlds is not searched[0] for worlds in checked)
    assert share == 13 / 16
    np.testing.assert_array_equal(better.target[: better.moving], target)


def test_a_better_rise_that_stands_in_fewer_worlds_is_not_taken(fall, rollouts, monkeypatch):
    dynamics_filter, _, results = rollouts
    stands = next(r for r in results if r.stood)
    better, lies = stands.target[: stands.moving].copy(), np.tile(fall.joint_pos, (50, 1))
    for target, share, is_taken in (
        (better, 15 / 16, False),
        (better, 1.0, True),
        (lies, 1.0, False),
    ):
        found = SimpleNamespace(targets=[target], rollouts=2, simulated=0.0)
        monkeypatch.setattr(TargetSearch, "improve", lambda *_, found=found: found)
        monkeypatch.setattr(dynamics_filter, "check", lambda *_, share=share, **_options: share)
        one = dynamics_filter.improve(fall, stands, 1.0, np.random.default_rng(0))
        assert (one is not stands) is is_taken
