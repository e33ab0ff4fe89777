"""Start regions: robots are dropped in them, lie as described, and others are recognized."""

import math
from dataclasses import replace

import numpy as np
import pytest

from humanoid_getup.experiments.falls import classify
from humanoid_getup.scenes.scene import ANYWHERE, StartRegion, lying
from robots import Posture, quaternion

REGION = StartRegion(
    start_class="prone",
    x=(1.0, 2.0),
    y=(-0.5, 0.5),
    z=(0.0, 0.3),
    margin=0.1,
    heading=(math.radians(60.0), math.radians(120.0)),
)


def heading_of(orientation: np.ndarray) -> float:
    head = quaternion.rotate(orientation, np.array([0.0, 0.0, 1.0]))
    return math.atan2(head[1], head[0])


def lie(heading: float, position: tuple[float, float, float] = (1.5, 0.0, 0.1)) -> Posture:
    turned = quaternion.multiply(quaternion.from_yaw(heading), lying("prone"))
    return Posture(position=np.array(position), orientation=turned, joint_pos=np.zeros(2))


@pytest.mark.parametrize("name", ["supine", "prone", "left", "right"])
def test_robots_are_dropped_in_the_region_as_it_says(name: str):
    """A torso lies as its class says, with its head along x."""
    assert classify(lying(name)) == name
    assert quaternion.rotate(lying(name), np.array([0.0, 0.0, 1.0])) == pytest.approx([1, 0, 0])
    region, rng = replace(REGION, start_class=name), np.random.default_rng(0)
    drawn = [region.sample(rng) for _ in range(50)]
    places = np.array([place for place, _ in drawn])
    assert places.min(axis=0) == pytest.approx([1.0, -0.5], abs=0.1)
    assert places.max(axis=0) == pytest.approx([2.0, 0.5], abs=0.1)
    ways = [classify(orientation) for _, orientation in drawn]
    assert ways.count(name) > 40  # shaken by 15° about each axis
    headings = np.array([heading_of(orientation) for _, orientation in drawn])
    assert np.mean(headings) == pytest.approx(math.radians(90.0), abs=math.radians(10.0))


def test_a_region_anywhere_drops_at_the_origin_in_any_orientation():
    rng = np.random.default_rng(1)
    drawn = [ANYWHERE.sample(rng) for _ in range(40)]
    assert not np.any([place for place, _ in drawn])
    assert len({classify(orientation) for _, orientation in drawn}) >= 4
    assert ANYWHERE.accepts(lie(1.0), "left")
    assert ANYWHERE.spans(np.array([9.0, 9.0, 9.0]))


def test_a_robot_that_is_moved_lies_in_the_region_and_points_where_it_says():
    rng = np.random.default_rng(2)
    moved = [REGION.move(lie(-2.0, (7.0, 7.0, 0.12)), rng) for _ in range(20)]
    assert all(REGION.accepts(posture, "prone") for posture in moved)
    assert {posture.position[2] for posture in moved} == {0.12}
    headings = [math.degrees(heading_of(posture.orientation)) for posture in moved]
    assert 60.0 <= min(headings) < max(headings) <= 120.0


def test_a_region_has_a_margin_along_the_ground_alone():
    for position, inside in (
        ((0.95, 0.55, 0.0), True),  # by the margin
        ((0.85, 0.0, 0.1), False),
        ((1.5, -0.65, 0.1), False),
        ((1.5, 0.0, 0.31), False),  # no margin upwards: on the table or under it
    ):
        assert REGION.spans(np.array(position)) is inside
        assert REGION.accepts(lie(math.radians(90.0), position), "prone") is inside
