"""The start of a rise: a robot that lies still, and where it is thought to lie."""

from dataclasses import replace

import numpy as np
import pytest
from nonempty import nonempty

from drivers import FaultKind, SafetyGuard, State, Twin
from humanoid_getup.experiments.falls import sample_falls, settle_posture
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.estimation import (
    MAX_SETTLE,
    REST_SPEED,
    REST_TIME,
    FaultedError,
    StartError,
    check_start,
    estimate_posture,
    settle,
)
from humanoid_getup.simulation.world import World
from robots import Posture, Robot
from robots.kinematics import read_posture


@pytest.fixture(scope="module")
def lateral(op3: Robot, world: World) -> Posture:
    motions = {motion.name: motion for motion in load_database(op3).motions}
    at_rest = settle_posture(world, motions["lateral_side_sit"].posture(0))
    return read_posture(op3, world.model, at_rest)


def lie_down(world: World, posture: Posture, period: float | None = None) -> Twin:
    if period is not None:
        world = World(replace(world.robot, control_period=period))
    twin = Twin(world)
    twin.place(posture)
    return twin


@pytest.mark.parametrize("period", [0.004, 0.016])
def test_it_waits_for_rest_by_the_backends_clock_whatever_its_period(world, lateral, period):
    state = settle(SafetyGuard(lie_down(world, lateral, period)))
    assert REST_TIME - 1e-9 <= state.time < MAX_SETTLE
    assert np.abs(state.joint_vel).max() < REST_SPEED


def test_a_robot_that_is_shaken_is_refused_after_a_while(world, lateral, monkeypatch):
    twin = lie_down(world, lateral)
    read = twin.read
    shaken = np.array([0.3, 0.0, 0.0])
    monkeypatch.setattr(twin, "read", lambda: replace(read(), gyro=shaken))
    with pytest.raises(StartError, match=r"does not come to rest: .* turned at up to 0\.30 rad/s"):
        settle(SafetyGuard(twin))
    assert twin.data.time == pytest.approx(MAX_SETTLE, abs=0.02)


def test_a_limb_that_creeps_is_waited_for(world, lateral, monkeypatch):
    """It moves by a tenth of a radian a second; 0.08 rad in 0.8 s are permitted."""
    twin = lie_down(world, lateral)
    read = twin.read

    def creep() -> State:
        state = read()
        joint_pos = state.joint_pos.copy()
        joint_pos[3] += 0.12 * state.time
        return replace(state, joint_pos=joint_pos)

    monkeypatch.setattr(twin, "read", creep)
    joint = world.robot.joint_names[3]
    with pytest.raises(StartError, match=rf"of 10 s joint '{joint}' moved by 0\.10 rad"):
        settle(SafetyGuard(twin))


def test_a_stop_ends_the_waiting(world: World, lateral: Posture):
    guard = SafetyGuard(lie_down(world, lateral))
    guard.stop("the key")
    with pytest.raises(FaultedError, match="the key") as caught:
        settle(guard)
    assert caught.value.fault.kind is FaultKind.STOPPED


def test_the_posture_is_estimated_from_sensors_but_for_place_and_heading(world, lateral):
    twin = lie_down(world, lateral)
    posture = estimate_posture(world, settle(SafetyGuard(twin)))
    truth = twin.truth.posture
    np.testing.assert_allclose(posture.joint_pos, truth.joint_pos, atol=0.01)
    np.testing.assert_allclose(posture.gravity_b, truth.gravity_b, atol=0.02)
    assert posture.position[2] == pytest.approx(truth.position[2], abs=0.003)
    np.testing.assert_array_equal(posture.position[:2], 0.0)


@pytest.mark.parametrize(
    ("offset", "message"),
    [(0.5, "is 0.5.* above the ground, expected at most 0.3 m"), (-0.02, "mm into the ground")],
)
def test_a_start_in_the_air_or_in_the_ground_is_refused(world, lateral, offset, message):
    check_start(world, lateral)
    moved = replace(lateral, position=lateral.position + np.array([0.0, 0.0, offset]))
    with pytest.raises(StartError, match=message):
        check_start(world, moved)


@pytest.mark.parametrize(
    "scene",
    ["soft-bed", *(pytest.param(name, marks=pytest.mark.slow) for name in ("table", "wall"))],
)
def test_a_robot_that_rests_against_what_is_around_it_may_start(op3: Robot, scene: str):
    """It sinks into a soft bed, and touches walls and table legs."""
    world = World(op3, scene)
    side = str(world.scene.starts[0].start_class)
    for fall in nonempty(sample_falls(world, {side: 2}, np.random.default_rng(0))):
        check_start(world, fall.posture)
