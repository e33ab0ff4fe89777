"""The judge that has sensors alone, against the one that knows the truth."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from recording_backend import still_state

from drivers import Command, Cycle, SafetyGuard, State, Twin, run
from drivers.control_loop import Timing
from drivers.safety_limits import ClipCounts
from humanoid_getup.experiments.falls import settle_posture
from humanoid_getup.experiments.judging.judge import GroundTruthJudge, SensorJudge
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.play import MotionPlayer
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, load_robot, quaternion
from robots.kinematics import GravitySense, lowest_point, place, read_posture, torso_orientation

NOISE = {"joint_pos": 0.001, "joint_vel": 0.02, "joint_current": 0.02, "gyro": 0.01}
"""Standard deviations [rad, rad/s, A, rad/s]."""
MOTIONS = {motion.name: motion for motion in load_database(load_robot("op3")).motions}
WORLD = World(load_robot("op3"))


class NoisyTwin(Twin):
    """A twin whose sensors have white noise."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self._rng = np.random.default_rng(1)

    def read(self) -> State:
        state = super().read()
        noisy = {name: self._rng.normal(getattr(state, name), size) for name, size in NOISE.items()}
        return replace(state, **noisy)


def judge_twice(world: World, motion: Motion, start: Motion) -> tuple[Outcome, Outcome, Twin]:
    """Play a motion from where another begins; judge by truth and by noisy sensors."""
    twin = NoisyTwin(world)
    at_rest = settle_posture(world, start.posture(0))
    twin.place(read_posture(world.robot, world.model, at_rest))
    truth, sensed = GroundTruthJudge(twin.simulation, None), SensorJudge(world, twin.period, None)

    def look(cycle) -> None:
        truth(cycle)
        sensed(cycle)

    player = MotionPlayer(world.robot, motion, hold=4.5)
    run(player, SafetyGuard(twin), max_time=60.0, on_cycle=look)
    return truth.conclude(), sensed.conclude(), twin


@pytest.mark.parametrize("name", ["supine_sit_up_fast", "prone_push_up_gentle"])
def test_it_sees_a_stand_where_there_is_one(world: World, name: str):
    truth, sensed, twin = judge_twice(world, MOTIONS[name], MOTIONS[name])
    assert truth.stand.stood and sensed.stand.stood
    # A robot that has just come up still sways; the truth does not mind.
    assert -0.1 < sensed.stand.start_time - truth.stand.start_time < 0.6
    assert sensed.peak_torque == pytest.approx(truth.peak_torque, rel=0.15)
    assert sensed.peak_velocity == pytest.approx(truth.peak_velocity, rel=0.15)
    assert sensed.rms_torque == pytest.approx(truth.rms_torque, rel=0.15)
    assert sensed.is_sensed
    assert sensed.self_collisions is sensed.ground_penetrations is None
    last = read_posture(world.robot, world.model, sensed.qpos[-1])
    assert last.position[2] == pytest.approx(twin.truth.posture.position[2], abs=0.01)


@pytest.mark.parametrize(
    ("name", "start"),
    [("prone_push_up_fast", "supine_sit_up_fast"), ("squat_to_stand", "lateral_side_sit")],
)
def test_it_sees_no_stand_in_a_fall(world: World, name: str, start: str):
    truth, sensed, _ = judge_twice(world, MOTIONS[name], MOTIONS[start])
    assert not truth.stand.stood
    assert not sensed.stand.stood
    assert math.isnan(sensed.stand.start_time)


def sense(op3: Robot, cycles: int = 381, torque_limit: float | None = None, **changes):
    """Judge a robot that stands still, but for what some measurement says.

    Of 381 cycles the first was measured before any command; the others span 379 periods, 3.03 s.
    """
    judge = SensorJudge(WORLD, 0.008, torque_limit)
    for k in range(cycles):
        changed = {name: value for name, (cycle, value) in changes.items() if k == cycle}
        stance = {"joint_pos": op3.standing.joint_pos, "orientation": op3.standing.orientation}
        state = still_state(op3, time=0.008 * k, **stance | changed)
        command = Command.position(op3, op3.standing.joint_pos)
        timing = Timing(late=0.0, read=0.0, step=0.0, write=0.0)
        judge(Cycle(state, command, command, ClipCounts(*np.zeros((5, op3.n))), timing))
    return judge.conclude()


