"""Gears and couplings between servos and joints: laws of power and ticks, MuJoCo's own gears."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiling import complaint, spoil

from drivers import Command, GuardLimits, Twin
from drivers.servo_units import ServoUnits
from robots import Robot, load_robot
from robots.torque_limit import Drive
from robots.transmission import Coupling, Transmission

PAIRS = st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=2).map(np.array)


def build_with_mujocos_gears(robot: Robot, tiny: Robot) -> mujoco.MjModel:
    """Put the bare servos behind gears of MuJoCo's: what they do is in servo angles."""
    spec = tiny.spec()
    for joint in robot.joints:
        spec.actuator(joint.name).gear[0] = joint.servo.gear
        spec.joint(joint.name).armature *= joint.servo.gear**2
        spec.joint(joint.name).frictionloss *= joint.servo.gear
    return spec.compile()


@given(error=st.floats(-0.6, 0.6), velocity=st.floats(-4.0, 4.0), voltage=st.floats(10.0, 14.0))
def test_servos_do_at_the_joint_what_they_do_through_mujocos_gears(
    tiny, geared, error, velocity, voltage
):
    robots = (geared, tiny)
    models = (geared.spec().compile(), build_with_mujocos_gears(geared, tiny))
    forces = []
    for robot, model in zip(robots, models, strict=True):
        drive = Drive(torque=robot.max_torque, pwm=np.ones(2))
        model.actuator_gainprm[:] = drive.gains(robot, voltage)
        model.actuator_forcerange[:] = np.stack([-drive.torque, drive.torque], axis=1)
        data, layout = mujoco.MjData(model), robot.layout(model)
        data.qvel[layout.dof] = velocity
        by_servo = geared.transmission.gear if robot is tiny else np.ones(2)
        data.ctrl[:] = error * by_servo
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_actuator[layout.dof].copy())
    assert forces[0] == pytest.approx(forces[1], abs=1e-6)
    for field in ("dof_armature", "dof_frictionloss"):
        assert getattr(models[0], field) == pytest.approx(getattr(models[1], field))


@given(angle=PAIRS.map(lambda x: 0.2 * x))
def test_ticks_count_the_turns_of_the_servo(geared, angle):
    units, servos = ServoUnits(geared), [joint.servo for joint in geared.joints]
    ticks = units.to_ticks(angle)
    assert ticks.tolist() == [s.to_ticks(a) for s, a in zip(servos, angle.tolist(), strict=True)]
    assert np.all(np.abs(units.to_rad(ticks) - angle) <= [s.rad_per_tick / 2 for s in servos])
    assert units.to_rad(ticks) == pytest.approx(units.round_goal(angle))
    # 4096 ticks a turn of the servo: a quarter turn of the joint is 1.2 quarters of the servo.
    assert units.to_ticks(np.full(2, np.pi / 2))[0] == 2048 + round(1.2 * 1024)


def test_a_torque_limit_of_the_guard_holds_at_the_servo(geared):
    limits = GuardLimits.of(geared, 2.0)
    assert limits.torque_limit == pytest.approx([2.4, 2.0 * 10 / 11])
    assert GuardLimits.of(geared).torque_limit == pytest.approx([4.1 * 1.2, 4.1 * 10 / 11])
    assert limits.max_velocity == pytest.approx([4.82 / 1.2, 4.82 * 1.1])


TRIPLES = st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).map(np.array)
MATRICES = (
    st.lists(st.floats(0.2, 3.0), min_size=4, max_size=4)
    .map(lambda values: np.array(values).reshape(2, 2) * [[1.0, -1.0], [1.0, 1.0]])
    .filter(lambda matrix: np.linalg.cond(matrix) < 50.0)
)
DIFFERENTIAL = "[[couplings]]\njoints = ['l_hip', 'r_hip']\nmatrix = [[0.9, -0.5], [0.6, 0.7]]\n"


def couple(matrix: np.ndarray) -> Transmission:
    """Three joints, of which the first and the last are coupled."""
    return Transmission(np.array([1.0, 2.0, 1.0]), (Coupling(joints=(0, 2), matrix=matrix),))


