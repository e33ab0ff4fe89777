"""Action files: what a page says, as keys of a robot."""

import json
from pathlib import Path

import numpy as np
import pytest
from action_files import Slot, write_action_file
from hypothesis import given
from hypothesis import strategies as st
from paths import SHARED

from humanoid_getup.motions.action_file import KEEP, RELEASE, ActionFile, load_page
from robots import Robot
from robots.servo import RAD_PER_TICK

PEERS = SHARED / "peers"
DECODED = PEERS / "op3-getup-pages.json"


def read(path: Path, number: int, robot: Robot):
    return load_page(ActionFile(path), number, robot)


@pytest.mark.skipif(not DECODED.exists(), reason="needs the decoded action file")
@pytest.mark.parametrize("number", [81, 122, 142, 202])
def test_the_makers_own_pages_are_read_as_others_decoded_them(number: int, op3: Robot):
    pages = json.loads(DECODED.read_text())["pages"]
    page = next(p for p in pages if p["page"] == number and p["source"] == "motion_4095.bin")
    sequence = read(PEERS / "op3_motion_4095.bin", number, op3)
    expected, times, now = [], [], 0.0
    for step in page["steps"]:
        now += step["move_s"]
        for at in {now, now + step["pause_s"]}:
            times.append(at)
            expected.append([step["pos_rad"][name] for name in op3.joint_names])
        now += step["pause_s"]
    np.testing.assert_allclose(sequence.keys, expected, atol=1e-5)
    first = page["steps"][0]["move_s"]
    np.testing.assert_allclose(np.cumsum(sequence.after), np.sort(times)[1:] - first, atol=1e-9)
    assert first + sequence.after.sum() == pytest.approx(page["total_s"])
    assert sequence.notes == ()
    assert sequence.name == f"{page['name'].strip()}_{number}"


@given(left=st.integers(0, 4095), right=st.integers(0, 4095))
def test_a_tick_is_an_angle_by_zero_and_sign(left: int, right: int, tiny: Robot, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "actions.bin"
    write_action_file(path, {3: [Slot({1: left, 2: right})]})
    (key,) = read(path, 3, tiny).keys
    expected = [(left - 2048) * RAD_PER_TICK, -(right - 1000) * RAD_PER_TICK]
    np.testing.assert_allclose(key, expected)


def test_times_are_scaled_by_the_speed_and_a_page_repeats_and_leads_to_the_next(
    tmp_path: Path, tiny: Robot
):
    path = tmp_path / "actions.bin"
    steps = [Slot({1: 2048, 2: 1000}), Slot({1: 2100, 2: 1000}, time=30, pause=10)]
    write_action_file(path, {3: steps}, speed=48)
    # By hand: 30 * 48 / 32 = 45 cycles, and 10 * 32 / 48 = 6 whole ones, of 8 ms.
    np.testing.assert_allclose(read(path, 3, tiny).after, [0.360, 0.048])
    pages = {page: [Slot({1: 2048 + page, 2: 1000})] for page in (3, 7)}
    write_action_file(path, pages, following={3: 7}, repeat={3: 2})
    np.testing.assert_allclose(read(path, 3, tiny).keys[:, 0] / RAD_PER_TICK, [3, 3, 7])


def test_flags_keep_the_angle_that_was(tmp_path: Path, tiny: Robot):
    path = tmp_path / "actions.bin"
    steps = [Slot({1: 2148, 2: KEEP}), Slot({1: RELEASE | 2500, 2: KEEP}), Slot({1: 2248, 2: KEEP})]
    write_action_file(path, {3: steps})
    sequence = read(path, 3, tiny)
    np.testing.assert_allclose(sequence.keys[:, 0] / RAD_PER_TICK, [100, 100, 200])
    assert not sequence.keys[:, 1].any()  # the stance
    assert "joint 'l_hip' is released on the way" in sequence.notes[0]
    assert "joint 'r_hip' (id 2) is not moved: it stays in its stance" in sequence.notes[1]


@pytest.mark.parametrize(
    ("pages", "changes", "message"),
    [
        ({}, {}, "page 3 is empty, expected one with steps"),
        ({3: [Slot({1: 2048, 2: 5000})]}, {}, "has id 2 at 5000 ticks, expected 0 to 4095"),
        ({3: [Slot({1: 1, 2: 2, 9: n}) for n in (1, 2)]}, {}, "moves ids 9, expected those of rob"),
        ({3: [Slot({1: 1, 2: 2})]}, {"following": {3: 3}}, "pages 3, 3 never end"),
        ({3: [Slot({1: 1, 2: 2})]}, {"schedule": 0}, "has schedule 0 and speed 32, expected 10"),
        ({3: [Slot({1: 1, 2: 2})]}, {"repeat": {3: 255}}, "has 255 keys, expected at most 120"),
    ],
)
def test_a_page_that_cannot_be_played_is_named(
    pages, changes, message, tmp_path: Path, tiny: Robot
):
    path = tmp_path / "actions.bin"
    write_action_file(path, pages, **changes)
    with pytest.raises(ValueError) as refusal:
        read(path, 3, tiny)
    assert message in str(refusal.value)


@given(at=st.integers(0, 511), change=st.integers(1, 255))
def test_every_damaged_byte_of_a_page_is_noticed(at, change, tiny: Robot, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "actions.bin"
    write_action_file(path, {3: [Slot({1: 2048, 2: 1000})]})
    content = bytearray(path.read_bytes())
    content[3 * 512 + at] = (content[3 * 512 + at] + change) % 256
    path.write_bytes(content)
    with pytest.raises(ValueError, match="page 3 is damaged: its bytes sum to"):
        read(path, 3, tiny)
