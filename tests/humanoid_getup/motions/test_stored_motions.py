"""Every motion of OP3's database, played through loop and guard on the twin."""

import numpy as np
import pytest
from nonempty import nonempty

from drivers import SafetyGuard, Twin
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.motions.motion import MIRRORED_SUFFIX
from humanoid_getup.motions.motion_database import find_lying_down, load_database
from humanoid_getup.playback.play import MotionPlayer, hold_time, play
from humanoid_getup.playback.simulated_play import has_succeeded
from robots import Robot, TorqueLimit, load_robot
from robots.kinematics import read_posture

DATABASE = load_database(load_robot("op3"))
MOTIONS = {motion.name: motion for motion in DATABASE.rising}
LYING_DOWN = {m.name: m for m in DATABASE.motions if not m.rises}


FEW = ("supine_long_sit", "prone_push_up_gentle", "lateral_side_sit_mirrored", "squat_to_stand")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in FEW else pytest.mark.slow) for name in MOTIONS],
)
def test_a_stored_motion_ends_in_a_held_stand(name, op3, world):
    motion = MOTIONS[name]
    start = read_posture(op3, world.model, settle_posture(world, motion.posture(0)))
    twin = Twin(world)
    twin.place(start)
    player = MotionPlayer(op3, motion, hold=HOLD)
    judge = GroundTruthJudge(twin.simulation, None)
    report, outcome = play(player, SafetyGuard(twin), judge)
    assert outcome.stand.stood, report.reason
    assert report.clips.total == 0
    assert outcome.limit_violations == 0


@pytest.mark.parametrize("limit", [TorqueLimit(), TorqueLimit(2.0, "pwm")])
@pytest.mark.parametrize("name", LYING_DOWN)
def test_a_motion_that_lies_down_ends_so_softly(name: str, limit: TorqueLimit, op3, world):
    motion = LYING_DOWN[name]
    twin = Twin(world, op3.standing, limit_by=limit.by)
    player = MotionPlayer(op3, motion, hold=hold_time(motion), torque_limit=limit.value)
    judge = GroundTruthJudge(twin.simulation, limit.value)
    report, outcome = play(player, SafetyGuard(twin), judge)
    assert has_succeeded(motion, outcome), report.reason
    assert report.clips.total == 0
    assert outcome.limit_violations == 0
    assert outcome.head_impact < 0.1  # m/s
    assert outcome.torso_impact < 0.15  # m/s


def test_a_robot_finds_its_way_down(op3: Robot, tiny: Robot):
    assert find_lying_down(op3).name in LYING_DOWN
    assert find_lying_down(op3).end_class == "supine"
    with pytest.raises(ValueError, match="robot 'tiny' has no motions"):
        find_lying_down(tiny)


def test_a_motion_can_be_entered_at_its_start_and_all_along():
    for name, motion in nonempty(MOTIONS.items()):
        entries = motion.time[motion.entry_frames]
        assert motion.entry_frames[0] == 0, name
        assert len(entries) >= 16, name
        assert motion.time[-1] - entries[-1] <= 0.1, name  # s before its end
        assert np.diff(entries).max() < 0.5 * motion.duration, name  # no half of it is left out
        original = MOTIONS[name.removesuffix(MIRRORED_SUFFIX)]
        np.testing.assert_array_equal(motion.entry_frames, original.entry_frames)
