"""An evolution moves to where it costs less, a seed repeats it, and cma weighs parents alike."""

import numpy as np
from cma.recombination_weights import RecombinationWeights

from humanoid_getup.filtering.evolution_strategy import PARENTS, EvolutionStrategy
from robots.quaternion import Array

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


def test_rows_are_ranked_by_cost_and_of_equals_the_first_is_first():
    population = make()
    population.ask()
    cost = np.tile([2.0, 1.0], SIZE // 2)
    assert population.tell(cost).tolist() == [*range(1, SIZE, 2), *range(0, SIZE, 2)]


def test_parents_weigh_as_in_cma_es():
    population = make()
    genes = population.ask().copy()
    order = population.tell(cost_of(genes))
    weights = np.array(RecombinationWeights(2 * PARENTS).positive_weights)
    np.testing.assert_allclose(population.mean, weights @ genes[order[: len(weights)]])
