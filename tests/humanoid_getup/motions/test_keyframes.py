from pathlib import Path

import numpy as np
import pytest
from authored import load_robot_keyframes
from nonempty import nonempty
from spoiling import spoiled

from humanoid_getup.motions.keyframes import SPEED_SHARE
from humanoid_getup.motions.keyframes_file import KeyframesError, load_keyframes
from robots import load_robot

TEXT = """
[[motions]]
name = "wave"
start = "supine"
strategy = "sit-up"
stand_after = 0.5
torque_limit = 2.0
keys = [
  { both = { knee = 10, hip_roll = -5 }, middle = { head_pan = 20 } },
  { after = 0.5, left = { knee = 40 }, right = { knee = 60 } },
]
"""


def _read(tmp_path, robot, text=TEXT):
    path = tmp_path / "keyframes.toml"
    path.write_text(text)
    return load_keyframes(path, robot)[0]


def test_both_bends_left_and_right_as_mirror_images(tmp_path, op3):
    first = _read(tmp_path, op3).keys[0]
    np.testing.assert_allclose(
        first[op3.joint_names.index("l_knee")], -first[op3.joint_names.index("r_knee")]
    )
    assert np.degrees(first[op3.joint_names.index("l_knee")]) == pytest.approx(10.0)


DOWN = """
[[motions]]
name = "down"
start = "standing"
end = "supine"
strategy = "lying down"
torque_limit = 2.0
keys = [{ }, { after = 2.0, both = { knee = 90 } }, { after = 1.0, both = { knee = 0 } }]
"""


def test_what_lies_down_begins_in_the_stance_and_ends_in_its_last_key(tmp_path, op3):
    keyframes = _read(tmp_path, op3, DOWN)
    assert (keyframes.start_class, keyframes.end_class) == ("standing", "supine")
    assert keyframes.duration.tolist() == [2.0, 1.0]
    np.testing.assert_array_equal(keyframes.keys[0], op3.standing.joint_pos)
    last = keyframes.keys[-1]
    assert last[op3.joint_names.index("l_knee")] == 0.0
    elbow = op3.joint_names.index("l_el")  # what no key names stays as in the stance
    assert last[elbow] == op3.standing.joint_pos[elbow] != 0.0


def test_targets_run_from_first_to_last_key_and_never_too_fast(tmp_path, op3):
    hasty = TEXT.replace("after = 0.5, left", "after = 0.02, left")
    keyframes = _read(tmp_path, op3, hasty)
    targets = keyframes.targets(op3, hold=0.4)
    np.testing.assert_allclose(targets[0], keyframes.keys[0], atol=1e-12)
    np.testing.assert_allclose(targets[-1], keyframes.keys[-1], atol=1e-12)
    speed = np.abs(np.diff(targets, axis=0)) / op3.control_period
    assert np.all(speed <= SPEED_SHARE * op3.max_velocity * 1.02)
    assert np.all(targets[-50:] == targets[-1])


def test_targets_are_the_keys_at_their_times_which_servos_may_delay(op3):
    """And genes go there and back."""
    for keyframes in nonempty(load_robot_keyframes(op3)):
        times, targets = keyframes.times(op3), keyframes.targets(op3, 1.0)
        assert np.all(np.diff(times) >= keyframes.duration - 1e-9)
        clock = op3.control_period * np.arange(len(targets))
        for key, time in zip(keyframes.keys[:-1], times[:-1], strict=True):
            sampled = [np.interp(time, clock, column) for column in targets.T]
            np.testing.assert_allclose(sampled, key, atol=0.03)
        again = keyframes.with_genes(keyframes.genes, op3)
        np.testing.assert_allclose(again.keys, keyframes.keys, atol=1e-9)
        np.testing.assert_allclose(again.duration, keyframes.duration)


def test_an_improvement_keeps_first_and_last_key_and_symmetry(op3):
    rng = np.random.default_rng(0)
    symmetric = next(c for c in load_robot_keyframes(op3) if c.name == "prone_push_up_fast")
    noise = rng.normal(scale=0.2, size=len(symmetric.genes))
    changed = symmetric.with_genes(symmetric.genes + noise, op3)
    np.testing.assert_array_equal(changed.keys[0], symmetric.keys[0])
    np.testing.assert_array_equal(changed.keys[-1], symmetric.keys[-1])
    np.testing.assert_allclose(op3.mirror_joints(changed.keys), changed.keys)
    assert not np.allclose(changed.keys[1:-1], symmetric.keys[1:-1])


def test_all_that_is_wrong_is_reported_at_once(tmp_path, op3):
    wrong = TEXT.replace('"supine"', '"asleep"').replace("stand_after = 0.5", "stand_after = 0")
    wrong = wrong.replace("knee = 40", "nee = 40").replace("head_pan = 20", "head_pan = nan")
    with pytest.raises(KeyframesError) as refusal:
        _read(tmp_path, op3, wrong)
    for message in (
        "keyframes.toml: motion 'wave': start is 'asleep', expected supine, prone, left, right",
        "motion 'wave': stand_after is 0 s, expected above 0 s",
        "motion 'wave': key number 1: middle.head_pan is nan, expected a finite angle in degrees",
        "motion 'wave': key number 2: left: unknown joint 'nee', expected sho_pitch, sho_roll",
    ):
        assert message in str(refusal.value)
    assert str(refusal.value).isprintable()


@pytest.mark.parametrize("names", [("LHip", "RHip"), ("hip_left", "hip_right"), ("one", "two")])
def test_keys_of_any_robot_are_written_by_pairs(names: tuple[str, str], own_robot: Path):
    left, right = names
    for file in (own_robot / "robot.toml", own_robot / "model.xml"):
        file.write_text(file.read_text().replace("l_hip", left).replace("r_hip", right))
    robot = load_robot(own_robot)
    pair = {"LHip": "Hip", "hip_left": "hip", "one": "one"}[left]  # "one" says no side
    text = TEXT.replace(", middle = { head_pan = 20 }", "").replace(", hip_roll = -5", "")
    keyframes = _read(own_robot, robot, text.replace("knee", pair))
    # Both hips of this robot turn about +y: a mirrored angle has the same sign.
    np.testing.assert_allclose(np.degrees(keyframes.keys[0]), [10.0, 10.0])
    np.testing.assert_allclose(np.degrees(keyframes.keys[1]), [40.0, 60.0])
    assert keyframes.free.tolist() == [0, 1]
    assert not keyframes.mirrored.any()


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("knee = 10", "knee = 10, l_knee = 20", "key number 1: both: joint 'l_knee' is"),
        ("stand_after = 0.5\n", "", "motion 'wave': stand_after is missing"),
        ('start = "supine"', 'start = "standing"\nend = "supine"', "stand_after is given"),
        ("after = 0.5", "after = 0", "key number 2: after is 0 s, expected above 0 s"),
        ("knee = 10", "knee = 900", "joint 'l_knee' of key number 1 is"),
        ("head_pan", "head", "key number 1: middle: unknown joint 'head', expected r_sho_pitch"),
        ("knee = 60", "r_knee = 60", "key number 2: right: unknown joint 'r_knee', expected sho"),
    ],
)
def test_a_mistake_is_named_with_its_place(old, new, problem, tmp_path, op3):
    with pytest.raises(KeyframesError, match="motion") as refusal:
        _read(tmp_path, op3, spoiled(TEXT, old, new))
    assert problem in str(refusal.value)
