"""A robot deep under something is moved out as it lies, before the path that it bends along."""

from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.collision import CollisionChecker, to_configuration
from humanoid_getup.planning.path_planner import plan_via
from humanoid_getup.planning.placement import (
    DEEP,
    SPACING,
    SPEED,
    GoalPlacement,
    ShiftProblem,
    WayOut,
    find_way_out,
)
from humanoid_getup.scenes.obstacle import Obstacle, make_capsule
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.placement import StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.body.parts import leg_length

PERIOD = 0.008
FASTEST = 1.001 * SPEED * PERIOD


@pytest.fixture(scope="module")
def table(op3: Robot) -> World:
    return World(op3, "table")


@pytest.fixture(scope="module")
def starts(table: World) -> list[Posture]:
    falls = sample_falls(table, {"left": 1}, np.random.default_rng(3))
    return [fall.posture for fall in falls]


def find(world: World, start: Posture) -> tuple[CollisionChecker, WayOut | None]:
    checker = CollisionChecker(world.robot, world.scene)
    return checker, find_way_out(world, checker, start, np.random.default_rng(0))


def test_from_under_a_table_the_robot_is_moved_freely_to_where_it_can_stand(
    table: World, starts: list[Posture]
):
    for start in nonempty(starts):
        checker, way_out = find(table, start)
        path = way_out.sample(checker)
        np.testing.assert_array_equal(path.position[0], start.position)
        places = StandingPlaces(table, start.position)
        assert places.distance_to_any(start.position) > DEEP * leg_length(table.robot)
        assert places.distance(path.position[-1]) < 1e-9
        steps = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
        assert 0.0 < steps.max() <= FASTEST < SPACING
        assert np.ptp(path.joint_pos, axis=0).max() == 0.0 == np.ptp(path.orientation, axis=0).max()
        lifts = [
            checker.lift(np.concatenate([position, to_configuration(start)[3:]]))
            for position in path.position
        ]
        assert max(lifts) < 1e-4


def test_a_path_that_follows_the_way_out_begins_where_the_robot_lies(
    table: World, starts: list[Posture]
):
    start = starts[0]
    checker, way_out = find(table, start)
    nearest = load_database(table.robot).select(start)[0]
    goal = GoalPlacement(table).place(nearest.posture, way_out.end)
    result = plan_via(start, [goal], checker, np.random.default_rng(0), way_out=way_out)
    path = result.trajectory
    np.testing.assert_array_equal(path.position[0], start.position)
    np.testing.assert_allclose(path.joint_pos[-1], goal.joint_pos, atol=1e-9)
    moved = np.linalg.norm(np.diff(path.position, axis=0), axis=1)
    assert moved.max() < 0.03  # m in a sample; no jump from the way out to what follows
    np.testing.assert_allclose(np.diff(path.time), table.robot.control_period)


@pytest.mark.parametrize("scene", ["wall", "slope:10"])
def test_with_room_within_reach_there_is_no_way_out(op3: Robot, scene: str):
    world = World(op3, scene)
    side = str(world.scene.starts[0].start_class) if world.scene.starts else "prone"
    (fall,) = sample_falls(world, {side: 1}, np.random.default_rng(0))
    assert find(world, fall.posture)[1] is None


def test_from_within_four_walls_there_is_none(table: World, starts: list[Posture]):
    start, leg = starts[0], leg_length(table.robot)
    walls = [
        Obstacle(
            name=f"wall to {way}",
            kind="box",
            half_size=leg * np.where(np.array(way) == 0.0, 3.0, 0.02),
            position=start.position + leg * np.array(way),
        )
        for way in ([-1.6, 0.0, 0.0], [1.6, 0.0, 0.0], [0.0, -1.1, 0.0], [0.0, 1.1, 0.0])
    ]
    world = World(table.robot, replace(table.scene, obstacles=(*table.scene.obstacles, *walls)))
    assert StandingPlaces(world, start.position).exist
    checker, way_out = find(world, start)
    assert checker.allow(start) == ""
    assert way_out is None


def test_an_edge_of_the_way_out_is_checked_all_along_it(op3: Robot):
    """A thin bar lies between two places, each of which is free."""
    lying = sample_falls(World(op3), {"prone": 1}, np.random.default_rng(0))[0].posture
    bar = make_capsule("bar", np.array([0.0, -1.0, 0.6]), np.array([0.0, 1.0, 0.6]), 0.01)
    checker = CollisionChecker(op3, Scene(name="bar", obstacles=(bar,)))
    before, behind = (np.array([x, 0.0, 0.6]) for x in (-0.6, 0.6))
    problem = ShiftProblem(checker, lying, behind)
    assert problem.is_free(before)
    assert problem.is_free(behind)
    assert problem.fails(before, behind)
    assert problem.fails(behind, before)
    assert not problem.fails(before, before - np.array([0.1, 0.0, 0.0]))