@pytest.mark.parametrize(
    ("name", "value", "stands"),
    [
        ("gyro", np.array([0.0, 0.6, -0.79]), True),  # 0.992 rad/s
        ("gyro", np.array([0.0, 0.6, -0.81]), False),  # 1.008 rad/s
        ("joint_vel", np.eye(20)[3] * -1.99, True),
        ("joint_vel", np.eye(20)[3] * -2.01, False),
        ("orientation", quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.25), True),
        ("orientation", quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.27), False),
    ],
)
def test_a_robot_that_sways_or_leans_in_between_does_not_stand(op3: Robot, name, value, stands):
    """Bounds: 1 rad/s of the torso, 2 rad/s of a joint, 15 deg (0.262 rad) of tilt."""
    assert sense(op3, **{name: (200, value)}).stand.stood == stands


def test_peaks_are_estimated_from_currents(op3: Robot):
    """An XM430 stalls at 4.1 N·m and 2.3 A."""
    current = np.zeros(op3.n)
    current[4] = -1.15
    outcome = sense(op3, torque_limit=2.5, joint_current=(1, current))
    assert outcome.peak_torque == pytest.approx(2.05)
    assert outcome.torque_use == pytest.approx(2.05 / 2.5)
    # It stands from the first sample on: two samples of twenty joints are its way up.
    assert outcome.rms_torque == pytest.approx(2.05 / np.sqrt(op3.n))
    assert sense(op3, 20, joint_current=(1, current)).torque_use == pytest.approx(0.5)
    fast = sense(op3, 20, joint_vel=(5, np.eye(20)[7] * -3.0))
    assert fast.peak_velocity == pytest.approx(3.0)


@pytest.mark.parametrize(("beyond_deg", "count"), [(0.9, 0), (1.1, 1)])
def test_a_joint_that_left_its_range_by_more_than_a_degree_is_counted(op3, beyond_deg, count):
    for row, bound, way in ((2, op3.upper, 1.0), (5, op3.lower, -1.0)):
        angles = op3.standing.joint_pos.copy()
        angles[row] = bound[row] + way * np.radians(beyond_deg)
        assert sense(op3, 20, joint_pos=(9, angles)).limit_violations == count


def test_positions_lie_on_the_ground(op3: Robot):
    tilted = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 1.2)
    outcome = sense(op3, 5, orientation=(3, tilted))
    assert outcome.qpos.shape == (4, WORLD.model.nq)
    for row in outcome.qpos:
        assert lowest_point(WORLD.model, row) == pytest.approx(0.0, abs=1e-9)
    posture = read_posture(op3, WORLD.model, outcome.qpos[2])
    np.testing.assert_allclose(posture.orientation, tilted, atol=1e-9)
    np.testing.assert_allclose(posture.joint_pos, op3.standing.joint_pos)


def test_an_imu_that_sits_askew_still_tells_the_torso_upright(op3: Robot):
    """Turn the IMU site by 90 deg about x: the torso's orientation must not turn with it."""
    turned = World(op3)
    site = turned.model.site(op3.imu_site)
    askew = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), math.pi / 2)
    site.quat[:] = askew
    turned.model.site_sameframe[site.id] = 0  # the site no longer is its body's own frame
    data = mujoco.MjData(turned.model)
    posture = Posture(
        position=op3.standing.position,
        orientation=quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 0.4),
        joint_pos=op3.standing.joint_pos,
    )
    data.qpos[:] = place(op3, turned.model, posture)
    mujoco.mj_kinematics(turned.model, data)
    measured = np.zeros(4)
    mujoco.mju_mat2Quat(measured, data.site_xmat[site.id])
    torso = torso_orientation(turned.robot, turned.model, measured)
    assert quaternion.angle_between(torso, posture.orientation) == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_allclose(GravitySense(askew)(measured), posture.gravity_b, atol=1e-9)