@given(matrix=MATRICES, torque=TRIPLES, speed=TRIPLES)
def test_power_is_the_same_at_actuators_and_joints(matrix, torque, speed):
    transmission = couple(matrix)
    at_actuators = transmission.torque_for_joint(torque) @ transmission.to_actuator(speed)
    assert at_actuators == pytest.approx(torque @ speed)
    there = transmission.torque_for_joint(torque)
    assert transmission.torque_at_joint(there) == pytest.approx(torque)


@given(matrix=MATRICES, angle=TRIPLES)
def test_angles_go_through_a_coupling_and_back(matrix, angle):
    transmission = couple(matrix)
    turned = transmission.to_actuator(angle)
    assert turned[1] == angle[1]
    assert turned[[0, 2]] == pytest.approx(matrix @ angle[[0, 2]])
    assert transmission.to_joint(turned) == pytest.approx(angle)
    assert transmission.to_servo(angle) == pytest.approx(turned * [1.0, 2.0, 1.0])
    rows = np.tile(angle, (2, 4, 1))
    assert transmission.to_actuator(rows) == pytest.approx(np.tile(turned, (2, 4, 1)))


@given(
    matrix=MATRICES,
    lower=TRIPLES,
    span=TRIPLES,
    share=st.lists(st.floats(0.0, 1.0), min_size=3, max_size=3),
)
def test_actuators_stay_in_their_ranges_wherever_joints_are_in_theirs(matrix, lower, span, share):
    transmission, upper = couple(matrix), lower + np.abs(span)
    low, high = transmission.range_at_actuator(lower, upper)
    turned = transmission.to_actuator(lower + np.array(share) * (upper - lower))
    assert np.all((turned >= low - 1e-9) & (turned <= high + 1e-9))
    corners = [transmission.to_actuator(np.where(c, upper, lower)) for c in np.ndindex(2, 2, 2)]
    assert np.min(corners, axis=0) == pytest.approx(low)
    assert np.max(corners, axis=0) == pytest.approx(high)


@given(matrix=MATRICES, fastest=TRIPLES.map(lambda x: np.abs(x) + 0.5), way=TRIPLES)
def test_no_actuator_is_too_fast_while_joints_keep_to_their_speeds(matrix, fastest, way):
    transmission = couple(matrix)
    speed = transmission.speed_at_joint(fastest)
    assert speed[1] == fastest[1]
    worst = np.abs(transmission.to_actuator(speed * np.clip(way, -1.0, 1.0)))
    assert np.all(worst <= fastest * (1.0 + 1e-9))
    for joint in (0, 2):  # alone, it could be twice as fast, and no faster
        alone = np.abs(transmission.to_actuator(2.0 * speed[joint] * np.eye(3)[joint]))
        assert np.max(alone / fastest) == pytest.approx(1.0)


@given(share=st.lists(st.floats(-0.1, 1.1), min_size=2, max_size=2).map(np.array))
def test_goals_of_coupled_joints_are_whole_ticks_inside_the_ranges(coupled: Robot, share):
    units = ServoUnits(coupled)
    target = coupled.lower + share * (coupled.upper - coupled.lower)
    goal = units.round_goal(target)
    ticks = units.to_ticks(goal)
    assert units.to_rad(ticks) == pytest.approx(goal, abs=1e-12)
    assert np.array_equal(units.round_goal(goal), goal)
    within = (share >= 0.0) & (share <= 1.0)
    assert np.all(goal[within] >= coupled.lower[within])
    assert np.all(goal[within] <= coupled.upper[within])
    turned = np.array([[0.9, -0.5], [0.6, 0.7]]) @ (goal - target)
    assert np.all(np.abs(turned) <= 3.0 * 2.0 * np.pi / 4096)
    # The ticks by hand: the second servo is mounted the other way round, its zero at 1000.
    turn = 4096 / (2.0 * np.pi)
    assert ticks[0] == round(2048 + turn * (0.9 * goal[0] - 0.5 * goal[1]))
    assert ticks[1] == round(1000 - turn * (0.6 * goal[0] + 0.7 * goal[1]))


