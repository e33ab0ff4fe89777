from dataclasses import replace

import numpy as np
import pytest

from drivers import Command, Twin
from humanoid_getup.evaluation.judge import GroundTruthJudge, count_episodes, find_impact
from robots import Posture


def test_a_fault_counts_once_until_it_stayed_away_long_enough():
    flags = np.zeros((40, 2), dtype=bool)
    flags[[3, 4, 5, 8, 30], 0] = True  # 8 follows 5 within the gap, 30 does not
    assert count_episodes(flags, apart=12) == [2, 0]


def test_a_run_without_a_cycle_did_not_stand(op3):
    outcome = GroundTruthJudge(Twin(op3).simulation, None).conclude()
    assert not outcome.stand.stood
    assert outcome.peak_torque == 0.0
    assert outcome.self_collisions == 0


def test_an_impact_is_as_fast_as_what_came_down_was_before_it():
    touch = np.array([[1, 1, 0, 0, 1, 0, 1], [1, 1, 1, 1, 1, 1, 1]], dtype=bool)
    speed = np.array([[9.0, 9.0, 0.5, 1.5, 0.1, 0.7, 9.0], [5.0] * 7])
    # The first head leaves the ground and comes back with 1.5 and with 0.7 m/s; the second
    # one lay there all the time.
    assert find_impact(touch, speed).tolist() == [1.5, 0.0]


def test_a_head_that_drops_hits_the_ground_as_fast_as_it_fell(op3):
    """From h = 0.3 m of free fall: v = sqrt(2 g h) = 2.43 m/s."""
    twin = Twin(op3)
    upside_down = Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=np.array([0.0, 1.0, 0.0, 0.0]),
        joint_pos=op3.standing.joint_pos,
    )
    twin.place(upside_down)
    lowest = twin.data.geom("head_tilt_0").xpos[2] - 0.0475
    twin.place(replace(upside_down, position=np.array([0.0, 0.0, 1.0 - lowest + 0.3])))
    watch = GroundTruthJudge(twin.simulation, None)
    with twin:
        for _ in range(40):
            twin.write(Command.position(op3, op3.standing.joint_pos))
    outcome = watch.conclude()
    assert outcome.head_impact == pytest.approx(2.43, abs=0.15)
