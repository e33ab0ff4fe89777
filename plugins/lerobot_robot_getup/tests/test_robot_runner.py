"""The robot behind its mailbox, on the twin: it waits, obeys, falls, rises and obeys again."""

from multiprocessing import Pipe
from threading import Thread

import numpy as np
import pytest
from getup_server.messages import Act
from getup_server.robot_process import answer
from getup_server.robot_runner import WAITING
from getup_server.target_pilot import AWAY, OBEYING

import humanoid_getup as hg
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RisePlan, RiseStatus
from robots import Robot


def name(robot: Robot, joint_pos) -> dict[str, float]:
    return dict(zip(robot.joint_names, map(float, joint_pos), strict=True))


def test_torque_and_time_wait_for_the_first_action(run_twin, op3: Robot):
    running = run_twin()
    known = running.wait_until(lambda known: len(known.gravity_b) > 0)
    assert known.phase == WAITING
    assert np.abs(known.joint_pos).max() > 0.5
    assert np.array_equal(known.targets, known.joint_pos), "joints without torque stay there"
    assert not running.twin.simulation.has_torque
    assert running.twin.data.time == 0.0
    running.mailbox.post(name(op3, op3.standing.joint_pos))
    assert running.mailbox.snapshot.phase == OBEYING
    assert running.twin.simulation.has_torque


def test_joints_stay_where_they_are_while_lerobot_is_silent(run_twin, op3: Robot):
    running, pan = run_twin(approach_speed=0.01), op3.joint_names.index("head_pan")
    running.mailbox.post({"head_pan": 0.6})
    held = running.wait_until(lambda known: known.phase == AWAY, silently=True)
    since = running.twin.data.time
    later = running.wait_until(lambda _: running.twin.data.time > since + 1.0, silently=True)
    assert later.targets == pytest.approx(held.targets)
    assert 0.0 < held.targets[pan] < 0.5
    assert running.twin.simulation.has_torque
    known = running.mailbox.post({"head_pan": 0.6})
    assert known.targets[pan] < held.targets[pan] + 0.01
    running.wait_until(lambda known: known.targets[pan] > held.targets[pan] + 0.01)


def test_joints_that_an_action_does_not_name_are_held(run_twin, op3: Robot):
    running = run_twin()
    pan = op3.joint_names.index("head_pan")
    running.mailbox.post({"head_pan": 0.5})
    known = running.wait_until(lambda known: abs(known.joint_pos[pan] - 0.5) < 0.02)
    others = np.delete(known.targets - op3.standing.joint_pos, pan)
    assert np.abs(others).max() < 0.02  # as they were measured, to a tick and what it sank


def test_the_first_action_is_approached_slowly_and_later_ones_at_once(run_twin, op3: Robot):
    running = run_twin(approach_speed=0.5)
    pan = op3.joint_names.index("head_pan")
    known = running.mailbox.post({"head_pan": 0.4})
    step = 0.5 * op3.control_period
    assert known.targets[pan] < 0.4 - 10.0 * step, "the answer is of the cycle that sent it"
    running.wait_until(lambda known: abs(known.targets[pan] - 0.4) < 0.002)
    known = running.mailbox.post({"head_pan": 0.3})
    fastest = op3.max_velocity[pan] * op3.control_period
    moved = 0.4 - known.targets[pan]
    assert 5.0 * step < moved <= fastest + 0.002, "the guard limits it to the servo's speed"


def test_the_answer_is_what_the_guard_sent(run_twin, op3: Robot):
    running = run_twin(approach_speed=100.0)
    tilt = op3.joint_names.index("head_tilt")
    running.mailbox.post({"head_tilt": 9.0})
    known = running.wait_until(lambda known: known.targets[tilt] > 0.99 * op3.upper[tilt])
    assert known.targets[tilt] <= op3.upper[tilt] + 0.002  # a tick


def test_a_target_that_is_no_number_switches_torque_off_and_names_the_joint(run_twin):
    running = run_twin()
    running.mailbox.post({"head_pan": float("nan")})
    known = running.wait_until(lambda known: bool(known.ended))
    assert "joint 'head_pan': target is nan rad" in known.ended
    assert not running.twin.simulation.has_torque


def test_a_robot_that_falls_rises_drops_actions_meanwhile_and_obeys_again(
    run_twin, world: World, op3: Robot
):
    running = run_twin(strategy=hg.PlannedRise(world))
    stand = op3.standing.joint_pos
    running.mailbox.post(name(op3, stand))
    running.twin.data.qvel[0] += 3.0  # m/s, a push that no stance bears
    running.wait_until(lambda known: known.rising)
    pan = op3.joint_names.index("head_pan")
    answer = running.mailbox.post({"head_pan": 0.6})
    assert answer.rising
    running.wait_until(lambda known: not known.rising or bool(known.ended))
    assert not running.failures
    begin = running.twin.data.time
    known = running.wait_until(lambda _: running.twin.data.time > begin + 1.0)
    assert known.gravity_b[2] < -0.97
    assert abs(known.targets[pan]) < 0.01, "the action of before was dropped"
    running.mailbox.post({"head_pan": 0.6})
    known = running.wait_until(lambda known: abs(known.joint_pos[pan] - 0.6) < 0.02)
    assert not known.rising
    assert running.twin.simulation.has_torque


def test_without_a_way_to_rise_a_fallen_robot_goes_on_obeying(run_twin, op3: Robot):
    running = run_twin()
    running.mailbox.post(name(op3, op3.standing.joint_pos))
    running.twin.data.qvel[0] += 3.0
    running.wait_until(lambda known: known.gravity_b[2] > -0.3)
    pan = op3.joint_names.index("head_pan")
    running.mailbox.post({"head_pan": 0.3})
    running.wait_until(lambda known: abs(known.targets[pan] - 0.3) < 0.01)
    assert not running.mailbox.snapshot.rising


class NoWay:
    """Finds no way to get up."""

    def __init__(self, world: World) -> None:
        self.world, self.torque_limit = world, hg.TorqueLimit().on(world.robot)

    def plan(self, _start, _rng) -> RisePlan:
        return RisePlan(status=RiseStatus.NOT_PLANNED)


def test_a_robot_that_cannot_rise_says_why_and_stays_limp(run_twin, world: World):
    fall = hg.sample_fall(world, "supine", seed=0)
    running = run_twin(fall.posture, NoWay(world))
    running.mailbox.post({"head_pan": 0.1})
    known = running.wait_until(lambda known: bool(known.ended))
    assert known.ended == RiseStatus.NOT_PLANNED.value
    assert not running.twin.simulation.has_torque


@pytest.mark.parametrize("phase", ["waiting", "obeying"])
def test_a_robot_that_is_asked_to_end_goes_limp(run_twin, phase: str):
    running = run_twin()
    if phase == "obeying":
        running.mailbox.post({"head_pan": 0.1})
    running.mailbox.stop()
    running.thread.join(30.0)
    assert not running.thread.is_alive()
    assert not running.failures
    assert not running.twin.simulation.has_torque


def test_torque_goes_off_when_the_connection_to_lerobot_closes(run_twin):
    ours, theirs = Pipe()
    running = run_twin()
    answering = Thread(target=answer, args=(theirs, running.mailbox))
    answering.start()
    ours.recv()
    ours.send(Act(targets={"head_pan": 0.1}))
    assert ours.recv().phase == OBEYING
    assert running.twin.simulation.has_torque
    ours.close()
    answering.join(30.0)
    running.thread.join(30.0)
    assert not running.thread.is_alive()
    assert not running.twin.simulation.has_torque
