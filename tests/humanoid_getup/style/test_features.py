"""Features of one robot and of many, as of a simulation's kinematics, and their curves."""

import math

import numpy as np
import pytest

from humanoid_getup.policy.observation import MAP
from humanoid_getup.scenes.ground import HeightField, Slope
from humanoid_getup.simulation.world import World
from humanoid_getup.style.curves import ExtractionError, extract_curves, measure_features, trim
from humanoid_getup.style.features import (
    AROUND,
    FORWARD,
    LEFT,
    FeatureSense,
    measure_height_map,
    mirror_features,
    torso_angles,
)
from robots import Robot, quaternion
from robots.kinematics import lowest_points, place, place_postures, site_positions

RIGHT = math.pi / 2


def test_angles_say_how_a_robot_lies():
    for gravity, side, front in (
        ((0.0, 0.0, -1.0), RIGHT, RIGHT),  # standing
        ((-1.0, 0.0, 0.0), RIGHT, 0.0),  # supine: the back is down
        ((1.0, 0.0, 0.0), RIGHT, math.pi),  # prone
        ((0.0, 1.0, 0.0), 0.0, RIGHT),  # on the left side: the right one points up
        ((0.0, -1.0, 0.0), math.pi, RIGHT),
    ):
        assert torso_angles(np.array(gravity)) == pytest.approx([side, front])


def draw(robot, rng, count):
    orientation = quaternion.normalize(rng.normal(size=(count, 4)))
    return orientation, rng.uniform(robot.lower, robot.upper, (count, robot.n))


def test_estimated_features_are_those_of_the_posture_on_level_ground(op3):
    orientation, joint_pos = draw(op3, np.random.default_rng(0), 40)
    model = op3.spec().compile()
    qpos = place_postures(op3, model, np.zeros((40, 3)), orientation, joint_pos)
    neck = site_positions(model, qpos, op3.neck_site)[:, 2] - lowest_points(model, qpos)
    found = FeatureSense(op3, 40)(quaternion.gravity_in_body(orientation), joint_pos)
    assert found[:, 0] == pytest.approx(neck / op3.standing_neck_height)
    assert found[:, 1:] == pytest.approx(torso_angles(quaternion.gravity_in_body(orientation)))


def test_one_robot_measures_to_the_bit_what_it_measures_among_many(op3):
    orientation, joint_pos = draw(op3, np.random.default_rng(1), 6)
    gravity = quaternion.gravity_in_body(orientation)
    many, one = FeatureSense(op3, 6, threads=2)(gravity, joint_pos), FeatureSense(op3)
    alone = [one(g[None], q[None])[0] for g, q in zip(gravity, joint_pos, strict=True)]
    assert np.array_equal(many, np.array(alone))


def test_mirrored_robots_measure_mirrored_features(op3):
    orientation, joint_pos = draw(op3, np.random.default_rng(2), 30)
    gravity, sense = quaternion.gravity_in_body(orientation), FeatureSense(op3, 30)
    other = sense(gravity * [1.0, -1.0, 1.0], op3.mirror_joints(joint_pos))
    assert other == pytest.approx(mirror_features(sense(gravity, joint_pos)), abs=0.02)


UP = np.array([0.0, 0.0, 1.0])


def turned(angle: float):
    return quaternion.from_axis_angle(UP[None], np.array([angle]))


@pytest.mark.parametrize("lying", [(0.0, 0.0), (0.0, -1.4), (0.0, 1.5), (1.2, 0.3)])
@pytest.mark.parametrize("heading", [0.0, 1.0, np.pi])
def test_a_slope_rises_where_the_torso_faces_it(op3: Robot, lying, heading):
    """However the robot lies: only its heading counts."""
    roll, pitch = lying
    axis = np.array([[roll, pitch, 0.0]])
    angle = np.linalg.norm(axis, axis=1)
    leaning = quaternion.from_axis_angle(axis / np.maximum(angle, 1e-9)[:, None], angle)
    orientation = quaternion.multiply(turned(heading), leaning)
    found = measure_height_map(op3, Slope(angle=0.2), np.ones((1, 3)), orientation)[0]
    east = FORWARD * np.cos(heading) - LEFT * np.sin(heading)
    assert found == pytest.approx(np.tan(0.2) * AROUND * east)


def test_mirrored_ground_has_the_mirrored_map(op3: Robot):
    along, across = np.random.default_rng(0).uniform(0.0, 0.1, (2, 9))
    heights = along + across[:, np.newaxis]  # alike over both diagonals of a cell
    ground, other = (HeightField(heights=h, cell=0.1) for h in (heights, heights[::-1]))
    place = np.array([[0.1, 0.07, 0.0]])
    found = measure_height_map(op3, ground, place, turned(0.4))
    mirrored = measure_height_map(op3, other, place * [1.0, -1.0, 1.0], turned(-0.4))
    assert found == pytest.approx(MAP(mirrored))
    assert np.ptp(found) > 0.05


T = 101


def rise(before: int = 0, after: int = 0) -> np.ndarray:
    """Features of an even rise from the back, (T, 3), with still samples before and after."""
    share = np.concatenate([np.zeros(before), np.linspace(0.0, 1.0, T), np.ones(after)])
    up = np.array([1.0, RIGHT, RIGHT])
    return np.array([0.2, RIGHT, 0.0]) + share[:, None] * (up - [0.2, RIGHT, 0.0])


def test_a_stand_has_the_standing_height_and_leans_as_the_stance_does(op3: Robot, world: World):
    qpos = place(op3, world.model, op3.standing)[None]
    lean = quaternion.angle_between(op3.standing.orientation, quaternion.IDENTITY)
    expected = np.array([[1.0, RIGHT, RIGHT + float(lean)]])
    assert 0.0 < lean < 0.2
    assert measure_features(op3, world.model, qpos) == pytest.approx(expected, abs=1e-6)


def test_what_is_still_at_both_ends_is_trimmed():
    kept = trim(rise(before=40, after=60))
    assert 40 <= kept.start <= 46
    assert 134 <= kept.stop <= 142
    with pytest.raises(ExtractionError, match="nothing moves"):
        trim(rise()[-1:].repeat(9, axis=0))


def test_curves_pass_through_the_features_at_nine_times():
    time = 5.0 + np.linspace(0.0, 2.0, T)
    curves = extract_curves(time, rise())
    assert curves.duration == pytest.approx(2.0)
    even = np.linspace(0.0, 1.0, 9)[:, None]
    line = (1.0 - even) * rise()[0] + even * rise()[-1]
    assert curves.values[:, :2] == pytest.approx(line[:, :2])
    # The front angle begins at 0, and a control point cannot be below.
    assert curves.values[[0, 8], 2] == pytest.approx(line[[0, 8], 2])
    assert curves.values[:, 2] == pytest.approx(line[:, 2], abs=0.15)


@pytest.mark.parametrize(
    ("features", "message"),
    [
        (rise()[:60], r"the neck ends at 0\.\d+ of its standing height, expected"),
        (rise()[:, :2], r"features have shape \(101, 2\), expected \(101, 3\)"),
    ],
)
def test_what_is_no_rise_is_refused(features: np.ndarray, message: str):
    with pytest.raises(ExtractionError, match=message):
        extract_curves(np.arange(len(features)) * 0.02, features)
