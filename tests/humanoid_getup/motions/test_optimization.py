from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from authored import load_robot_keyframes
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty

from humanoid_getup.experiments.disturbances import USUAL, Scenarios
from humanoid_getup.experiments.falls import classify
from humanoid_getup.experiments.judging.outcome import DEEP_OVERLAP
from humanoid_getup.experiments.rollouts import play
from humanoid_getup.motions import optimization
from humanoid_getup.motions.build import lay_down, lay_on_side, settle
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.motions.optimization import TrajectoryOptimizer, make_scenarios
from humanoid_getup.motions.preference import PREFERENCE_NAMES, Preference
from humanoid_getup.motions.trial import score
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import TorqueLimit, load_robot
from robots.servo import LIMIT_MODES

HOLD = 1.0


@pytest.fixture(scope="module")
def keyframes(op3):
    return next(k for k in load_robot_keyframes(op3) if k.name == "squat_to_stand")


@pytest.fixture(scope="module")
def start(world, keyframes):
    return settle(world, keyframes)


@pytest.fixture(scope="module")
def trace(world, keyframes, start):
    """The keyframes, and a robot that stays where it is."""
    targets = keyframes.targets(world.robot, HOLD + 0.2)
    still = hold_last(targets[:1], len(targets))
    return play(
        world,
        Scenarios(starts=np.tile(start, (2, 1)), parameters=DomainParameters.nominal(world, 2)),
        np.array([targets, still]),
    )


def test_scenarios_cover_several_torque_limits_in_the_robots_own_mode(world, start):
    scenarios = make_scenarios(world, start, 2.0, 11, USUAL, np.random.default_rng(0))
    starts, parameters = scenarios.starts, scenarios.parameters
    limits = parameters.torque_limit
    np.testing.assert_allclose(limits, [2.0, 4.1, *[2.0, 3.0, 2.5] * 3], atol=0.01)
    assert {LIMIT_MODES[mode] for mode in parameters.limit_by} == {TorqueLimit().on(world.robot).by}
    np.testing.assert_allclose(starts[:2], np.tile(start, (2, 1)), atol=0.01)
    assert len(np.unique(starts[2:], axis=0)) == len(starts) - 2
    # None has more torque than permitted.
    rng = np.random.default_rng(0)
    scenarios = make_scenarios(world, start, 2.7, 11, USUAL, rng, bounds=(0.0, 2.7))
    limits = scenarios.parameters.torque_limit
    np.testing.assert_allclose(limits, [2.7, 2.7, *[2.7, 2.7, 2.5] * 3], atol=0.01)


def test_keyframes_that_fail_are_changed_until_they_succeed_once(world, keyframes, start):
    away = np.random.default_rng(0).normal(0.0, 0.9, len(keyframes.genes))
    failing = keyframes.with_genes(keyframes.genes + away, world.robot)
    optimizer = TrajectoryOptimizer(world, start)
    assert optimizer.find_success(failing, 0, 3) is None
    found = optimizer.find_success(failing, 8, 3)
    assert found is not None
    assert optimizer.find_success(found, 0, 0) is found


def test_a_preference_replaces_what_the_keyframes_weigh(world, keyframes, trace):
    costs = [
        score(trace, world, replace(keyframes, torque_cost=t), HOLD, Preference.of("time"))[0]
        for t in (0.0, 5.0)
    ]
    np.testing.assert_array_equal(*costs)


@pytest.mark.slow
def test_keyframes_that_nearly_succeed_are_improved_by_the_worlds_in_which_they_fail(
    world, op3, monkeypatch
):
    """With 1.55 N·m a push-up stands in 36 of 48 worlds."""
    monkeypatch.setattr(optimization, "PRACTICE", 16)
    monkeypatch.setattr(optimization, "ROUNDS", 1)
    monkeypatch.setattr(optimization, "EACH_ROUND", 1)
    weak = next(k for k in load_robot_keyframes(op3) if k.name == "prone_push_up_fast")
    weak = replace(weak, torque_limit=1.55)
    optimizer = TrajectoryOptimizer(world, settle(world, weak), bounds=(0.0, 1.55))
    before = optimizer.judge(weak, 0)[1].sum()
    better = optimizer.improve(weak, 0)
    assert optimizer.judge(better, 0)[1].sum() > before
    assert len(better.keys) == len(weak.keys)
    assert better.torque_limit == weak.torque_limit


