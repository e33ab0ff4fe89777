"""References: targets that lead by the servos' lag, and where the center of mass should be."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from humanoid_getup.filtering.candidate import (
    Reference,
    compose,
    resample,
    straight_path,
)
from humanoid_getup.motions.course import Course
from humanoid_getup.motions.motion import Motion, Trajectory
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.simulation.ground_fit import GroundFit
from robots import Posture, quaternion
from robots.kinematics import center_of_mass

PERIOD = 0.008


@pytest.fixture(scope="module")
def motion(op3) -> Motion:
    return next(m for m in load_database(op3).motions if m.start_class == "supine")


@pytest.fixture(scope="module")
def path(op3) -> Trajectory:
    """A second at 0.5 rad/s in every joint, turned by 1 rad and shifted; ends standing."""
    goal = Posture(
        position=np.array([0.4, -0.3, 0.2]),
        orientation=quaternion.from_yaw(1.0),
        joint_pos=op3.standing.joint_pos,
    )
    start = replace(goal, position=np.zeros(3), joint_pos=goal.joint_pos - 0.5)
    return straight_path(start, goal, 0.5, PERIOD)


def test_an_earlier_try_goes_before_and_the_center_of_mass_waits():
    reference = Reference(
        target=np.arange(6.0).reshape(3, 2), com=np.arange(9.0).reshape(3, 3), joined=2
    )
    later = reference.after(np.full((4, 2), 7.0))
    assert later.target.tolist() == [[7.0, 7.0]] * 4 + reference.target.tolist()
    assert later.com.tolist() == [[0.0, 1.0, 2.0]] * 4 + reference.com.tolist()
    assert (reference.begins, later.begins, later.joined) == (0, 4, 6)


def test_a_straight_path_takes_the_time_of_its_fastest_joint(path):
    assert path.time[-1] == pytest.approx(1.0)
    assert len(path.time) == 126
    np.testing.assert_allclose(np.diff(path.time), PERIOD)
    np.testing.assert_allclose(np.diff(path.joint_pos, axis=0), 0.5 * PERIOD)
    np.testing.assert_allclose(path.position[63], [0.2016, -0.1512, 0.1008])


@pytest.mark.parametrize(("tempo", "rows"), [(0.5, 251), (1.0, 126), (0.8, 157), (2.0, 63)])
def test_another_tempo_is_the_same_way_in_another_time(path, tempo, rows):
    played = resample(path, tempo, PERIOD)
    assert played.time[[0, -1]] == pytest.approx([0.0, 1.0 / tempo])
    assert len(played.time) == rows
    share = played.time * tempo
    np.testing.assert_allclose(played.joint_pos, path.joint_pos[0] + 0.5 * share[:, None])
    np.testing.assert_allclose(played.position, share[:, None] * path.position[-1], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(played.orientation, axis=1), 1.0)


def test_an_aligned_motion_has_the_place_and_heading_of_its_frame(motion):
    frame = len(motion.time) // 2
    turn = quaternion.from_yaw(0.8)
    posture = Posture(
        position=np.array([3.0, -2.0, 9.0]),
        orientation=quaternion.multiply(turn, motion.orientation[frame]),
        joint_pos=motion.joint_pos[frame],
    )
    aligned = Course.aligned(motion, frame, posture)
    position, orientation = aligned.position, aligned.orientation
    np.testing.assert_allclose(position[frame, :2], [3.0, -2.0], atol=1e-12)
    np.testing.assert_allclose(position[:, 2], motion.position[:, 2])
    assert quaternion.angle_between(orientation[frame], posture.orientation) < 1e-6
    moved = motion.position[:, :2] - motion.position[frame, :2]
    turned = (moved[:, 0] + 1j * moved[:, 1]) * np.exp(0.8j)
    np.testing.assert_allclose(position[:, 0] - 3.0, turned.real, atol=1e-9)
    np.testing.assert_allclose(position[:, 1] + 2.0, turned.imag, atol=1e-9)


def test_servos_are_led_by_the_lag_of_their_back_emf(world, op3, path, motion):
    """At a constant speed v a position servo stays (K²/R) / kp v behind: 0.5 rad/s here."""
    frame = int(motion.entry_frames[len(motion.entry_frames) // 2])
    reference = compose(world, path, motion, frame)
    assert reference.joined == len(path.time)
    assert len(reference.target) == len(reference.com)
    np.testing.assert_allclose(reference.target[reference.joined], path.joint_pos[-1])
    np.testing.assert_allclose(reference.target[-1], motion.joint_target[-1], atol=1e-9)
    lead = reference.target[: reference.joined] - path.joint_pos
    lag = op3.torque_speed_slope / op3.position_gain
    np.testing.assert_allclose(lead, np.tile(0.5 * lag, (reference.joined, 1)))
    assert np.all(lead > 0.0)


def test_the_center_of_mass_continues_where_the_path_ends(world, op3, path, motion):
    frame = int(motion.entry_frames[len(motion.entry_frames) // 2])
    reference = compose(world, path, motion, frame)
    row = reference.joined
    on_path = center_of_mass(op3, world.model, path.position, path.orientation, path.joint_pos)
    np.testing.assert_allclose(reference.com[:row], on_path)
    aligned = Course.aligned(motion, frame, path.posture(-1))
    for ahead in (0, 5):
        at = frame + ahead
        here = center_of_mass(
            op3,
            world.model,
            aligned.position[at : at + 1],
            aligned.orientation[at : at + 1],
            motion.joint_pos[at : at + 1],
        )
        np.testing.assert_allclose(reference.com[row + ahead], here[0])
    rest = len(reference.com) - row
    assert rest == len(motion.time) - frame


def test_legs_fit_the_ground_on_which_an_earlier_rollout_has_been(world, path, motion):
    """Its place and heading count, but not its height; after its end, it stays there."""
    asked = list[tuple[np.ndarray, ...]]()
    fit = cast("GroundFit", SimpleNamespace(shift=lambda *at: asked.append(at) or 0.0 * at[2]))
    compose(world, path, motion, 0, fit=fit)
    (place, orientation, _), turn = asked[0], quaternion.from_yaw(0.5)
    turned = quaternion.multiply(turn, orientation)
    seen = np.concatenate([place + np.array([1.0, -2.0, 9.0]), turned], axis=1)[:10]
    compose(world, path, motion, 0, fit=fit, seen=seen)
    followed, heading, _ = asked[1]
    np.testing.assert_allclose(followed[:10], place[:10] + np.array([1.0, -2.0, 0.0]))
    np.testing.assert_allclose(followed[10:, :2], np.tile(followed[9, :2], (len(place) - 10, 1)))
    np.testing.assert_allclose(followed[:, 2], place[:, 2])
    assert quaternion.angle_between(heading[:10], turned[:10]).max() < 1e-6
