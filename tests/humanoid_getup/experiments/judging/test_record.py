"""Records of many robots are cut, arranged and joined without a change of what they say."""

from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from records import make_record

from humanoid_getup.experiments.judging.record import Record, combine_records, join_records
from humanoid_getup.experiments.judging.standing import Stance
from robots import Robot

PERIOD = 0.01


def random_record(robot: Robot, *shape: int, seed: int = 0, **changes: Any) -> Record:
    """Make a record of noise, (..., T), of which every array differs."""
    rng = np.random.default_rng(seed)
    joints = (*shape, robot.n)
    noise = {
        "voltage": rng.random(shape[:-1]),
        "upright": rng.random(shape) < 0.5,
        "stance": Stance(
            neck_height=rng.random(shape),
            tilt=rng.random(shape),
            non_foot_contact=rng.random(shape) < 0.5,
        ),
        "qpos": rng.random((*shape, 7 + robot.n)),
        "joint_vel": rng.random(joints),
        "torque": rng.random(joints),
        "actuator_vel": rng.random(joints),
        "neck": rng.random((*shape, 3)),
        "overlap": rng.random(shape),
        "head_touch": rng.random(shape) < 0.5,
        "head_speed": rng.random(shape),
    }
    return make_record(robot, shape, PERIOD, **(noise | changes))


def arrays(record: Record) -> dict[str, np.ndarray]:
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    found = {name: value for name, value in values.items() if isinstance(value, np.ndarray)}
    return found | {f"stance.{name}": value for name, value in vars(record.stance).items()}


def assert_same(one: Record, other: Record, *, besides: tuple[str, ...] = ()) -> None:
    ours, theirs = arrays(one), arrays(other)
    assert ours.keys() == theirs.keys()
    assert len(ours) >= 10
    for name in ours.keys() - {*besides}:
        np.testing.assert_array_equal(ours[name], theirs[name], name)


def test_rows_that_are_taken_are_those_of_every_array(tiny: Robot):
    record = random_record(tiny, 4, 9)
    some = record.take(np.array([3, 1]))
    for name, values in arrays(record).items():
        np.testing.assert_array_equal(arrays(some)[name], values[[3, 1]], name)
    assert_same(record.take(slice(1, 2)).take(0), record.take(1))
    assert (some.layout, some.period, some.head_speed is None) == (record.layout, PERIOD, False)
    assert some.ground_depth is None


def test_pieces_in_time_are_joined_to_the_whole(tiny: Robot):
    """All but the samples that were played is as in the last piece."""
    pieces = [random_record(tiny, 2, count, seed=count) for count in (5, 1, 7)]
    whole = join_records(pieces)
    assert whole.cycles.tolist() == [13, 13]
    assert whole.duration == pytest.approx(0.26)
    np.testing.assert_array_equal(whole.voltage, pieces[-1].voltage)
    ends = [0, 5, 6, 13]
    for k, piece in enumerate(pieces):
        for name, values in arrays(piece).items():
            if values.ndim > 1:
                part = arrays(whole)[name][:, ends[k] : ends[k + 1]]
                np.testing.assert_array_equal(part, values, name)


def test_a_robot_whose_physics_diverged_is_upright_in_no_piece(tiny: Robot):
    sound = make_record(tiny, (3, 4), PERIOD)
    broken = make_record(tiny, (3, 4), PERIOD, diverged=np.array([False, True, False]))
    whole = join_records([sound, broken, sound])
    assert whole.diverged.tolist() == [False, True, False]
    assert whole.upright.all(axis=1).tolist() == [True, False, True]
    assert whole.upright.any(axis=1).tolist() == [True, False, True]
    assert whole.stance.non_foot_contact.all(axis=1).tolist() == [False, True, False]
    assert whole.stance.non_foot_contact.any(axis=1).tolist() == [False, True, False]


def test_every_array_is_combined_with_its_own(tiny: Robot):
    parts = [random_record(tiny, 3, 4, seed=seed) for seed in (1, 2)]
    assert_same(combine_records(parts, lambda values: values[0]), parts[0])
    assert_same(combine_records(parts, lambda values: values[-1]), parts[1])
