from dataclasses import replace

import numpy as np
import pytest

from drivers import Command, Twin
from drivers.twin.ground_truth import GroundTruth
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from robots import Posture


def play(twin: Twin, targets: np.ndarray) -> list[np.ndarray]:
    torques = []
    with twin:
        for target in targets:
            twin.write(Command.position(twin.robot, target))
            torques.append(twin.truth.joint_torque.copy())
    return torques


def test_peaks_and_shares_are_those_of_the_servos_torques(tiny):
    """Legs that swing in the air, capped at 2 N·m of 4.1: the judge's own arithmetic again."""
    twin = Twin(tiny)
    twin.place(
        Posture(
            position=np.array([0.0, 0.0, 1.0]),
            orientation=np.array([1.0, 0.0, 0.0, 0.0]),
            joint_pos=np.zeros(2),
        )
    )
    judge = GroundTruthJudge(twin.simulation, 2.0)
    torques = np.array(play(twin, np.tile([-0.5, 0.3], (30, 1))))
    outcome = judge.conclude()
    np.testing.assert_array_equal(outcome.record.torque, torques)
    assert outcome.peak_torque == pytest.approx(np.abs(torques).max())
    assert outcome.peak_torque > 0.1
    assert outcome.torque_use == pytest.approx(outcome.peak_torque / 2.0)
    assert outcome.rms_torque == pytest.approx(np.sqrt((torques**2).mean()))
    assert outcome.peak_velocity > 1.0
    assert outcome.qpos.shape == (30, twin.model.nq)
    assert not outcome.stand.stood
    assert not outcome.is_sensed


def test_the_torque_of_a_rise_is_that_of_its_way_up_alone(world, op3):
    """A robot that stands from the first sample on: that sample is its way up."""
    twin = Twin(world)
    twin.place(op3.standing)
    judge = GroundTruthJudge(twin.simulation, None)
    torques = np.array(play(twin, np.tile(op3.standing.joint_pos, (377, 1))))
    outcome = judge.conclude()
    assert outcome.stand.stood
    assert outcome.stand.start_time == pytest.approx(0.008)
    assert outcome.rms_torque == pytest.approx(np.sqrt((torques[:1] ** 2).mean()))
    assert outcome.torque_use == pytest.approx((np.abs(torques) / op3.max_torque).max())
    assert outcome.self_collisions == outcome.ground_penetrations == outcome.limit_violations == 0


@pytest.mark.parametrize(("ground_mm", "itself_mm", "counts"), [(4.9, 0.09, 0), (5.1, 0.11, 1)])
def test_a_deep_contact_is_a_collision(tiny, monkeypatch, ground_mm, itself_mm, counts):
    """5 mm in the ground, more than a resting robot ever sinks; 0.1 mm in itself."""
    depths = {"ground_penetration": ground_mm, "self_penetration": itself_mm}
    for name, depth in depths.items():
        monkeypatch.setattr(GroundTruth, name, property(lambda _, depth=depth: depth / 1000.0))
    twin = Twin(tiny)
    judge = GroundTruthJudge(twin.simulation, None)
    play(twin, np.zeros((20, 2)))
    outcome = judge.conclude()
    assert outcome.ground_penetrations == outcome.self_collisions == counts


def test_a_limp_robot_is_not_judged_and_a_judge_that_concluded_looks_no_more(tiny):
    twin = Twin(tiny)
    judge = GroundTruthJudge(twin.simulation, None)
    with twin:
        for _ in range(5):
            twin.write(Command.limp(2))
        for _ in range(3):
            twin.write(Command.position(tiny, np.zeros(2)))
        assert len(judge.conclude().record.torque) == 3
        twin.write(Command.position(tiny, np.zeros(2)))
    assert len(judge.conclude().record.torque) == 3


@pytest.mark.parametrize("touch", ["head_tilt_link", "body_link", "l_ank_roll_link"])
def test_only_a_contact_of_the_feet_is_no_break_of_a_stand(op3, world, monkeypatch, touch):
    """An upright robot at full height, of which one part is said to touch the world, too."""
    body = world.model.body(touch).id
    monkeypatch.setattr(GroundTruth, "touching_bodies", property(lambda _: np.array([body])))
    twin = Twin(world)
    twin.place(op3.standing)
    judge = GroundTruthJudge(twin.simulation, None)
    play(twin, np.tile(op3.standing.joint_pos, (380, 1)))
    outcome = judge.conclude()
    assert outcome.stand.stood == (touch == "l_ank_roll_link")
    assert outcome.record.head_touch.all() == (touch == "head_tilt_link")
    assert outcome.record.head_touch.any() == (touch == "head_tilt_link")
    assert outcome.record.torso_touch.all() == (touch == "body_link")
    assert outcome.record.torso_touch.any() == (touch == "body_link")


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
