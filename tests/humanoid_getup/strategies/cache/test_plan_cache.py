"""The plan cache: what is kept comes back, whole or not at all, and never more than fits."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from humanoid_getup.motions.motion import Motion
from humanoid_getup.strategies.cache.plan_cache import (
    FOLDER_VARIABLE,
    PlanCache,
    PlanCacheError,
    default_folder,
)
from humanoid_getup.strategies.cache.solved_rise import PlanContext, SolvedRise
from robots import TorqueLimit

CONTEXT = PlanContext(robot="box", scene="flat", fingerprint="f0", limit_by="current")
MOTION = Motion(
    name="rise_by_hand",
    robot="box",
    start_class="supine",
    strategy="sit-up",
    time=np.array([0.0, 0.5]),
    position=np.zeros((2, 3)),
    orientation=np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
    joint_pos=np.array([[0.1, 0.2], [0.0, 0.0]]),
    joint_target=np.array([[0.1, 0.3], [0.0, 0.1]]),
)
RISE = SolvedRise(
    context=CONTEXT,
    start_class="supine",
    position=np.array([0.0, 0.0, 0.1]),
    orientation=np.array([0.6, 0.0, 0.8, 0.0]),
    joint_pos=np.array([0.1, 0.2]),
    connection="sit_up",
    frame=3,
    distance=1.5,
    planned=True,
    stand_time=2.5,
    robust=0.9375,
    made=1.0e9,
)


def at(angle: float, **changes) -> SolvedRise:
    return replace(RISE, joint_pos=np.array([angle, 0.2]), **changes)


@given(
    angles=arrays(float, 2, elements=st.floats(-3.2, 3.2)),
    limit=st.none() | st.floats(0.1, 4.1),
    mode=st.sampled_from(["current", "pwm", "ideal"]),
)
def test_what_is_kept_is_read_back_bit_for_bit(tmp_path_factory, angles, limit, mode):
    cache = PlanCache(tmp_path_factory.mktemp("plans"))
    context = replace(CONTEXT, torque_limit=limit, limit_by=mode)
    cache.keep(replace(RISE, context=context, joint_pos=angles), MOTION)
    (entry,) = cache.read("box").entries
    assert entry.rise.context == context
    assert entry.rise.context.limit == TorqueLimit(limit, mode)
    np.testing.assert_array_equal(entry.rise.start.joint_pos, angles)
    np.testing.assert_array_equal(entry.rise.start.orientation, RISE.orientation)
    assert (entry.rise.robust, entry.rise.stand_time, entry.rise.made) == (0.9375, 2.5, 1.0e9)
    np.testing.assert_array_equal(entry.load_motion().joint_target, MOTION.joint_target)


def test_the_same_start_replaces_and_another_start_or_context_is_kept_beside(tmp_path):
    cache = PlanCache(tmp_path)
    cache.keep(RISE, MOTION)
    cache.keep(replace(RISE, made=2.0e9, robust=1.0), MOTION)
    (entry,) = cache.read().entries
    assert entry.rise.robust == 1.0
    cache.keep(at(0.3), MOTION)
    cache.keep(replace(RISE, context=replace(CONTEXT, limit_by="pwm")), MOTION)
    cache.keep(replace(RISE, context=replace(CONTEXT, fingerprint="f1")), MOTION)
    assert len(cache.read().entries) == 4


def test_each_robot_has_its_own_folder_and_newer_rises_come_first(tmp_path):
    cache = PlanCache(tmp_path)
    for angle, made in ((0.1, 10.0), (0.2, 30.0), (0.3, 20.0)):
        cache.keep(at(angle, made=made), MOTION)
    other = replace(RISE, context=replace(CONTEXT, robot="../box"))
    cache.keep(other, replace(MOTION, robot="../box"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["___box", "box"]
    assert [entry.rise.made for entry in cache.read("box").entries] == [30.0, 20.0, 10.0]
    assert len(cache.read().entries) == 4


def test_the_oldest_go_first_when_the_cache_is_full(tmp_path):
    cache = PlanCache(tmp_path, capacity=3)
    for age in range(5):
        entry = cache.keep(at(0.1 * age, made=float(age)), MOTION)
        for file in (entry.file, entry.motion_file):
            os.utime(file, (age, age))
    assert [entry.rise.made for entry in cache.read().entries] == [4.0, 3.0, 2.0]
    assert len(list((tmp_path / "box").iterdir())) == 6


def test_clearing_removes_the_caches_own_files_alone(tmp_path):
    cache = PlanCache(tmp_path)
    damaged = cache.keep(RISE, MOTION)
    damaged.file.write_text("{")
    lost = cache.keep(at(0.3), MOTION)
    lost.file.unlink()  # a motion without an entry, as after a power cut
    cache.keep(at(0.4), MOTION)
    for mine in (tmp_path / "notes.txt", tmp_path / "box" / "notes.json"):
        mine.write_text("mine")
    assert cache.clear("round") == 0
    assert cache.clear("box") == 3
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["box", "notes.json", "notes.txt"]
    assert cache.clear() == 0


def test_a_linked_folder_is_not_followed(tmp_path):
    elsewhere, linked = PlanCache(tmp_path / "elsewhere"), PlanCache(tmp_path / "linked")
    entry = elsewhere.keep(RISE, MOTION)
    linked.folder.mkdir()
    (linked.folder / "box").symlink_to(entry.file.parent)
    assert (linked.clear(), linked.clear("box"), linked.read().entries) == (0, 0, ())
    with pytest.raises(NotADirectoryError, match="it is a link, expected a folder"):
        linked.keep(at(0.3), MOTION)
    assert len(elsewhere.read().entries) == 1
    assert elsewhere.find_problems() == []


def test_a_link_in_the_place_of_an_entry_goes_and_its_target_stays(tmp_path):
    cache = PlanCache(tmp_path / "cache")
    entry = cache.keep(RISE, MOTION)
    kept = entry.motion_file.rename(tmp_path / "mine.npz")
    entry.motion_file.symlink_to(kept)
    assert cache.clear() == 1
    assert not entry.motion_file.is_symlink()
    assert kept.exists()


def test_a_cache_that_was_never_used_is_empty_and_makes_no_folder(tmp_path):
    cache = PlanCache(tmp_path / "never")
    assert cache.read().entries == ()
    assert cache.clear() == 0
    assert not (tmp_path / "never").exists()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"robust": 1.5}, "robust is 1.5"),
        ({"made": float("nan")}, "made is nan"),
        ({"joint_pos": [[0.0]]}, "joint_pos is"),
        ({"orientation": [1.0, 1.0, 0.0, 0.0]}, "orientation has length 1.4142, expected 1"),
        ({"position": [0.0]}, "position and orientation have shapes"),
        ({"context": "none"}, "context is 'none'"),
        ({"motion_sha256": None}, "motion_sha256 is missing"),
        ({"stand_time": None, "frame": -1}, "stand_time is"),
    ],
)
def test_a_wrong_entry_is_a_problem_and_the_others_are_read(tmp_path, change, reason):
    cache = PlanCache(tmp_path)
    wrong = cache.keep(RISE, MOTION)
    cache.keep(at(0.3), MOTION)
    wrong.file.write_text(json.dumps(json.loads(wrong.file.read_text()) | change))
    content = cache.read()
    assert [entry.rise.joint_pos[0] for entry in content.entries] == [0.3]
    (problem,) = content.problems
    assert str(wrong.file) in problem
    assert reason in problem
    assert cache.find_problems() == [problem]


@pytest.mark.parametrize("content", [b"", b"[]", b"\xff\xfe", b"[" * 100_000, b"null"])
def test_what_is_no_entry_at_all_is_a_problem_too(tmp_path, content):
    cache = PlanCache(tmp_path)
    cache.keep(RISE, MOTION).file.write_bytes(content)
    assert cache.read().entries == ()
    assert len(cache.read().problems) == 1


def test_a_motion_that_is_lost_changed_or_exchanged_is_not_loaded(tmp_path):
    cache = PlanCache(tmp_path)
    lost, changed, exchanged = (cache.keep(at(angle), MOTION) for angle in (0.1, 0.2, 0.3))
    lost.motion_file.unlink()
    content = bytearray(changed.motion_file.read_bytes())
    content[len(content) // 2] ^= 1
    changed.motion_file.write_bytes(content)
    replace(MOTION, joint_target=MOTION.joint_target + 0.01).save(exchanged.motion_file)
    for entry, reason in (
        (lost, "No such file"),
        (changed, "checksum differs"),
        (exchanged, "checksum differs"),
    ):
        with pytest.raises(PlanCacheError, match=reason) as error:
            entry.load_motion()
        assert str(entry.motion_file) in str(error.value)
    assert len(cache.find_problems()) == 3


def test_a_motion_of_another_robot_is_refused_although_its_checksum_is_right(tmp_path):
    entry = PlanCache(tmp_path).keep(RISE, replace(MOTION, robot="round"))
    with pytest.raises(PlanCacheError, match="its robot is 'round', expected 'box'"):
        entry.load_motion()


def test_a_motion_with_other_joints_than_its_start_is_refused(tmp_path):
    rise = replace(RISE, joint_pos=RISE.joint_pos[:-1])
    entry = PlanCache(tmp_path).keep(rise, MOTION)
    with pytest.raises(PlanCacheError, match=r"its number of joints is \d+, expected \d+ as in"):
        entry.load_motion()


def test_a_folder_in_the_place_of_an_entry_does_not_keep_the_others(tmp_path):
    cache = PlanCache(tmp_path)
    entry = cache.keep(RISE, MOTION)
    folder = entry.file.with_name("0123456789abcdef.json")
    (folder / "mine").mkdir(parents=True)
    with pytest.raises(OSError, match="not empty"):
        cache.clear()
    assert not entry.file.exists()
    (folder / "mine").rmdir()
    assert cache.clear() == 1
    assert not folder.exists()


def test_a_fifo_in_the_cache_is_refused_and_not_waited_for(tmp_path):
    entry = PlanCache(tmp_path).keep(RISE, MOTION)
    entry.motion_file.unlink()
    os.mkfifo(entry.motion_file)
    with pytest.raises(PlanCacheError, match="FIFO, expected a file"):
        entry.load_motion()


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "cache").write_text("")
    with pytest.raises(NotADirectoryError):
        PlanCache(tmp_path / "cache").read()


def test_a_removed_entry_is_not_read_again_even_if_its_files_stay(tmp_path, monkeypatch):
    cache = PlanCache(tmp_path)
    entry = cache.keep(RISE, MOTION)

    def refuse(_path: Path, *, missing_ok: bool) -> None:
        raise PermissionError(13, f"Permission denied, {missing_ok=}")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", refuse)
        cache.remove(entry)
    assert entry.file.exists()
    assert cache.read().entries == ()
    cache.keep(RISE, MOTION)
    assert len(cache.read().entries) == 1


@pytest.mark.parametrize(
    ("variables", "folder"),
    [
        ({FOLDER_VARIABLE: "/named"}, "/named"),
        ({"XDG_CACHE_HOME": "/cache"}, "/cache/humanoid-getup/plans"),
        ({"XDG_CACHE_HOME": "relative", "HOME": "/me"}, "/me/.cache/humanoid-getup/plans"),
        ({"HOME": "/me"}, "/me/.cache/humanoid-getup/plans"),
    ],
)
def test_the_folder_is_the_named_one_or_in_the_users_cache(monkeypatch, variables, folder):
    for name in (FOLDER_VARIABLE, "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert default_folder() == Path(folder)
    assert PlanCache().folder == Path(folder)


def test_no_test_sees_the_users_own_cache(plan_cache_folder, tmp_path_factory):
    assert default_folder() == plan_cache_folder
    assert plan_cache_folder.is_relative_to(tmp_path_factory.getbasetemp())
