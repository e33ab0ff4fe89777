"""What collides is found, what only touches is not, and a floor may lift the robot."""

from collections.abc import Callable
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from humanoid_getup.planning.collision import CollisionChecker, Tolerances
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.obstacle import Obstacle, make_capsule
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Posture, load_robot, quaternion
from robots.kinematics import lowest_point, place, read_posture
from robots.quaternion import Array

ROBOT = load_robot("op3")
MODEL = FLAT_SCENE.compile(ROBOT)
ON_ITS_BACK = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -np.pi / 2)


@pytest.fixture
def checker() -> CollisionChecker:
    return CollisionChecker(ROBOT, FLAT_SCENE)


def height_of(posture: Posture) -> float:
    return lowest_point(MODEL, place(ROBOT, MODEL, posture))


def lying(depth: float = 0.0) -> Posture:
    posture = Posture(
        position=np.array([0.0, 0.0, 0.3]),
        orientation=ON_ITS_BACK,
        joint_pos=ROBOT.standing.joint_pos,
    )
    return lowered(posture, height_of(posture) + depth)


def lowered(posture: Posture, by: float) -> Posture:
    return replace(posture, position=posture.position - np.array([0.0, 0.0, by]))


def row(posture: Posture) -> Array:
    return np.concatenate([posture.position, posture.orientation, posture.joint_pos])


def test_the_ground_lifts_a_robot_as_far_as_it_is_too_deep(checker: CollisionChecker):
    tolerances = checker.tolerances
    for depth in (-0.1, 0.0, 0.002, 0.02, 0.09, 0.102, 0.104, 0.3):
        configuration = row(lying(depth))
        expected = max(0.0, depth - tolerances.world)
        assert checker.lift(configuration) == pytest.approx(expected, abs=1e-6)
        assert checker.is_free(configuration) == (expected <= tolerances.max_lift)


def test_a_leg_through_the_other_is_a_collision(checker: CollisionChecker):
    posture = lowered(lying(), -1.0)
    assert checker.is_free(row(posture))
    joint_pos = posture.joint_pos.copy()
    joint_pos[ROBOT.joint_names.index("l_hip_roll")] = ROBOT.upper[
        ROBOT.joint_names.index("l_hip_roll")
    ]
    assert not checker.is_free(row(replace(posture, joint_pos=joint_pos)))


def test_what_a_resting_robot_does_itself_is_allowed_from_then_on(checker: CollisionChecker):
    strict = replace(checker.tolerances, max_lift=0.0)
    checker = CollisionChecker(ROBOT, FLAT_SCENE, strict)
    posture = lying(depth=0.005)
    assert not checker.is_free(row(posture))
    assert checker.allow(posture) == ""
    assert checker.is_free(row(posture))
    assert not checker.is_free(row(lowered(posture, 0.001)))
    checker.reset()
    assert not checker.is_free(row(posture))


def test_a_start_inside_the_ground_or_beyond_a_limit_is_named(checker: CollisionChecker):
    fault = checker.allow(lying(depth=0.02))
    assert "'l_back_handle' is 20.0 mm inside 'ground', expected at most 6.0 mm" in fault
    posture = lying()
    joint_pos = posture.joint_pos.copy()
    joint_pos[ROBOT.joint_names.index("l_knee")] = 9.0
    fault = checker.allow(replace(posture, joint_pos=joint_pos))
    assert "joint 'l_knee' is +9.000 rad, expected [-1.798, +2.478] rad" in fault


def test_an_obstacle_is_hit_and_shrinks_when_loosened():
    above = np.array([0.0, 0.0, 0.25])
    ball = make_capsule("ball", above, above, 0.15)
    checker = CollisionChecker(ROBOT, Scene(name="ball", obstacles=(ball,)))
    posture = row(lying())
    assert not checker.is_free(posture)
    checker.loosen(0.9)
    assert checker.is_free(posture)
    checker.loosen(0.0)
    assert not checker.is_free(posture)


