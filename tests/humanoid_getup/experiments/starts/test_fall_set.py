from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.experiments.starts.falls import CLASSES, Fall, FallSet, FallSetError
from robots import Posture, Robot


def make_falls(robot: Robot, kinds: tuple[str, ...]) -> FallSet:
    rng = np.random.default_rng(0)
    falls = [
        Fall(
            posture=Posture(
                position=rng.normal(size=3),
                orientation=np.array([0.6, 0.8, 0.0, 0.0]),
                joint_pos=rng.uniform(robot.lower, robot.upper),
            ),
            start_class=kind,
        )
        for kind in kinds
    ]
    return FallSet(robot=robot.name, scene="flat", seed=7, falls=tuple(falls))


def test_falls_come_back_as_they_were_written(op3: Robot, tmp_path: Path):
    written = make_falls(op3, ("prone", "left"))
    written.save(tmp_path / "new" / "falls.npz")
    read = FallSet.load(tmp_path / "new" / "falls.npz", op3)
    assert (read.robot, read.scene, read.seed) == ("op3", "flat", 7)
    assert [fall.start_class for fall in read.falls] == ["prone", "left"]
    for fall, other in zip(read.falls, written.falls, strict=True):
        assert np.array_equal(fall.posture.joint_pos, other.posture.joint_pos)
        assert np.array_equal(fall.posture.orientation, other.posture.orientation)
        assert np.array_equal(fall.posture.position, other.posture.position)


def test_as_many_of_every_class_are_chosen_or_none(op3: Robot):
    falls = make_falls(op3, (*CLASSES, *CLASSES, "prone"))
    chosen = falls.choose(2)
    assert [fall.start_class for fall in chosen.falls] == [k for k in CLASSES for _ in range(2)]
    with pytest.raises(ValueError, match="has 2 supine, 2 left, 2 right, expected 3 of each"):
        falls.choose(3)


def spoil(file: Path, **changes: object) -> None:
    with np.load(file) as stored:
        arrays = dict(stored) | changes
    np.savez(file, **{key: value for key, value in arrays.items() if value is not None})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position": None}, "key 'position' is missing"),
        ({"extra": 1}, "unknown key 'extra'"),
        ({"robot": "pepper"}, "it is of robot 'pepper', expected 'op3'"),
        ({"seed": 0.5}, "seed is not an integer"),
        ({"joint_pos": np.full((2, 20), 50.0)}, "fall 0: joint 'r_sho_pitch' is .50.000 rad"),
        ({"position": np.full((2, 3), 1e200)}, "fall 0: position is more than 1000 m"),
        ({"position": np.zeros((2, 2))}, r"position has shape \(2, 2\), expected \(2, 3\)"),
        ({"joint_pos": np.full((2, 20), np.nan)}, "joint_pos holds nan, expected finite"),
        ({"orientation": np.ones((2, 4))}, "orientation has length 2.0000, expected 1"),
        ({"start_class": np.array(["prone", "asleep"])}, "start_class is not a list of supine"),
        ({"scene": np.array([{}], dtype=object)}, "scene has type object"),
    ],
)
def test_a_damaged_set_is_refused_in_one_line(op3: Robot, tmp_path: Path, changes, message):
    file = tmp_path / "falls.npz"
    make_falls(op3, ("prone", "left")).save(file)
    spoil(file, **changes)
    with pytest.raises(FallSetError, match=message) as refusal:
        FallSet.load(file, op3)
    assert str(refusal.value).startswith(f"falls {file}: ")
    assert str(refusal.value).isprintable()
    assert refusal.value.file == file
