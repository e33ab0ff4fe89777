"""Robots come to lie where and how a scene says."""

import numpy as np
import pytest

from humanoid_getup.experiments import drop, falls
from humanoid_getup.experiments.drop import FallError
from humanoid_getup.experiments.falls import sample_falls
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import Scene, StartRegion
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.body.parts import leg_length
from robots.kinematics import place


def fall_in(op3: Robot, name: str, start_class: str, count: int = 2) -> tuple[World, list]:
    world = World(op3, load_scene(name, op3))
    sampled = sample_falls(world, {start_class: count}, np.random.default_rng(0))
    assert [fall.start_class for fall in sampled] == [start_class] * count
    clearance = Clearance(world)
    for fall in sampled:
        qpos = place(op3, world.model, fall.posture)
        most = 0.05 if name == "soft-bed" else 0.02
        assert clearance.measure_overlap(qpos) < most, "it lies inside something"
        gap = qpos[2] - clearance.rest(qpos)[2]
        assert gap < 0.01, "it hangs in the air"
    return world, [fall.posture for fall in sampled]


def test_robots_lie_under_a_table(op3: Robot):
    _, postures = fall_in(op3, "table", "left", 1)
    assert postures[0].position[2] < 0.5 * leg_length(op3)


def test_robots_lie_on_beds_and_a_soft_one_gives_way(op3: Robot):
    (soft,), (hard,) = (fall_in(op3, bed, "supine", 1)[1] for bed in ("soft-bed", "low-bed-a"))
    assert soft.position[2] < hard.position[2]
    assert hard.position[2] > 0.3 * leg_length(op3)
    head = quaternion.rotate(hard.orientation, np.array([0.0, 0.0, 1.0]))
    assert head[0] > 0.7, "its legs are not outside the bed"


def test_a_start_inside_a_block_is_refused_in_one_line(op3: Robot, monkeypatch):
    monkeypatch.setattr(drop, "MOST_MISSES", 8)
    leg = leg_length(op3)
    block = Obstacle(
        name="block",
        kind="box",
        half_size=leg * np.array([1.0, 1.0, 1.0]),
        position=leg * np.array([0.0, 0.0, 1.0]),
    )
    inside = StartRegion(start_class="prone", z=(0.3 * leg, 0.4 * leg))
    world = World(op3, Scene(name="cellar", obstacles=(block,), starts=(inside,)))
    with pytest.raises(FallError, match=r"'cellar' has no place for robot 'op3' .* at 0\.\d\d to"):
        sample_falls(world, {"prone": 1}, np.random.default_rng(0))


@pytest.mark.slow
def test_sampling_ends_where_no_robot_comes_to_lie_as_requested(op3, monkeypatch):
    monkeypatch.setattr(falls, "MOST_IN_VAIN", 2)
    monkeypatch.setattr(falls.StartRegion, "accepts", lambda *_: False)
    start = StartRegion(start_class="prone")
    world = World(op3, Scene(name="whim", starts=(start,)))
    with pytest.raises(FallError, match="'whim' failed: 1 prone missing after 48 falls"):
        sample_falls(world, {"prone": 1}, np.random.default_rng(0))
