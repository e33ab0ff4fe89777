"""The population samples about its keyframes in steps of time and angle, and goes where it costs
less."""

import cma
import numpy as np
import pytest
from authored import load_robot_keyframes

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.scoring import ANGLE_STEP, TIME_STEP, KeyframePopulation
from robots import Robot

SIZE = 12


@pytest.fixture(scope="module")
def keyframes(op3: Robot) -> Keyframes:
    return next(k for k in load_robot_keyframes(op3) if k.name == "squat_to_stand")


def test_its_candidates_are_those_of_cma_es_on_scaled_genes(op3: Robot, keyframes: Keyframes):
    scale = np.where(
        np.arange(len(keyframes.genes)) < len(keyframes.duration), TIME_STEP, ANGLE_STEP
    )
    options = {"popsize": SIZE, "seed": 4, "verbose": -9}
    search = cma.CMAEvolutionStrategy(keyframes.genes / scale, 1.5, options)
    expected = [keyframes.with_genes(g * scale, op3) for g in search.ask()]
    candidates = KeyframePopulation(keyframes, op3, size=SIZE, seed=3, step=1.5).ask()
    assert len(candidates) == SIZE
    for candidate, other in zip(candidates, expected, strict=True):
        np.testing.assert_array_equal(candidate.keys, other.keys)
        np.testing.assert_array_equal(candidate.duration, other.duration)


def test_it_moves_towards_what_costs_less(op3: Robot, keyframes: Keyframes):
    population = KeyframePopulation(keyframes, op3, size=SIZE, seed=0)
    before = float(keyframes.duration.sum())
    for _ in range(8):
        population.tell(np.array([one.duration.sum() for one in population.ask()]))
    assert float(population.mean.duration.sum()) < 0.9 * before
