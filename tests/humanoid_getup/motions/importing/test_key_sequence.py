"""Keys of other programs are collected in order; what a key omits stays as it was."""

import numpy as np
import pytest

from humanoid_getup.motions.importing.key_sequence import MOST_KEYS, KeyCollector
from humanoid_getup.motions.motion import MAX_DURATION
from robots import Robot


def test_a_joint_that_no_key_names_stays_in_the_stance_and_others_keep_their_last_angle(op3: Robot):
    collector = KeyCollector(robot=op3)
    collector.add(9.0, {3: 0.5})  # the time before the first key counts for nothing
    collector.add(0.4, {4: -0.2})
    sequence = collector.finish("up", "up.json", ("a note",))
    expected = np.tile(op3.standing.joint_pos, (2, 1))
    expected[:, 3], expected[1, 4] = 0.5, -0.2
    np.testing.assert_array_equal(sequence.keys, expected)
    assert sequence.after.tolist() == [0.4]
    assert (sequence.name, sequence.source, sequence.notes) == ("up", "up.json", ("a note",))


def test_a_pause_is_the_same_key_again_and_no_time_is_one_period(op3: Robot):
    collector = KeyCollector(robot=op3)
    collector.add(0.0, {0: 0.1}, pause=0.3)
    collector.add(0.0, {0: 0.2})
    sequence = collector.finish("up", "up.json")
    assert sequence.keys[:, 0].tolist() == [0.1, 0.1, 0.2]
    assert sequence.after.tolist() == [0.3, op3.control_period]


@pytest.mark.parametrize(
    ("count", "move", "message"),
    [
        (0, 0.1, "up.csv has no keys, expected one or more"),
        (MOST_KEYS + 1, 0.1, f"up.csv has {MOST_KEYS + 1} keys, expected at most {MOST_KEYS}"),
        (3, 0.6 * MAX_DURATION, f"up.csv lasts 144 s, expected at most {MAX_DURATION:g} s"),
    ],
)
def test_no_keys_too_many_and_too_long_a_time_are_refused(op3: Robot, count, move, message):
    collector = KeyCollector(robot=op3)
    for _ in range(count):
        collector.add(move, {})
    with pytest.raises(ValueError, match=message):
        collector.finish("up", "up.csv")
