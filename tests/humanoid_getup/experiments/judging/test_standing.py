from dataclasses import replace

import numpy as np
import pytest

from drivers import Twin
from humanoid_getup.experiments.judging.standing import (
    Stance,
    StanceMeter,
    is_upright,
    judge,
)
from humanoid_getup.simulation.vectorized_simulation import VecSim
from robots import Posture, load_robot, quaternion
from robots.kinematics import lowest_point

PERIOD = 0.01


@pytest.fixture(scope="module")
def robot():
    return load_robot("op3")


def test_a_stand_counts_from_its_first_unbroken_moment():
    upright = np.array([False] * 120 + [True] * 301)
    stand = judge(upright, PERIOD)
    assert stand.stood
    assert stand.start_time == pytest.approx(1.21)  # sample 120 ends the 121st period
    assert stand.hold_time == pytest.approx(3.0)  # 301 samples span 300 periods


def test_a_stand_shorter_than_three_seconds_is_none():
    stand = judge(np.array([False] * 10 + [True] * 300), PERIOD)
    assert not stand.stood
    assert np.isnan(stand.start_time)
    broken = np.array([True] * 400 + [False] + [True] * 200)
    assert not judge(broken, PERIOD).stood
    assert not judge(np.zeros(0, dtype=bool), PERIOD).stood


@pytest.mark.parametrize(
    ("neck_share", "tilt_deg", "sole_share", "contact", "expected"),
    [
        (1.0, 0.0, 0.0, False, True),
        (0.901, 14.9, 0.079, False, True),
        (0.899, 0.0, 0.0, False, False),  # crouching
        (1.0, 15.1, 0.0, False, False),  # leaning
        (1.0, 0.0, 0.081, False, False),  # on its toes
        (1.0, 0.0, 0.0, True, False),  # propped on a hand
        (0.66, 0.0, 0.0, False, False),  # sitting
    ],
)
def test_only_an_upright_robot_on_flat_soles_stands(
    robot, neck_share, tilt_deg, sole_share, contact, expected
):
    stance = Stance(
        neck_height=np.array([neck_share * robot.standing_neck_height]),
        tilt=np.array([np.radians(tilt_deg)]),
        sole_rise=np.array([sole_share * robot.standing_neck_height]),
        non_foot_contact=np.array([contact]),
    )
    upright = is_upright(stance, robot)
    assert upright.tolist() == [expected]


def test_the_neck_is_measured_over_the_mean_of_what_is_under_the_feet(tiny):
    """Of `tiny`, standing at 0.149 m, the neck is 0.05 m higher and the feet at y = ±0.07 m."""
    twin = Twin(tiny)
    twin.place(
        Posture(
            position=np.array([0.3, 0.0, 0.149]),
            orientation=quaternion.IDENTITY,
            joint_pos=np.zeros(tiny.n),
        )
    )

    def step(point: np.ndarray) -> np.ndarray:
        return np.where(point[..., 1] > 0.05, 0.1, 0.02) + point[..., 0]

    meter = StanceMeter(tiny, twin.model, step)
    truth = twin.truth
    stance = meter.measure(truth.qpos, truth.site_pos, truth.site_mat, np.array(False))
    assert stance.neck_height == pytest.approx(0.199 - 0.06 - 0.3)
    assert stance.tilt == pytest.approx(0.0)


@pytest.mark.parametrize(("left", "right", "stands"), [(0.0, 0.0, True), (9.1, 35.0, False)])
def test_a_lunge_on_the_toes_of_one_foot_is_no_stand(op3, world, left, right, stands):
    """The left leg is bent on its flat sole, until the toes of the right foot touch as well."""
    twin, meter = Twin(world), StanceMeter(op3, world.model)
    bent = {"l_hip_pitch": -left, "l_knee": 2.0 * left, "l_ank_pitch": left, "r_knee": -right}
    angles = op3.standing.joint_pos.copy()
    for name, degrees in bent.items():
        angles[op3.joint_names.index(name)] += np.radians(degrees)
    twin.place(replace(op3.standing, joint_pos=angles))
    low = lowest_point(world.model, twin.truth.qpos)
    standing = op3.standing.position - [0.0, 0.0, low]
    twin.place(replace(op3.standing, position=standing, joint_pos=angles))
    truth = twin.truth
    assert truth.site_pos[[-2, -1], 2] == pytest.approx([0.0, 0.036 if right else 0.0], abs=3e-3)
    by_truth = meter.measure(truth.qpos, truth.site_pos, truth.site_mat, np.array(False))
    by_sensors = meter.estimate(op3.standing.orientation[None], angles[None])
    for stance in (by_truth, by_sensors):
        assert np.all(stance.neck_height > 0.92 * op3.standing_neck_height)
        assert np.all(is_upright(stance, op3) == stands)
    turned = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), np.radians(20.0))
    on_slope = meter.estimate(turned[None], angles[None])
    np.testing.assert_allclose(on_slope.sole_rise, by_sensors.sole_rise, atol=1e-6)


def test_soles_are_flat_on_the_ground_below_them(op3, world):
    """Of a robot with its hips and ankles level, that stands on a slope along x."""
    twin = Twin(world)
    twin.place(op3.standing)
    truth, flat = twin.truth, np.array(False)

    def measure(slope: float) -> float:
        meter = StanceMeter(op3, world.model, lambda point: slope * point[..., 0])
        return float(meter.measure(truth.qpos, truth.site_pos, truth.site_mat, flat).sole_rise)

    assert measure(0.0) == pytest.approx(0.0, abs=1e-3)
    assert measure(0.2) < 0.08 * op3.standing_neck_height < measure(0.8)


def test_twin_rollout_and_sensors_measure_the_same_stance(op3, world):
    twin = Twin(world)
    twin.place(op3.standing)
    truth, meter = twin.truth, StanceMeter(op3, world.model)
    feet = np.array([world.model.body(f"{side}_ank_roll_link").id for side in "lr"])
    contact = np.array(not np.isin(truth.touching_bodies, feet).all())
    by_truth = meter.measure(truth.qpos, truth.site_pos, truth.site_mat, contact)
    sim = VecSim(world, 1)
    sim.bind("site_xpos", "site_xmat", "sensordata")
    sim.place(sim.everyone, truth.qpos[None])
    touch = world.find_non_foot_contact(sim.read("sensordata"))
    vectorized = meter.measure(sim.qpos, sim.read("site_xpos"), sim.read("site_xmat"), touch)
    by_sensors = meter.estimate(op3.standing.orientation[None], op3.standing.joint_pos[None])
    assert vectorized.neck_height[0] == by_truth.neck_height
    assert vectorized.tilt[0] == by_truth.tilt == by_sensors.tilt[0]
    assert vectorized.non_foot_contact[0] == by_truth.non_foot_contact == False  # noqa: E712
    assert by_sensors.neck_height[0] == pytest.approx(by_truth.neck_height, abs=1e-6)
    assert vectorized.sole_rise[0] == by_truth.sole_rise
    assert by_sensors.sole_rise[0] == pytest.approx(by_truth.sole_rise, abs=1e-3)
