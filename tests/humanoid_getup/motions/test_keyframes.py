"""Keyframes: targets through them, mistakes with their place, files that read back as written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from authored import load_robot_keyframes
from hypothesis import given, settings
from hypothesis import strategies as st
from nonempty import nonempty
from spoiling import spoiled

from humanoid_getup.motions.keyframes import SPEED_SHARE, Keyframes
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.keyframes_writer import (
    append_keyframes,
    replace_keyframes,
    save_keyframes,
)
from robots import Robot, load_robot

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
    with pytest.raises(ValueError) as refusal:
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
    with pytest.raises(ValueError, match="motion") as refusal:
        _read(tmp_path, op3, spoiled(TEXT, old, new))
    assert problem in str(refusal.value)


AUTHORED = load_robot_keyframes(load_robot("op3"))


def assert_same(read: Keyframes, written: Keyframes, *, degrees: float = 0.0051) -> None:
    assert read.free.tolist() == written.free.tolist()
    assert read.mirrored.tolist() == written.mirrored.tolist()
    assert np.degrees(np.abs(read.keys - written.keys)).max() <= degrees
    np.testing.assert_allclose(read.duration, written.duration, atol=0.00051)
    for field in ("name", "start_class", "end_class", "strategy"):
        assert getattr(read, field) == getattr(written, field)
    for field in ("torque_limit", "time_cost", "torque_cost"):
        assert getattr(read, field) == pytest.approx(getattr(written, field))


def test_what_people_wrote_is_read_back_as_it_was(tmp_path: Path, op3: Robot):
    save_keyframes(tmp_path / "keys.toml", AUTHORED, op3)
    for read, authored in zip(load_keyframes(tmp_path / "keys.toml", op3), AUTHORED, strict=True):
        # The stance has more decimals than a file: all other angles are whole degrees.
        standing = authored.start_class == "standing"
        assert_same(read, authored, degrees=0.0051 if standing else 1e-9)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000), number=st.integers(0, len(AUTHORED) - 1))
def test_what_a_search_changed_is_read_back_within_the_rounding(
    seed: int, number: int, tmp_path_factory: pytest.TempPathFactory, op3: Robot
):
    authored, rng = AUTHORED[number], np.random.default_rng(seed)
    noise = rng.normal(scale=0.3, size=len(authored.genes))
    changed = authored.with_genes(authored.genes + noise, op3)
    path = tmp_path_factory.mktemp("keys") / "keys.toml"
    save_keyframes(path, [changed], op3)
    (read,) = load_keyframes(path, op3)
    # Left and right that differ by up to 0.05° are written as one, their mean.
    assert_same(read, changed, degrees=0.0051 + 0.025)


@pytest.fixture
def file(tmp_path: Path, op3: Robot) -> Path:
    """A copy of OP3's keyframes."""
    path = tmp_path / "keyframes.toml"
    path.write_text((op3.folder / "keyframes.toml").read_text("utf-8"), "utf-8")
    return path


def test_what_is_appended_leaves_the_text_before_it_alone(file: Path, op3: Robot):
    before = file.read_text("utf-8")
    append_keyframes(file, [replace(AUTHORED[0], name="another")], op3)
    assert file.read_text("utf-8").startswith(before.rstrip())
    assert [each.name for each in load_keyframes(file, op3)] == [
        *(each.name for each in AUTHORED),
        "another",
    ]


@pytest.mark.parametrize("number", [0, len(AUTHORED) - 1])
def test_only_the_tables_that_are_replaced_change(number: int, file: Path, op3: Robot):
    before = file.read_text("utf-8")
    replace_keyframes(file, [replace(AUTHORED[number], torque_limit=3.3)], op3)
    read = load_keyframes(file, op3)
    for k, (each, authored) in enumerate(zip(read, AUTHORED, strict=True)):
        assert_same(each, replace(authored, torque_limit=3.3) if k == number else authored)
    comments = [line for line in before.splitlines() if line.startswith("#")]
    after = file.read_text("utf-8")
    assert [line for line in after.splitlines() if line.startswith("#")] == comments
    replace_keyframes(file, [AUTHORED[number]], op3)
    again = file.read_text("utf-8")
    blocks = [text.split("[[motions]]") for text in (before, again)]
    same = [a == b for a, b in zip(*blocks, strict=True)]
    assert same == [k != number + 1 for k in range(len(same))]