def test_rough_ground_lifts_a_robot_until_it_rests_on_it():
    world = World(ROBOT, "rough:hard")
    checker = CollisionChecker(ROBOT, world.scene, Tolerances(max_lift=0.5))
    clearance, rng = Clearance(world), np.random.default_rng(0)
    for _ in range(20):
        turn = quaternion.normalize(rng.normal(size=4))
        posture = Posture(
            position=np.array([*rng.uniform(-0.3, 0.3, size=2), 0.05]),
            orientation=turn,
            joint_pos=rng.uniform(0.3 * ROBOT.lower, 0.3 * ROBOT.upper),
        )
        resting = clearance.rest(place(ROBOT, world.model, posture), -0.002)
        at = read_posture(ROBOT, world.model, resting)
        if not checker.is_free(row(at)):  # it overlaps itself
            continue
        for depth in (0.02, 0.1, 0.2):
            lift = checker.lift(row(lowered(at, depth)))
            assert checker.is_free(row(lowered(at, depth)))
            # It may come to rest higher, where a body's face lies on a peak, but never deeper.
            assert depth - 0.002 < lift < depth + 0.02


def wall_at(y: float, thickness: float) -> Obstacle:
    """Stand a wall along x, whose middle is at ``y`` [m]."""
    half = np.array([2.0, 0.5 * thickness, 2.0])
    return Obstacle(name="wall", kind="box", half_size=half, position=np.array([0.0, y, 0.0]))


def find_hand(posture: Posture) -> float:
    data = mujoco.MjData(MODEL)
    data.qpos[:] = place(ROBOT, MODEL, posture)
    mujoco.mj_kinematics(MODEL, data)
    return float(data.geom_xpos[:, 1].max())


def spread() -> Posture:
    """Hold the left arm as far out to the side as it goes, standing in the air."""
    roll = ROBOT.joint_names.index("l_sho_roll")
    angles = [
        np.where(np.arange(ROBOT.n) == roll, angle, ROBOT.standing.joint_pos)
        for angle in np.linspace(ROBOT.lower[roll], ROBOT.upper[roll], 9)
    ]
    above = lowered(ROBOT.standing, -1.0)
    return max((replace(above, joint_pos=one) for one in angles), key=find_hand)


@pytest.mark.parametrize(("share", "thickness"), [(0.5, 0.2), (0.7, 0.002), (0.9, 0.02)])
def test_a_limb_through_a_wall_is_a_collision(share: float, thickness: float):
    """Where the middle of a limb is in it, MuJoCo may find no contact at all."""
    posture = spread()
    assert CollisionChecker(ROBOT, FLAT_SCENE).is_free(row(posture))
    wall = wall_at(share * find_hand(posture) + 0.5 * thickness, thickness)
    checker = CollisionChecker(ROBOT, Scene(name="wall", obstacles=(wall,)))
    assert not checker.is_free(row(posture))
    found = checker.find_collisions(row(posture))
    assert "'wall'" in {collision.into for collision in found}


def bisect(holds: Callable[[float], bool], yes: float, no: float) -> float:
    """Find the last number for which something holds, from one to another for which it does not."""
    for _ in range(20):
        middle = 0.5 * (yes + no)
        yes, no = (middle, no) if holds(middle) else (yes, middle)
    return yes


def curb(y: float, top: float) -> Obstacle:
    """Lay a curb along x that begins at ``y`` and is as high as ``top`` [m]."""
    half = np.array([2.0, 0.1, 1.0])
    return Obstacle(
        name="wall", kind="box", half_size=half, position=np.array([0.0, y + 0.1, top - 1.0])
    )


@pytest.mark.parametrize("ground", ["flat", "rough:easy"])
def test_a_floor_that_lifts_a_robot_lifts_it_over_no_wall_beside_it(ground: str):
    """The robot is in the floor and in the side of a curb: only the floor can be left upwards."""
    scene, depth = load_scene(ground, ROBOT), 0.03
    world = World(ROBOT, scene)
    resting = Clearance(world).rest(place(ROBOT, world.model, lying()), -0.002)
    posture = read_posture(ROBOT, world.model, resting)

    def is_free(at: Posture, *obstacles: Obstacle, most: float = 0.1) -> bool:
        own = replace(scene, obstacles=obstacles)
        return CollisionChecker(ROBOT, own, Tolerances(max_lift=most)).is_free(row(at))

    sunk = lowered(posture, depth)
    assert is_free(sunk)
    side = bisect(lambda y: is_free(posture, curb(y, 1.0), most=0.0), 1.0, 0.0) - 0.004
    top = bisect(lambda z: is_free(posture, curb(side, z), most=0.0), 0.0, 1.0) - 0.002
    assert is_free(posture, curb(side, top))
    assert not is_free(sunk, curb(side, top))
    assert not is_free(sunk, curb(side, 1.0))
