"""Goals rest where there is room; a robot deep under something is moved out as it lies."""

from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.collision import CollisionChecker, to_configuration
from humanoid_getup.planning.key_path import plan_via
from humanoid_getup.planning.placement import (
    DEEP,
    DISTANCES,
    SPACING,
    SPEED,
    GoalPlacement,
    ShiftProblem,
    WayOut,
    find_way_out,
)
from humanoid_getup.scenes.obstacle import Obstacle, make_capsule
from humanoid_getup.scenes.scene import Scene, StartRegion
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.placement import StandingPlaces
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.body.parts import leg_length
from robots.kinematics import place

SLOPE = np.radians(15.0)


def sample(world: World, start_class: str, count: int = 1) -> list[Posture]:
    falls = sample_falls(world, {start_class: count}, np.random.default_rng(0))
    return [fall.posture for fall in falls]


def test_on_a_slope_a_goal_tilts_with_the_ground_and_rests_on_it(op3, database):
    world = World(op3, "slope:15")
    for start in nonempty(sample(world, "supine", 1)):
        goal = database.select(start)[0].posture
        placed = GoalPlacement(world).place(goal, start)
        level = align(goal, start)
        up = quaternion.rotate(quaternion.inverse(level.orientation), np.array([0.0, 0.0, 1.0]))
        now = quaternion.rotate(placed.orientation, up)
        normal = np.array([-np.sin(SLOPE), 0.0, np.cos(SLOPE)])
        np.testing.assert_allclose(now, normal, atol=1e-9)
        depth = Clearance(world).measure_overlap(place(op3, world.model, placed))
        assert 0.0005 < depth < 0.0035


@pytest.mark.parametrize(
    "scene", ["table", pytest.param("wall", marks=pytest.mark.slow), "rough:hard"]
)
def test_a_placed_goal_is_free_and_within_reach(op3: Robot, database: MotionDatabase, scene: str):
    world = World(op3, scene)
    start_class = str(world.scene.starts[0].start_class) if world.scene.starts else "prone"
    checker, placement = CollisionChecker(op3, world.scene), GoalPlacement(world)
    found = 0
    for start in sample(world, start_class, 1):
        for connection in database.select(start, 6):
            placed = placement.place(connection.posture, start)
            if placed is None:
                continue
            found += 1
            checker.reset()
            assert checker.allow(placed) == ""
            apart = float(np.linalg.norm(placed.position[:2] - start.position[:2]))
            assert apart <= DISTANCES[-1] * leg_length(op3) + 1e-9
            assert abs(placed.position[2] - start.position[2]) < 0.6 * leg_length(op3)
    assert found >= 2


def test_on_a_slab_with_room_below_goals_are_put_on_top(op3: Robot, database: MotionDatabase):
    leg = leg_length(op3)
    slab = Obstacle(
        name="slab",
        kind="box",
        half_size=leg * np.array([4.0, 4.0, 0.2]),
        position=leg * np.array([0.0, 0.0, 2.8]),
    )
    start = StartRegion(start_class="supine", z=(3.0 * leg, 4.0 * leg), margin=leg)
    world = World(op3, Scene(name="slab", obstacles=(slab,), starts=(start,)))
    (lying,) = sample(world, "supine")
    placed = GoalPlacement(world).place(database.select(lying)[0].posture, lying)
    assert placed.position[2] > 3.0 * leg


@pytest.mark.parametrize(("scene", "heading"), [("flat", 3.0), ("slope:15", -2.0), ("table", 0.5)])
def test_a_goal_has_the_heading_of_the_start(op3, database, scene, heading):
    """The robot rises the way it lies: the goal's heading turns with that of the start."""
    world = World(op3, scene)
    motion = database.rising[0]
    lying = motion.posture(0)
    turn = quaternion.from_yaw(heading)
    start = replace(
        lying,
        position=lying.position + np.array([3.0, 1.0, 0.0]),
        orientation=quaternion.multiply(turn, lying.orientation),
    )
    if scene == "slope:15":
        start = replace(start, position=start.position + np.array([0.0, 0.0, 3.0 * np.tan(SLOPE)]))
    placed = GoalPlacement(world).place(lying, start)
    assert placed.position[:2] == pytest.approx(start.position[:2])
    apart = quaternion.angle_between(placed.orientation, start.orientation)
    assert apart == pytest.approx(SLOPE if scene == "slope:15" else 0.0, abs=1e-6)


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


def test_from_under_a_table_the_robot_is_moved_freely_to_where_it_can_stand(table, starts):
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


def test_a_path_that_follows_the_way_out_begins_where_the_robot_lies(table, starts):
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
