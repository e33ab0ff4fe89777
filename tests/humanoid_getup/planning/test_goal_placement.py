"""Connecting postures rest on what is under them, where the robot lies or beside it."""

from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.motions.motion_database import MotionDatabase
from humanoid_getup.motions.posture_metric import align
from humanoid_getup.planning.collision import CollisionChecker
from humanoid_getup.planning.placement import DISTANCES, GoalPlacement
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import Scene, StartRegion
from humanoid_getup.simulation.clearance import Clearance
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
