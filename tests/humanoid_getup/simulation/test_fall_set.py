from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.simulation.falls import CLASSES, Fall, FallSet
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
    with pytest.raises(ValueError, match="has 2 supine, 2 left, 2 right, needed are 3 of each"):
        falls.choose(3)


def test_a_file_of_something_else_is_refused(op3: Robot, tmp_path: Path):
    text = tmp_path / "falls.npz"
    text.write_text("nothing")
    with pytest.raises(ValueError, match="is no set of falls"):
        FallSet.load(text, op3)
    other = make_falls(op3, ("prone",))
    FallSet(robot="pepper", scene="flat", seed=0, falls=other.falls).save(tmp_path / "other.npz")
    with pytest.raises(ValueError, match="robot 'pepper' with 20 joints, allowed 'op3' with 20"):
        FallSet.load(tmp_path / "other.npz", op3)
