"""A motion survives its file and damage is noticed; courses join paths, rests and motions."""

from pathlib import Path

import numpy as np
import pytest

from drivers import Twin
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import KEYS, Motion, Trajectory
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot, load_robot, quaternion

ROBOT = load_robot("op3")
FRAMES = 5


def make(**changes) -> Motion:
    rng = np.random.default_rng(1)
    fields = {
        "name": "sit_up",
        "robot": "op3",
        "start_class": "left",
        "strategy": "roll-over",
        "time": 0.1 * np.arange(FRAMES),
        "position": rng.normal(size=(FRAMES, 3)),
        "orientation": quaternion.normalize(rng.normal(size=(FRAMES, 4))),
        "joint_pos": rng.normal(size=(FRAMES, ROBOT.n)),
        "joint_target": rng.normal(size=(FRAMES, ROBOT.n)),
        "entry": np.array([True, False, True, False, False]),
        "provenance": {"seed": 3, "cost": 0.25, "program": "build"},
    }
    return Motion(**{**fields, **changes})


def test_a_motion_survives_the_trip_through_its_file(tmp_path: Path):
    motion = make()
    motion.save(tmp_path / "m.npz")
    again = Motion.load(tmp_path / "m.npz")
    for key in KEYS:
        np.testing.assert_array_equal(getattr(again, key), getattr(motion, key))
    assert [path.name for path in tmp_path.iterdir()] == ["m.npz"]


def test_a_file_says_what_its_motion_ends_in_or_it_ends_standing(tmp_path: Path):
    make(start_class="standing", end_class="left").save(tmp_path / "down.npz")
    down = Motion.load(tmp_path / "down.npz")
    assert (down.end_class, down.rises) == ("left", False)
    assert down.mirrored(ROBOT).end_class == "right"
    with np.load(tmp_path / "down.npz") as arrays:
        older = {key: arrays[key] for key in KEYS}
    np.savez(tmp_path / "older.npz", **older)
    assert Motion.load(tmp_path / "older.npz").rises
    with pytest.raises(ValueError, match="end_class is 'kneeling', expected supine, prone"):
        make(end_class="kneeling")


def test_mirroring_twice_gives_the_motion_back():
    motion = make()
    mirror = motion.mirrored(ROBOT)
    assert (mirror.name, mirror.start_class) == ("sit_up_mirrored", "right")
    again = mirror.mirrored(ROBOT)
    for key in KEYS:
        np.testing.assert_array_equal(getattr(again, key), getattr(motion, key))


def test_targets_are_interpolated_and_held_at_the_ends():
    motion = make()
    times = np.array([[-1.0, 0.0, 0.05], [0.1, 0.4, 9.0]])
    target = motion.joint_target
    expected = [
        [target[0], target[0], (target[0] + target[1]) / 2],
        [target[1], target[-1], target[-1]],
    ]
    sampled = motion.sample(times)
    assert sampled.shape == (2, 3, ROBOT.n)
    np.testing.assert_allclose(sampled, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "culprit"),
    [
        ({"start_class": "asleep"}, "expected supine, prone, left, right, squat"),
        ({"time": np.array([0.0, 0.1, 0.1, 0.2, 0.3])}, "not after frame 1"),
        ({"time": np.zeros((0,))}, "time has shape"),
        ({"joint_target": np.zeros((FRAMES, 3))}, "joint_target has shape"),
        ({"joint_pos": np.full((FRAMES, ROBOT.n), np.nan)}, "joint_pos holds nan"),
        ({"orientation": np.ones((FRAMES, 4))}, "orientation of frame 0 has length 2.0000"),
    ],
)
def test_a_wrong_motion_cannot_be_made(changes: dict, culprit: str):
    with pytest.raises(ValueError, match=culprit):
        make(**changes)


def test_a_damaged_file_is_named_in_one_line(tmp_path: Path):
    path, fields = tmp_path / "m.npz", {key: getattr(make(), key) for key in KEYS}
    make().save(path)
    sound = path.read_bytes()
    unsound = fields["joint_pos"].copy()
    unsound[2, 3] = np.nan
    for damage in (
        lambda: path.write_bytes(sound[:-200]),
        lambda: path.write_text("time,position\n"),
        lambda: np.savez(path, weights=np.zeros(3)),
        lambda: np.savez(path, **(fields | {"provenance": np.array([{"a": 1}], dtype=object)})),
        lambda: np.savez(path, **(fields | {"joint_pos": unsound})),
        path.unlink,
    ):
        damage()
        with pytest.raises(ValueError, match=r"m\.npz") as caught:
            Motion.load(path)
        assert "\n" not in str(caught.value)


def test_what_a_notebook_shows_prints_in_one_line():
    world = World(ROBOT)
    lines = [repr(each) for each in (make(), ROBOT, world, PlannedRise(world), Twin(world))]
    assert lines == [
        "Motion(sit_up of op3: left to standing, 0.40 s, 5 frames of 20 joints)",
        "Robot(op3: 20 joints, stands 0.393 m high at the neck)",
        "World(op3 in scene flat)",
        "PlannedRise(time in World(op3 in scene flat))",
        "Twin(op3, 20 joints)",
    ]


@pytest.fixture(scope="module")
def motion(op3: Robot) -> Motion:
    return find_motion(op3, "squat_to_stand")


@pytest.fixture
def path(op3: Robot, motion: Motion) -> Trajectory:
    """From the first posture of the motion, every joint by 0.1 rad in 0.2 s."""
    share = np.linspace(0.0, 1.0, 26)[:, None]
    posture = motion.posture(0)
    return Trajectory(
        time=op3.control_period * np.arange(26),
        position=np.tile(posture.position, (26, 1)),
        orientation=np.tile(posture.orientation, (26, 1)),
        joint_pos=posture.joint_pos + 0.1 * share,
    )


def test_a_course_that_plays_a_whole_motion_is_that_motion(op3: Robot, motion: Motion):
    course = Course.at(motion.posture(0)).play(motion, 0, None, op3.control_period)
    made = course.to_motion(motion, op3.control_period, name="again")
    assert (made.name, made.strategy) == ("again", motion.strategy)
    np.testing.assert_allclose(made.joint_pos, motion.joint_pos, atol=1e-9)
    np.testing.assert_allclose(made.position, motion.position, atol=1e-9)
    np.testing.assert_allclose(made.joint_target[-1], motion.joint_target[-1])


def test_a_path_that_is_followed_leads_by_the_lag_and_by_the_load(op3: Robot, path: Trajectory):
    loaded = Course.of(path, path.joint_pos + 0.05)[:1]
    followed = loaded.follow(path, op3)
    assert len(followed) == len(path.time)
    np.testing.assert_array_equal(followed.joint_pos, path.joint_pos)
    lead = followed.joint_target[1:] - path.joint_pos[1:]
    lag = op3.compute_lag(np.full(op3.n, 0.1 / 0.2))
    np.testing.assert_allclose(lead, np.tile(0.05 + lag, (25, 1)))
