"""Populations move to where it costs less, a seed repeats them, and cma weighs parents alike."""

import numpy as np
import pytest
from cma.recombination_weights import RecombinationWeights

from humanoid_getup.motions.population import (
    PARENTS,
    CrossEntropy,
    EvolutionStrategy,
    Population,
)
from robots.quaternion import Array

SIZE, GOAL = 20, np.array([0.5, -0.3, 0.2])
BOUNDS = (np.full(3, -0.4), np.full(3, 0.4))


def make(kind: str, seed: int = 0) -> Population:
    rng, mean = np.random.default_rng(seed), np.zeros(3)
    if kind == "evolution":
        return EvolutionStrategy(mean, 0.2, SIZE, rng)
    return CrossEntropy(mean, 0.2, SIZE, rng, least_spread=0.05, bounds=BOUNDS)


def cost_of(genes: Array) -> Array:
    return np.square(genes - GOAL).sum(axis=1)


def run(population: Population, generations: int) -> Array:
    for _ in range(generations):
        population.tell(cost_of(population.ask()))
    return population.mean


@pytest.mark.parametrize("kind", ["evolution", "cross-entropy"])
def test_it_moves_to_where_it_costs_less_and_a_seed_repeats_it(kind: str):
    nearest = np.clip(GOAL, *BOUNDS) if kind == "cross-entropy" else GOAL
    np.testing.assert_allclose(run(make(kind), 30), nearest, atol=0.15)
    np.testing.assert_array_equal(run(make(kind), 3), run(make(kind), 3))
    assert not np.array_equal(run(make(kind), 3), run(make(kind, seed=1), 3))


@pytest.mark.parametrize("kind", ["evolution", "cross-entropy"])
def test_rows_are_ranked_by_cost_and_of_equals_the_first_is_first(kind: str):
    population = make(kind)
    population.ask()
    cost = np.tile([2.0, 1.0], SIZE // 2)
    assert population.tell(cost).tolist() == [*range(1, SIZE, 2), *range(0, SIZE, 2)]


def test_parents_weigh_as_in_cma_es():
    population = make("evolution")
    genes = population.ask().copy()
    order = population.tell(cost_of(genes))
    weights = np.array(RecombinationWeights(2 * PARENTS).positive_weights)
    np.testing.assert_allclose(population.mean, weights @ genes[order[: len(weights)]])


def test_cross_entropy_keeps_its_bounds_and_never_stops_to_spread():
    population = make("cross-entropy")
    for _ in range(10):
        genes = population.ask()
        assert np.all((genes >= BOUNDS[0]) & (genes <= BOUNDS[1]))
        population.tell(cost_of(genes))
    assert np.all(population.spread >= 0.05)
