from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cma.recombination_weights import RecombinationWeights

from humanoid_getup.experiments.disturbances import USUAL, Scenarios
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.motions.preference import Preference
from humanoid_getup.motions.target_search import (
    PARENTS,
    SAMPLES,
    EvolutionStrategy,
    TargetSearch,
    Variation,
    coarsen,
    pair_directions,
)
from humanoid_getup.progress.callback import CancelledError, Progress, ProgressMonitor
from humanoid_getup.simulation.world import World, count_substeps
from robots import TorqueLimit, load_robot
from robots.kinematics import place
from robots.quaternion import Array

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


def test_a_motion_too_quick_for_weak_servos_is_made_to_stand(search, motion, make_worlds):
    """Undisturbed it falls at this limit, too."""
    worlds = make_worlds(2.8)
    found = search.search(worlds, motion.joint_target, 400.0, np.random.default_rng(0))
    assert found.share == 1.0
    assert found.generations > 0
    outcome = search.experiment.compare(worlds, [found.target, motion.joint_target])
    assert outcome.stood.all(axis=1).tolist() == [True, False]


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
    first = search.improve(worlds, motion.joint_target, 150.0, np.random.default_rng(3))
    assert 150.0 <= first.simulated < 400.0
    outcome = search.experiment.compare(worlds, [*first.targets, motion.joint_target])
    assert outcome.stood.all()
    cost = search.preference.cost(outcome).mean(axis=1)
    assert np.all(np.diff(cost) >= 0.0)  # cheapest first, and what they came from last
    assert cost[0] < 0.95 * cost[-1]


SIZE, GOAL = 20, np.array([0.5, -0.3, 0.2])


def make(seed: int = 0) -> EvolutionStrategy:
    return EvolutionStrategy(np.zeros(3), 0.2, SIZE, np.random.default_rng(seed))


def cost_of(genes: Array) -> Array:
    return np.square(genes - GOAL).sum(axis=1)


def run(population: EvolutionStrategy, generations: int) -> Array:
    for _ in range(generations):
        population.tell(cost_of(population.ask()))
    return population.mean


def test_it_moves_to_where_it_costs_less_and_a_seed_repeats_it():
    np.testing.assert_allclose(run(make(), 30), GOAL, atol=0.15)
    np.testing.assert_array_equal(run(make(), 3), run(make(), 3))
    assert not np.array_equal(run(make(), 3), run(make(seed=1), 3))


def test_parents_weigh_as_in_cma_es():
    population = make()
    genes = population.ask().copy()
    order = population.tell(cost_of(genes))
    weights = np.array(RecombinationWeights(2 * PARENTS).positive_weights)
    np.testing.assert_allclose(population.mean, weights @ genes[order[: len(weights)]])


@pytest.fixture
def target(op3):
    """Targets that sway within the joints' limits, slower than the servos."""
    middle, half = (op3.upper + op3.lower) / 2.0, (op3.upper - op3.lower) / 4.0
    phase = np.linspace(0.0, 2.0 * np.pi, 400)[:, None]
    return middle + 0.3 * half * np.sin(phase)


def test_a_pair_of_joints_moves_as_its_own_mirror_image(op3):
    directions = pair_directions(op3)
    assert len(directions) == 7  # arms: two and an elbow; legs: two hips, a knee and an ankle
    np.testing.assert_array_equal(op3.mirror_joints(directions), directions)


def test_stretches_last_as_much_longer_as_their_tempo_says(op3, target):
    slow = Variation.of(np.zeros(Variation.size(op3)))
    slow.tempo[0] = np.log(2.0)  # the first of six stretches: a sixth of the motion longer
    longer = slow.apply(target, target[0], op3)
    assert len(longer) == pytest.approx(len(target) * 7.0 / 6.0, abs=2)
    np.testing.assert_allclose(longer[-1], target[-1], atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_variations_keep_limits_and_speed_and_end_in_the_same_posture(op3, target, seed):
    varied = Variation.of(np.random.default_rng(seed).normal(size=Variation.size(op3)))
    sent = varied.apply(target, target[0], op3)
    steps = np.diff(sent, axis=0, prepend=target[:1])
    assert np.all(np.abs(steps) <= op3.max_velocity * op3.control_period)
    assert np.all((sent >= op3.lower) & (sent <= op3.upper))
    np.testing.assert_allclose(sent[-1], target[-1], atol=0.05)


@pytest.fixture(scope="module")
def human_world() -> World:
    return World(load_robot("human"))


def test_a_big_one_has_longer_steps_and_no_dry_friction_there_alone(human_world: World):
    coarse = coarsen(human_world)
    assert coarse.model.opt.timestep == pytest.approx(0.01 / 3)
    assert count_substeps(coarse.model, human_world.robot.control_period) == 3
    assert not coarse.model.dof_frictionloss.any()
    assert human_world.model.dof_frictionloss.any()
    assert human_world.model.opt.timestep == 0.002
    assert coarse.scene is human_world.scene


def test_checks_and_what_is_played_in_the_end_are_of_the_world_itself(human_world: World):
    start = human_world.robot.standing
    dynamics, target = DynamicsFilter(human_world), np.tile(start.joint_pos, (5, 1))
    nominal = Scenarios.nominal(human_world, place(human_world.robot, human_world.model, start))
    twin = Experiment(human_world).play(nominal, np.tile(start.joint_pos, (1, 50, 1)))
    found: Any = SimpleNamespace(candidate=None, target=target, moving=5)
    rough = dynamics.replay(start, [found], [target])[0].qpos[:50]
    fine = dynamics.confirm(start, found).qpos[:50]
    np.testing.assert_array_equal(fine, twin.qpos[0])
    assert np.abs(rough - fine).max() > 0.0