@pytest.fixture(scope="module")
def wolfgang() -> World:
    return World(load_robot("wolfgang"))


def find_side(world: World, qpos: np.ndarray) -> str | None:
    return classify(qpos[world.robot.layout(world.model).root_orientation])


@pytest.mark.parametrize("side", ["prone", "left"])
def test_op3_stays_on_each_side_with_the_joints_of_its_stance(world: World, side):
    laid = lay_on_side(world, side, np.random.default_rng(0))
    assert laid is not None
    assert np.array_equal(laid, lay_down(world, side, world.robot.standing.joint_pos))
    assert find_side(world, laid) == side


def test_a_robot_that_rolls_off_its_side_is_laid_there_with_other_joints(wolfgang: World):
    rolled = lay_down(wolfgang, "left", wolfgang.robot.standing.joint_pos)
    assert find_side(wolfgang, rolled) == "prone"
    laid = lay_on_side(wolfgang, "left", np.random.default_rng(0))
    assert laid is not None
    assert find_side(wolfgang, laid) == "left"
    again = lay_on_side(wolfgang, "left", np.random.default_rng(0))
    assert np.array_equal(laid, again)


FIGURES = ("stand_time", "peak_torque", "rms_torque", "neck_delta_v", "overlap")
amounts = st.floats(0.0, 10.0)


@dataclass(frozen=True)
class Figures:
    """What a preference weighs."""

    stand_time: np.ndarray
    peak_torque: np.ndarray
    rms_torque: np.ndarray
    neck_delta_v: np.ndarray
    overlap: np.ndarray
    detour: np.ndarray = field(default_factory=lambda: np.zeros(1))
    height_lost: np.ndarray = field(default_factory=lambda: np.zeros(1))
    jerk: np.ndarray = field(default_factory=lambda: np.zeros(1))
    peak_braking_torque: float = 0.0

    @property
    def collides(self) -> np.ndarray:
        return self.overlap > DEEP_OVERLAP


def make_figures(*values: float) -> Figures:
    return Figures(*(np.array([value]) for value in values))


@pytest.mark.parametrize("name", PREFERENCE_NAMES)
@given(values=st.tuples(*[amounts] * 5), figure=st.sampled_from(FIGURES), more=st.floats(0.01, 5.0))
def test_no_figure_that_grows_makes_a_rise_cheaper(name, values, figure, more):
    preference, figures = Preference.of(name), make_figures(*values)
    worse = replace(figures, **{figure: getattr(figures, figure) + more})
    assert preference.cost(worse)[0] >= preference.cost(figures)[0]


def test_a_preference_counts_most_what_it_is_named_after():
    """Beside a share of what is usual: 3 s, 4 N·m, 0.5 N·m, 0.3 m/s."""
    usual = make_figures(3.0, 4.0, 0.5, 0.3, 0.0)
    names = {"stand_time": "time", "rms_torque": "torque", "neck_delta_v": "impact"}
    for figure, name in nonempty(names.items()):
        cost = Preference.of(name).cost
        less = {f: replace(usual, **{f: 0.9 * getattr(usual, f)}) for f in names}
        spared = {f: cost(usual)[0] - cost(fewer)[0] for f, fewer in less.items()}
        assert max(spared, key=spared.__getitem__) == figure, name


def test_touching_itself_firmly_costs_a_second():
    free, firm = (make_figures(3.0, 4.0, 0.5, 0.3, share * DEEP_OVERLAP) for share in (0.9, 1.1))
    assert (free.collides[0], firm.collides[0]) == (False, True)
    for name in PREFERENCE_NAMES:
        cost = Preference.of(name).cost
        assert cost(firm)[0] > cost(free)[0] + 0.99, name
