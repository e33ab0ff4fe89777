"""A disturbance draws what differs and nothing else; without any, robots are as described."""

from dataclasses import fields, replace

import numpy as np
import pytest
from stored_plans import lie_at_start

from humanoid_getup.experiments.disturbances import (
    USUAL,
    Disturbance,
    LogUniform,
    Mixture,
    Normal,
    RandomAxis,
    Uniform,
    draw,
)
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import quaternion
from robots.kinematics import lowest_point, place
from robots.quaternion import Array

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


@pytest.mark.parametrize("name", ["mass", "backlash"])
def test_a_constant_is_itself_and_changes_nothing_else(world: World, name: str):
    changed = Disturbance(**{name: 1.7}).draw(world, 2, np.random.default_rng(0))
    assert np.all(getattr(changed, name) == 1.7)
    names = {field.name for field in fields(DomainParameters)}
    assert set(same(changed, DomainParameters.nominal(world, 2))) == names - {name}


def test_distributions_have_their_range_size_and_probability():
    rng = np.random.default_rng(0)
    for shape in ((3,), (COUNT, 3), (4, 5, 3)):
        length = np.linalg.norm(draw(RandomAxis(0.3), rng, *shape), axis=-1)
        assert length == pytest.approx(np.full(shape[:-1], 0.3))
    normal = draw(Normal(2.0), rng, 20 * COUNT)
    assert normal.std() == pytest.approx(2.0, rel=0.05)
    assert normal.mean() == pytest.approx(0.0, abs=0.1)
    for quantity in (Uniform(0.25, 4.0), LogUniform(0.25, 4.0)):
        drawn = draw(quantity, rng, 20 * COUNT)
        assert 0.25 <= drawn.min() < 0.27
        assert 3.9 < drawn.max() <= 4.0
        is_even = isinstance(quantity, Uniform)
        assert np.mean(drawn < 1.0) == pytest.approx(0.2 if is_even else 0.5, abs=0.03)
    mixed = draw(Mixture(0.25, 7.0, Uniform(0.0, 1.0)), rng, 20 * COUNT)
    assert np.mean(mixed == 7.0) == pytest.approx(0.25, abs=0.03)
    assert mixed[mixed != 7.0].max() <= 1.0


@pytest.fixture(scope="module")
def lying(world: World) -> tuple[World, Array]:
    """A robot that has come to lie on its face, on flat ground."""
    return world, place(world.robot, world.model, lie_at_start(world))


def sample_starts(world: World, start: Array, count: int = 12, **changes) -> Array:
    return Disturbance(**changes).sample(world, start, count, np.random.default_rng(5)).starts


def test_a_turn_turns_every_robot_but_the_first_by_its_angle(lying: tuple[World, Array]):
    world, start = lying
    layout = world.robot.layout(world.model)
    starts = sample_starts(world, start, turn=0.2)
    turned = starts[:, layout.root_orientation]
    angle = quaternion.angle_between(turned, start[layout.root_orientation])
    assert angle == pytest.approx([0.0, *[0.2] * 11], abs=1e-6)
    np.testing.assert_array_equal(starts[:, layout.qpos], np.tile(start[layout.qpos], (12, 1)))


def test_offsets_move_every_joint_within_its_range(lying: tuple[World, Array]):
    world, start = lying
    layout, robot = world.robot.layout(world.model), world.robot
    starts = sample_starts(world, start, 100, joints=Normal(0.1))
    moved = starts[:, layout.qpos] - start[layout.qpos]
    assert not moved[0].any()
    free = np.minimum(robot.upper - start[layout.qpos], start[layout.qpos] - robot.lower) > 0.4
    assert moved[1:, free].std() == pytest.approx(0.1, rel=0.1)
    assert np.all(starts[:, layout.qpos] <= robot.upper)
    assert np.all(starts[:, layout.qpos] >= robot.lower)
    for row in starts:  # as deep in the ground as the one that came to rest
        assert lowest_point(world.model, row) == pytest.approx(lowest_point(world.model, start))


def test_no_offset_puts_limbs_into_each_other(world: World):
    """Joints between limbs that would collide turn back or less; others turn as is drawn."""
    layout, robot, clearance = world.robot.layout(world.model), world.robot, Clearance(world)
    start = place(robot, world.model, robot.standing)
    moved = sample_starts(world, start, COUNT, joints=Normal(0.1))
    drawn = draw(Normal(0.1), np.random.default_rng(5), COUNT, robot.n)
    wished = np.tile(start, (COUNT, 1))
    wished[1:, layout.qpos] = np.clip(start[layout.qpos] + drawn[1:], robot.lower, robot.upper)
    most = clearance.measure_self_overlap(start) + 0.001
    collides = np.array([clearance.measure_self_overlap(row) for row in wished]) > most
    assert 0.05 < collides.mean() < 0.5
    assert max(clearance.measure_self_overlap(row) for row in moved) <= most
    joints, wished = moved[:, layout.qpos], wished[:, layout.qpos]
    np.testing.assert_array_equal(joints[~collides], wished[~collides])
    changed = joints[collides] != wished[collides]
    assert changed.any(axis=1).all()
    assert changed.mean() < 0.6
    shares = (joints[collides] - start[layout.qpos])[changed] / drawn[collides][changed]
    assert np.all(np.abs(shares) < 1.0 + 1e-9)
    assert np.mean(np.isclose(shares, -1.0)) > 0.3


def box_over(start: Array, bottom: float, x: float = 0.0) -> Obstacle:
    """Hang a slab over a robot, or beside it."""
    center = np.array([start[0] + x, start[1], bottom + 0.05])
    size = np.array([2.0, 2.0, 0.05])
    return Obstacle(name="slab", kind="box", half_size=size, position=center)


def test_under_a_slab_a_disturbance_is_as_large_as_there_is_room(lying: tuple[World, Array]):
    """None is put onto the slab, which is 4 cm over the highest point of the robot."""
    world, start = lying
    layout = world.robot.layout(world.model)
    height = measure_top(world, start) + 0.04
    under = World(world.robot, replace(FLAT_SCENE, obstacles=(box_over(start, height),)))
    changes = {"joints": Normal(0.3), "turn": Normal(0.3)}
    free, starts = (sample_starts(each, start, **changes) for each in (world, under))
    moved = np.linalg.norm(starts[:, layout.qpos] - start[layout.qpos], axis=1)
    whole = np.linalg.norm(free[:, layout.qpos] - start[layout.qpos], axis=1)
    shares = np.round(moved[1:] / whole[1:], 3)
    assert set(shares.tolist()) <= {1.0, 0.5, 0.25, 0.1, 0.0}
    assert len(set(shares.tolist())) >= 3
    for row in starts:
        assert abs(row[layout.root_qpos + 2] - start[layout.root_qpos + 2]) < 0.04
        assert measure_top(world, row) < height + 0.002


def measure_top(world: World, qpos: Array) -> float:
    """Measure the height of a robot's highest point [m]: that of its lowest, upside down."""
    layout = world.robot.layout(world.model)
    over = qpos.copy()
    half_turn = np.array([0.0, 1.0, 0.0, 0.0])
    over[layout.root_position] = quaternion.rotate(half_turn, qpos[layout.root_position])
    over[layout.root_orientation] = quaternion.multiply(half_turn, qpos[layout.root_orientation])
    return -lowest_point(world.model, over)
