"""A trial says how keyframes end, and of a failure what, when and how high."""

import re
from dataclasses import replace

import pytest
from authored import load_robot_keyframes

from humanoid_getup.motions.build import settle, try_out
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.trial import Trial
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import site_positions


@pytest.fixture(scope="module")
def squat(op3: Robot) -> Keyframes:
    return next(each for each in load_robot_keyframes(op3) if each.name == "squat_to_stand")


@pytest.fixture(scope="module")
def stood(world: World, squat: Keyframes) -> Trial:
    return try_out(world, squat)


@pytest.fixture(scope="module")
def fell(world: World, squat: Keyframes) -> Trial:
    """The same keys, from the back."""
    return try_out(world, replace(squat, start_class="supine"))


def test_a_stand_says_when(stood: Trial):
    assert stood.succeeded
    assert stood.describe() == f"stood after {stood.stand.start_time:.2f} s"
    motion = stood.record({})
    assert motion.rises
    assert motion.stand_time == stood.stand.start_time


def test_a_failure_says_how_high_the_neck_came_and_when(fell: Trial, world: World, op3: Robot):
    assert not fell.succeeded
    neck = site_positions(world.model, fell.outcome.qpos, op3.neck_site)[:, 2]  # over flat ground
    message = fell.describe()
    found = re.search(r"came to (\d+)% of standing height after ([\d.]+) s", message)
    assert found
    share, when = float(found[1]), float(found[2])
    assert share == pytest.approx(100.0 * neck.max() / op3.standing_neck_height, abs=1.0)
    assert when == pytest.approx((neck.argmax() + 1) * op3.control_period, abs=0.02)
    assert "on the ground besides the feet since" in message
    assert "body_link" in message
    assert fell.record({"seed": 1}).end_class == "other"


def test_what_should_lie_down_and_stands_says_so(world: World, squat: Keyframes):
    down = replace(squat, end_class="supine")
    trial = Trial.of(world, down, settle(world, squat))
    assert not trial.succeeded
    assert "does not end lying supine: 9" in trial.describe()  # degrees: it stands upright
    assert "(expected at most 30°)" in trial.describe()


def test_a_rise_comes_nearer_to_a_stand_than_a_failure(stood: Trial, fell: Trial):
    assert stood.progress > 0.95 > fell.progress