def drive_to(robot: Robot, model: mujoco.MjModel, target: np.ndarray) -> mujoco.MjData:
    """Send joint targets to the servos of a model, all of their torque on."""
    drive = Drive(torque=robot.max_torque, pwm=np.ones(robot.n))
    model.actuator_gainprm[:] = drive.gains(robot, 12.0)
    model.actuator_forcerange[:] = np.stack([-drive.torque, drive.torque], axis=1)
    data = mujoco.MjData(model)
    data.ctrl[:] = robot.transmission.to_actuator(target)
    return data


@given(target=PAIRS.map(lambda x: 0.01 * x), speed=PAIRS)
def test_joints_get_what_the_servos_make_through_the_differential(coupled: Robot, target, speed):
    model = coupled.spec().compile()
    data, dof = drive_to(coupled, model, target), coupled.layout(model).dof
    data.qvel[dof] = speed
    mujoco.mj_forward(model, data)
    # By hand, from the data sheet of the XM430-W350: stall 4.1 N·m, 4.82 rad/s without load.
    A = np.array([[0.9, -0.5], [0.6, 0.7]])
    stiffness = 800 / 128 * 4096 / (2.0 * np.pi) / 885 * 4.1
    torque = stiffness * (A @ target) - 4.1 / 4.82 * (A @ speed)
    supply = 4.1 - np.sign(torque) * 4.1 / 4.82 * (A @ speed)  # N·m that 12 V make at that speed
    torque = np.sign(torque) * np.minimum(np.abs(torque), np.minimum(np.abs(supply), 4.1))
    within = np.all(np.abs(stiffness * (A @ target)) < 4.0)
    if within and np.all(np.abs(torque) < 4.0):
        assert data.qfrc_actuator[dof] == pytest.approx(A.T @ torque, abs=1e-6)
    assert data.qfrc_actuator[dof] == pytest.approx(A.T @ data.actuator_force, abs=1e-9)


def test_a_torque_limit_holds_at_the_servos_of_a_differential(coupled: Robot):
    assert GuardLimits.of(coupled, 0.5).torque_limit.tolist() == [0.5, 0.5]
    twin = Twin(coupled, limit_by="current")
    count = float(coupled.current_step[0] * coupled.torque_per_ampere[0])
    strongest = np.zeros(2)
    with twin:
        for _ in range(60):
            twin.read()
            twin.write(Command.position(coupled, np.array([-1.2, 0.9]), 0.5))
            strongest = np.maximum(strongest, np.abs(twin.truth.joint_torque))
    assert np.all(strongest <= 0.5)
    assert np.all(strongest > 0.5 - 2.0 * count)


def test_a_coupling_is_read_from_a_robots_file(own_robot, coupled: Robot):
    spoil(own_robot, "[standing]", DIFFERENTIAL + "\n[standing]")
    robot = load_robot(own_robot)
    assert robot.couplings[0].joints == (0, 1)
    assert robot.couplings[0].matrix.tolist() == coupled.couplings[0].matrix.tolist()
    model = robot.spec().compile()
    assert (model.ntendon, model.nu) == (2, 2)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("'r_hip'", "'r_knee'", "couplings: unknown joint 'r_knee'"),
        ("[0.6, 0.7]]", "[1.8, -1.0]]", "expected independent rows, so that"),
        ("[0.9, -0.5]", "[0.0, -0.5]", "expected no 0 on the diagonal: exchange"),
        ("[0.9, -0.5]", "[0.9]", "matrix[0] is [0.9], expected two numbers"),
        ("0.9", "900", "expected -100 to 100"),
    ],
)
def test_a_wrong_coupling_is_refused(own_robot, old, new, words):
    spoil(own_robot, "[standing]", DIFFERENTIAL.replace(old, new) + "\n[standing]")
    assert words in complaint(own_robot)
