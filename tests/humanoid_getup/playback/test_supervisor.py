"""The supervisor: lets a rise that stands go on, and gives up one that goes wrong."""

from dataclasses import replace

import numpy as np
import pytest
from recording_backend import still_state
from stored_motions import MOTIONS

from drivers import SafetyGuard, State, Twin
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.monitors import AbortKind
from humanoid_getup.playback.play import play
from humanoid_getup.playback.supervisor import Supervisor, supervise_motion
from humanoid_getup.simulation.world import World
from robots import Robot, quaternion
from robots.kinematics import read_posture

PERIOD = 0.008
KNEE = 13  # l_knee


@pytest.fixture
def standing(op3: Robot) -> Motion:
    return Motion(
        name="stand",
        robot="op3",
        start_class="squat",
        strategy="none",
        time=np.array([0.0, 10.0]),
        position=np.tile(op3.standing.position, (2, 1)),
        orientation=np.tile(quaternion.IDENTITY, (2, 1)),
        joint_pos=np.tile(op3.standing.joint_pos, (2, 1)),
        joint_target=np.tile(op3.standing.joint_pos, (2, 1)),
    )


@pytest.fixture
def still(op3: Robot) -> State:
    return still_state(op3, joint_pos=op3.standing.joint_pos)


def leaning(degrees: float) -> np.ndarray:
    return quaternion.from_axis_angle(np.array([0.6, 0.8, 0.0]), np.radians(degrees))


def watch(supervisor: Supervisor, state: State, seconds: float, begin: float = 0.0) -> float:
    """Show one state for a while; return how long it was borne."""
    for k in range(round(seconds / PERIOD)):
        if supervisor.done:
            return k * PERIOD
        supervisor.step(replace(state, time=begin + k * PERIOD))
    return seconds


def begin(world: World, motion: Motion, state: State, **options) -> Supervisor:
    supervisor = supervise_motion(world, motion, **options)
    supervisor.reset(state)
    return supervisor


def with_knee(values: np.ndarray, value: float) -> np.ndarray:
    changed = values.copy()
    changed[KNEE] = value
    return changed


def test_a_robot_that_does_as_expected_is_left_alone_to_the_end(world, standing, still):
    supervisor = begin(world, standing, still)
    assert watch(supervisor, still, 20.0) == pytest.approx(standing.duration + HOLD, abs=0.02)
    assert supervisor.done
    assert supervisor.aborted is None
    assert supervisor.warnings == []


def test_a_torso_that_is_turned_wrong_for_too_long_ends_it_limp(world, standing, still):
    supervisor = begin(world, standing, still)
    turned = replace(still, orientation=leaning(70.0))
    assert watch(supervisor, turned, 5.0) == pytest.approx(1.0, abs=0.02)
    assert supervisor.aborted.kind is AbortKind.TILT
    assert str(supervisor.aborted).endswith("70° off, expected at most 60° for 1 s")
    assert supervisor.step(replace(turned, time=1.1)).is_limp


def test_a_robot_that_was_up_is_let_go_as_soon_as_it_tips(world, standing, still):
    supervisor = begin(world, standing, still)
    watch(supervisor, still, 1.0)
    tipping = replace(still, orientation=leaning(45.0))
    assert watch(supervisor, tipping, 1.0, begin=1.0) <= 0.05
    assert supervisor.aborted.kind is AbortKind.FELL
    assert "tilt 45°" in supervisor.aborted.detail


def test_a_robot_that_is_up_is_not_let_go_for_a_joint_that_hangs_back(world, standing, still):
    supervisor = begin(world, standing, still)
    wide = replace(still, joint_pos=with_knee(still.joint_pos, 0.3))
    assert watch(supervisor, wide, 5.0) == 5.0
    assert supervisor.aborted is None


def test_a_target_beyond_the_joint_is_how_a_servo_pushes(world, standing, still):
    target = standing.joint_target.copy()
    target[:, KNEE] += 0.6
    supervisor = begin(world, replace(standing, joint_target=target), still)
    assert watch(supervisor, still, 5.0) == 5.0


def test_an_unproven_path_is_not_held_against_the_robot(world, standing, still):
    supervisor = begin(world, standing, still, tracked=False)
    assert watch(supervisor, replace(still, orientation=leaning(80.0)), 5.0) == 5.0


def play_supervised(twin: Twin, world: World, motion: Motion, push=None) -> tuple[Supervisor, bool]:
    supervisor, judge = supervise_motion(world, motion), GroundTruthJudge(twin.simulation, None)
    torso = twin.robot.layout(twin.model).torso

    def shove(cycle) -> None:
        if push:
            time = cycle.state.time
            force = push[1] if push[0] < time < push[0] + 0.15 else 0.0
            twin.data.xfrc_applied[torso, 1] = force

    _, outcome = play(supervisor, SafetyGuard(twin), judge, on_cycle=shove)
    return supervisor, outcome.stand.stood


def place_at_start(world: World, motion: Motion) -> Twin:
    twin = Twin(world)
    at_rest = settle_posture(world, motion.posture(0))
    twin.place(read_posture(world.robot, world.model, at_rest))
    return twin


@pytest.mark.parametrize("name", ["squat_to_stand", "prone_push_up_fast"])
def test_a_stored_motion_is_let_stand_up(name: str, world: World):
    motion = MOTIONS[name]
    supervisor, stood = play_supervised(place_at_start(world, motion), world, motion)
    assert supervisor.aborted is None
    assert stood


def test_a_robot_that_is_pushed_over_goes_limp_before_it_lands(world: World):
    motion = MOTIONS["squat_to_stand"]
    twin = place_at_start(world, motion)
    supervisor, stood = play_supervised(twin, world, motion, push=(2.5, 40.0))
    assert not stood
    assert supervisor.aborted.kind is AbortKind.FELL
    tilt = quaternion.tilt(twin.truth.posture.orientation)
    assert np.degrees(tilt) < 60.0  # the run ended while it tips
