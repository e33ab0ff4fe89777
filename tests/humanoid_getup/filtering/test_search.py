import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.disturbance import USUAL, Scenarios
from humanoid_getup.filtering.search import SAMPLES, TargetSearch
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.preference import Preference
from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor
from robots import TorqueLimit
from robots.kinematics import place

COUNT = 4


@pytest.fixture(scope="module")
def motion(op3):
    return next(m for m in load_database(op3).motions if m.name == "prone_push_up_fast")


@pytest.fixture(scope="module")
def search(world):
    return TargetSearch(world, preference=Preference.of("time"))


@pytest.fixture(scope="module")
def make_worlds(world, motion):
    def make(torque_limit: float) -> Scenarios:
        start = place(world.robot, world.model, motion.posture(0))
        limit, rng = TorqueLimit(torque_limit, "pwm"), np.random.default_rng(4)
        return USUAL.sample(world, start, COUNT, rng, limit)

    return make


def test_what_stands_everywhere_is_left_alone(search, motion, make_worlds):
    found = search.search(make_worlds(4.1), motion.joint_target, 100.0, np.random.default_rng(0))
    assert found.share == 1.0
    assert (found.generations, found.rollouts) == (0, COUNT)
    assert found.target is motion.joint_target


def test_a_motion_too_quick_for_weak_servos_is_made_to_stand(search, motion, make_worlds):
    """Undisturbed it falls at this limit, too."""
    worlds = make_worlds(2.8)
    found = search.search(worlds, motion.joint_target, 400.0, np.random.default_rng(0))
    assert found.share == 1.0
    assert found.generations > 0
    outcome = search.experiment.compare(worlds, [found.target, motion.joint_target])
    assert outcome.stood[0].all()
    assert not outcome.stood[1].any()


def test_the_budget_ends_a_search_and_one_seed_finds_one_result(search, motion, make_worlds):
    still = np.tile(motion.joint_pos[:1], (30, 1))
    first, second = (
        search.search(make_worlds(2.8), still, 10.0, np.random.default_rng(7)) for _ in range(2)
    )
    assert first.share == 0.0
    assert 10.0 <= first.simulated < 40.0
    assert (first.generations, first.simulated) == (second.generations, second.simulated)
    np.testing.assert_array_equal(first.target, second.target)


def test_a_search_tells_its_effort_and_is_cancelled_between_two_generations(
    world, motion, make_worlds
):
    seen = list[Progress]()
    monitor = ProgressMonitor(seen.append, lambda: len(seen) == 3)
    search = TargetSearch(world, preference=Preference.of("time"), monitor=monitor)
    still = np.tile(motion.joint_pos[:1], (30, 1))
    with pytest.raises(CancelledError):
        search.search(make_worlds(2.8), still, 1e3, np.random.default_rng(7))
    simulated = [each.done for each in seen]
    assert simulated == sorted(simulated)
    assert 0.0 < simulated[0] < simulated[2] < 1e3
    each = COUNT * SAMPLES  # all worlds are among the hardest
    assert [one.note for one in seen] == [f"{COUNT + n * each} rollouts" for n in range(3)]
    assert {(one.phase, one.total) for one in seen} == {("varying targets [s simulated]", 1e3)}


def test_a_quick_motion_that_does_not_touch_itself_is_left_alone(search, motion, make_worlds):
    improved = search.improve(make_worlds(4.1), motion.joint_target, 100.0, np.random.default_rng())
    assert improved.targets == []
    assert improved.rollouts == COUNT


def test_what_stands_is_made_cheaper_and_stands(world, motion, make_worlds):
    search = TargetSearch(world, preference=Preference.of("torque"))
    worlds = make_worlds(4.1).take(np.arange(2))
    first, second = (
        search.improve(worlds, motion.joint_target, 150.0, np.random.default_rng(3))
        for _ in range(2)
    )
    assert 150.0 <= first.simulated < 400.0
    np.testing.assert_array_equal(first.targets[0], second.targets[0])
    outcome = search.experiment.compare(worlds, [*first.targets, motion.joint_target])
    assert outcome.stood.all()
    cost = search.preference.cost(outcome).mean(axis=1)
    assert np.all(np.diff(cost) >= 0.0)  # cheapest first, and what they came from last
    assert cost[0] < 0.95 * cost[-1]
