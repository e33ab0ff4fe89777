"""A disturbance draws what differs and nothing else; without any, robots are as described."""

from dataclasses import fields

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances.distributions import (
    Mixture,
    Normal,
    RandomAxis,
    Uniform,
    draw,
)
from humanoid_getup.experiments.disturbances.disturbance import USUAL, Disturbance
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots.kinematics import place

COUNT = 200


def same(one: DomainParameters, other: DomainParameters) -> list[str]:
    names = [field.name for field in fields(DomainParameters)]
    return [name for name in names if np.array_equal(getattr(one, name), getattr(other, name))]


def test_no_disturbance_is_nominal_and_draws_nothing(world: World):
    rng = np.random.default_rng(0)
    start = place(world.robot, world.model, world.robot.standing)
    scenarios = Disturbance().sample(world, start, 3, rng)
    nominal = DomainParameters.nominal(world, 3)
    assert same(scenarios.parameters, nominal) == [f.name for f in fields(DomainParameters)]
    np.testing.assert_array_equal(scenarios.starts, [start] * 3)
    assert rng.random() == np.random.default_rng(0).random()


def test_the_first_scenario_is_nominal_and_a_seed_draws_one_set(world: World):
    start = place(world.robot, world.model, world.robot.standing)
    one, again = (USUAL.sample(world, start, 4, np.random.default_rng(3)) for _ in range(2))
    assert len(same(one.parameters, again.parameters)) == len(fields(DomainParameters))
    np.testing.assert_array_equal(one.starts, again.starts)
    first = one.parameters.take(np.arange(1))
    assert len(same(first, DomainParameters.nominal(world, 1))) == len(fields(DomainParameters))
    assert len(np.unique(one.starts, axis=0)) == 4


@pytest.mark.parametrize("name", ["mass", "armature", "friction_loss", "friction", "backlash"])
def test_a_constant_is_itself_and_changes_nothing_else(world: World, name: str):
    changed = Disturbance(**{name: 1.7}).draw(world, 2, np.random.default_rng(0))
    assert np.all(getattr(changed, name) == 1.7)
    names = {field.name for field in fields(DomainParameters)}
    assert set(same(changed, DomainParameters.nominal(world, 2))) == names - {name}


def test_one_servo_of_each_robot_is_weak(world: World):
    drawn = Disturbance(weak_servo=0.6).draw(world, COUNT, np.random.default_rng(0))
    assert np.all((drawn.strength == 0.6).sum(axis=1) == 1)
    assert np.all((drawn.strength == 1.0).sum(axis=1) == world.robot.n - 1)
    assert len(np.unique(np.argmin(drawn.strength, axis=1))) == world.robot.n


def test_distributions_have_their_range_size_and_probability():
    rng = np.random.default_rng(0)
    assert np.linalg.norm(draw(RandomAxis(0.3), rng, COUNT, 3), axis=1) == pytest.approx(0.3)
    assert draw(Normal(2.0), rng, 20 * COUNT).std() == pytest.approx(2.0, rel=0.05)
    mixed = draw(Mixture(0.25, 7.0, Uniform(0.0, 1.0)), rng, 20 * COUNT)
    assert np.mean(mixed == 7.0) == pytest.approx(0.25, abs=0.03)
    assert mixed[mixed != 7.0].max() <= 1.0
