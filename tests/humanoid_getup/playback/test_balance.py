"""Balance: ankles turn the torso back to the attitude that the motion had."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from disturbed_worlds import WorldChange
from hypothesis import given
from hypothesis import strategies as st
from nonempty import nonempty
from recording_backend import still_state

from drivers import Command, GuardLimits, SafetyGuard, State, Twin
from humanoid_getup.experiments.judging.judge import GroundTruthJudge
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.balance import GAINS, Balance, find_ankles
from humanoid_getup.playback.play import MotionPlayer, play
from humanoid_getup.playback.supervisor import Supervisor, make_stand, supervise_hold
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot, quaternion
from robots.kinematics import place

SMALL = 0.1  # rad
FORWARD = np.array([0.0, 1.0, 0.0])
RIGHT = np.array([1.0, 0.0, 0.0])


def measure(world: World, orientation: np.ndarray, gyro: np.ndarray | None = None) -> State:
    """Measure a torso orientation and angular velocity [rad/s] through the mounted IMU."""
    robot, mounting = world.robot, world.model.site(world.robot.imu_site).quat
    turn = np.zeros(3) if gyro is None else gyro
    return still_state(
        robot,
        joint_pos=robot.standing.joint_pos,
        gyro=quaternion.rotate(quaternion.inverse(mounting), turn),
        orientation=quaternion.multiply(orientation, mounting),
    )


def correct(world: World, state: State, cycles: int = 40) -> np.ndarray:
    """Correct the standing posture until the correction is no longer limited by speed."""
    target = world.robot.standing.joint_pos
    balance = Balance(world, make_stand(world.robot))
    balance.reset(target)
    for _ in range(cycles):
        sent = balance.correct(state, 0.0, target)
    return sent - target


def test_ankles_turn_the_torso_over_the_feet(op3: Robot, world: World):
    data = mujoco.MjData(world.model)
    for row, axis in nonempty(zip(find_ankles(world), (RIGHT, FORWARD), strict=True)):
        joint_pos = op3.standing.joint_pos + SMALL * row
        data.qpos[:] = place(op3, world.model, replace(op3.standing, joint_pos=joint_pos))
        mujoco.mj_kinematics(world.model, data)
        for site in nonempty(op3.sole_sites):
            foot = data.xquat[world.model.site(site).bodyid[0]]
            torso = quaternion.inverse(foot)  # seen from the foot, which was level
            turned = quaternion.from_axis_angle(axis, SMALL)
            assert float(quaternion.angle_between(torso, turned)) < 0.1 * SMALL, site


@pytest.mark.parametrize(("row", "heading"), [(0, 1.3), (1, 0.0)])
def test_a_leaning_torso_is_turned_back_whatever_its_heading(world: World, row, heading):
    lean = quaternion.from_axis_angle((RIGHT, FORWARD)[row], SMALL)
    stand = quaternion.multiply(world.robot.standing.orientation, lean)
    state = measure(world, quaternion.multiply(quaternion.from_yaw(heading), stand))
    wanted = -GAINS.attitude[row] * math.sin(SMALL) * find_ankles(world)[row]
    assert correct(world, state) == pytest.approx(wanted, abs=0.001)  # OP3 stands 5 deg forward


@given(
    axis=st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).filter(
        lambda axis: np.linalg.norm(axis) > 0.1
    ),
    angle=st.floats(-3.0, 3.0),
    turn=st.lists(st.floats(-20.0, 20.0), min_size=3, max_size=3),
    off=st.floats(-4.0, 4.0),
)
def test_targets_stay_in_range_in_speed_and_near_the_motion(world: World, axis, angle, turn, off):
    robot = world.robot
    unit = np.array(axis) / np.linalg.norm(axis)
    state = measure(world, quaternion.from_axis_angle(unit, angle), np.array(turn))
    balance = Balance(world, make_stand(robot))
    last = robot.standing.joint_pos
    balance.reset(last)
    reach = robot.max_velocity * robot.control_period
    target = last
    for _ in range(5):
        target = np.clip(target + np.clip(off, -reach, reach), robot.lower, robot.upper)
        sent = balance.correct(state, 0.0, target)
        assert np.all(np.abs(sent - last) <= reach + 1e-12)
        assert np.all((sent >= robot.lower) & (sent <= robot.upper))
        last = sent
    assert np.all(np.abs(correct(world, state)) <= GAINS.largest + 1e-12)


def test_while_the_robot_leans_on_a_hand_a_motion_is_sent_as_it_is(op3: Robot, world: World):
    """The rise from the side pushes up on a hand, its torso nearly upright."""
    motion = next(m for m in load_database(op3).motions if m.name == "lateral_asymmetric_squat")
    balance, moved = Balance(world, motion), []
    off = measure(
        world,
        quaternion.multiply(op3.standing.orientation, quaternion.from_axis_angle(FORWARD, 0.2)),
    )
    for frame, time in enumerate(motion.time):
        balance.reset(motion.joint_target[max(frame - 1, 0)])
        target = motion.joint_target[frame]
        moved.append(not np.array_equal(balance.correct(off, time, target), target))
    data = mujoco.MjData(world.model)
    data.qpos[:] = place(op3, world.model, motion.posture(moved.index(True)))
    mujoco.mj_forward(world.model, data)
    assert not world.find_non_foot_contact(data.sensordata[None])[0]
    tilt = quaternion.tilt(motion.orientation)
    assert np.degrees(tilt[: moved.index(True)].min()) < 44.0


@given(angle=st.floats(-0.3, 0.3), roll=st.floats(-0.3, 0.3), turn=st.floats(-2.0, 2.0))
def test_mirrored_errors_are_answered_mirrored(world: World, angle, roll, turn):
    lean = quaternion.multiply(
        quaternion.from_axis_angle(RIGHT, roll), quaternion.from_axis_angle(FORWARD, angle)
    )
    gyro = np.array([turn, 0.5 * turn, 0.0])
    lean = quaternion.multiply(world.robot.standing.orientation, lean)
    original = correct(world, measure(world, lean, gyro))
    mirrored_gyro = gyro * np.array([-1.0, 1.0, -1.0])
    mirrored = correct(world, measure(world, quaternion.mirror(lean), mirrored_gyro))
    assert mirrored == pytest.approx(world.robot.mirror_joints(original), abs=1e-9)


@pytest.mark.parametrize("slope", [12.0])
def test_on_a_steep_slope_a_stand_lasts_only_with_balance(op3: Robot, world: World, slope: float):
    tilted = WorldChange(slope=math.radians(slope))
    start = tilted.lay(world, op3.standing, np.random.default_rng(0))
    scene, held = tilted.build_world(world, 0.0), op3.standing.joint_pos

    def stands(controller: MotionPlayer | Supervisor) -> bool:
        twin = Twin(scene, start)
        judge = GroundTruthJudge(twin.simulation, None)
        play(controller, SafetyGuard(twin, GuardLimits.of(op3, None)), judge)
        return judge.end()

    assert stands(
        supervise_hold(world, make_stand(op3), least=5.0, is_released=lambda: True, held=held)
    )
    assert not stands(MotionPlayer(op3, make_stand(op3), hold=5.0, held=held))


def rock(world: World, late: int, *, softly: bool, monkeypatch: pytest.MonkeyPatch) -> float:
    """Kick a robot that stands, whose IMU is some periods late; return its last speed [rad/s]."""
    robot = world.robot
    with monkeypatch.context() as patch:
        if not softly:
            patch.setattr("humanoid_getup.playback.balance.LAG", 1e-6)
        balance = Balance(world, make_stand(robot))
    target, kick = robot.standing.joint_pos, 0.3 * find_ankles(world)[1]
    balance.reset(target)
    seen, speeds = list[State](), list[float]()
    with Twin(world, robot.standing) as twin:
        for cycle in range(round(4.0 / robot.control_period)):
            state = twin.read()
            seen.append(state)
            old = seen[max(cycle - late, 0)]
            felt = replace(state, gyro=old.gyro, orientation=old.orientation)
            sent = balance.correct(felt, 10.0, target)
            is_kicked = 0.5 <= cycle * robot.control_period < 0.6
            twin.write(Command.position(robot, sent + kick * is_kicked))
            speeds.append(float(np.abs(state.joint_vel).max()))
    return max(speeds[-round(1.0 / robot.control_period) :])


@pytest.mark.parametrize("late", [2])
def test_stiff_ankles_do_not_rock_a_robot_whose_imu_is_late(late: int, monkeypatch):
    """ToddlerBot's ankles follow their targets four times as soon as those of the OP3."""
    world = World(load_robot("toddlerbot"))
    assert rock(world, late, softly=True, monkeypatch=monkeypatch) < 0.1
    assert rock(world, late, softly=False, monkeypatch=monkeypatch) > 2.0
