"""Training's simulation: physics to the bit, delays to the step, parameters drawn and in effect."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import MOST_DELAY
from humanoid_getup.policy.action import between
from humanoid_getup.scenes.scene import FLAT_SCENE
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.world import World
from robots import Robot
from robots.kinematics import place
from robots.servo import CURRENT, PWM
from robots.torque_limit import VMAX
from sim2real.environment.env_options import ALL as R
from sim2real.environment.env_options import ObservationNoise
from sim2real.environment.training_simulation import BACKLASH_TORQUE, TrainingSim
from sim2real.environment.training_world import backlash, build_training_world

CYCLES = 6


def make_sim(world: World, n: int, **parameters: float | np.ndarray) -> TrainingSim:
    """Make a simulation on one thread; domain parameters are arrays with a row per robot."""
    sim = TrainingSim(world, n, cycles=CYCLES, threads=1)
    nominal = DomainParameters.nominal(world, n)
    arrays = {
        name: np.broadcast_to(value, getattr(nominal, name).shape).copy()
        for name, value in parameters.items()
    }
    sim.set_parameters(np.arange(n), replace(nominal, **arrays))
    return sim


def in_the_air(robot: Robot, model: mujoco.MjModel, n: int) -> np.ndarray:
    qpos = np.tile(place(robot, model, robot.standing), (n, 1))
    qpos[:, robot.layout(model).root_qpos + 2] += 5.0
    return qpos


def angles(robot: Robot, sim: TrainingSim) -> np.ndarray:
    return sim.qpos[:, robot.layout(sim.model).qpos]


def test_a_robot_moves_as_in_a_plain_loop(op3, world, falls):
    """The model is compiled for servos in position mode."""
    sim = TrainingSim(world, 3, cycles=CYCLES, threads=2)
    sim.set_parameters(sim.everyone, DomainParameters.nominal(world, 3, limit_by="pwm"))
    starts, layout = falls[:3], op3.layout(world.model)
    sim.place(np.arange(3), starts)
    target = starts[:, layout.qpos]
    following = target + np.random.default_rng(0).uniform(-0.4, 0.4, target.shape)
    sim.follow(target, following)
    sim.follow(following, target)

    data = mujoco.MjData(world.model)
    data.qpos, data.ctrl = starts[1], target[1]
    mujoco.mj_forward(world.model, data)
    for begin, end in ((target[1], following[1]), (following[1], target[1])):
        for cycle in range(CYCLES):
            data.ctrl = between(begin, end, cycle, CYCLES)
            mujoco.mj_step(world.model, data, round(op3.control_period / world.model.opt.timestep))
    assert np.array_equal(sim.qpos[1], data.qpos)
    assert np.array_equal(sim.qvel[1], data.qvel)
    assert np.array_equal(sim.sense().gyro[1], data.sensor("imu_gyro").data)


@pytest.mark.parametrize("cycles_late", [1, 5])
def test_a_target_reaches_the_servos_as_late_as_the_delay(op3, delayed_world, cycles_late):
    late = cycles_late * op3.control_period
    sim = make_sim(delayed_world, 2, action_delay=np.array([0.0, late]))
    start = in_the_air(op3, delayed_world.model, 2)  # falling freely, nothing else moves the joints
    sim.place(np.arange(2), start)
    layout = op3.layout(delayed_world.model)
    target = start[:, layout.qpos]
    first = sim.follow(target, target + 0.3, record=("qpos",))["qpos"]
    second = sim.follow(target + 0.3, target + 0.3, record=("qpos",))["qpos"]
    on_time, delayed = np.concatenate([first, second], axis=1)[..., layout.qpos]
    assert delayed[cycles_late:] == pytest.approx(on_time[:-cycles_late], abs=1e-6)
    assert np.abs(on_time[CYCLES - 1] - target[0]).max() > 0.1
    assert delayed[cycles_late - 1] == pytest.approx(target[1], abs=1e-4)


@pytest.mark.parametrize("cycles_late", [1, 5])
def test_what_is_sensed_was_true_as_long_ago_as_the_delay(op3, delayed_world, falls, cycles_late):
    """But for a robot that was just placed: it senses the present."""
    late = cycles_late * op3.control_period
    sim = make_sim(delayed_world, 2, sensor_delay=np.array([0.0, late]))
    start = np.tile(falls[0], (2, 1))
    sim.place(np.arange(2), start)
    target = start[:, op3.layout(delayed_world.model).qpos]
    sim.follow(target, target + 0.3)
    sensed = sim.follow(target + 0.3, target, record=("sensordata",))["sensordata"]
    assert np.array_equal(sim.qpos[0], sim.qpos[1])
    for name in ("imu_gyro", "imu_orientation", "pos_l_knee", "vel_l_knee"):
        sensor = delayed_world.model.sensor(name)
        now, old = sensed[..., sensor.adr[0] : sensor.adr[0] + sensor.dim[0]]
        assert np.array_equal(old[cycles_late:], now[:-cycles_late])
        assert not np.array_equal(old, now)
    sim.place(np.array([1]), falls[:1])
    plain = TrainingSim(delayed_world, 1, cycles=CYCLES, threads=1)
    plain.place(np.array([0]), falls[:1])
    for name in ("gravity", "gyro", "joint_pos", "joint_vel"):
        assert np.array_equal(getattr(sim.sense(), name)[1], getattr(plain.sense(), name)[0])


def test_a_policys_pwm_limit_and_a_users_torque_limit_both_hold(op3, world):
    sim = TrainingSim(world, 3, cycles=CYCLES, pwm_limit=0.55, threads=1)
    nominal = DomainParameters.nominal(world, 2)
    caps = replace(nominal, torque_limit=np.array([1.0, 4.0]), limit_by=np.full(2, PWM))
    sim.set_parameters(np.array([1, 2]), caps)
    # Whole counts of 885 for 12 V: 0.55 of them, or 1.0 N·m of the 4.1 that the servos have.
    for i, counts in enumerate((486, 215, 486)):
        volts = sim.batch.get_model(i).actuator_gainprm[:, VMAX]
        assert volts == pytest.approx(np.full(op3.n, 12.0 * counts / 885))


def test_no_servo_gives_more_than_its_torque_limit_and_strength(op3, world):
    strength = np.ones((2, op3.n))
    strength[1, 4] = 0.5
    sim = make_sim(world, 2, torque_limit=np.array([1.0, 2.0]), strength=strength)
    start = in_the_air(op3, world.model, 2)
    sim.place(np.arange(2), start)
    target = start[:, op3.layout(world.model).qpos]
    torque = sim.follow(target, target + 0.6, record=("actuator_force",))["actuator_force"]
    peak = np.abs(torque).max(axis=1)
    # By current, in whole counts of 2.69 mA at 4.1 N·m / 2.3 A: 208, 417 and again 208.
    count = 0.00269 * 4.1 / 2.3
    assert peak[0].max() == pytest.approx(208 * count)
    assert np.delete(peak[1], 4).max() == pytest.approx(417 * count)
    assert peak[1, 4] <= 208 * count + 1e-9
    most = sim.batch.get_model(1).actuator_forcerange[4]
    assert most == pytest.approx([-208 * count, 208 * count])


def test_an_encoder_offset_shifts_targets_and_measurements_alike(op3, world, falls):
    offset = np.zeros((2, op3.n))
    offset[1] = np.random.default_rng(0).uniform(-0.05, 0.05, op3.n)
    sim = make_sim(world, 2, joint_offset=offset)
    start = np.tile(falls[0], (2, 1))
    sim.place(np.arange(2), start)
    target = start[:, op3.layout(world.model).qpos] + offset  # as the encoders measure
    sim.follow(target, target + 0.2)
    sensed = sim.sense().joint_pos
    assert sim.qpos[1] == pytest.approx(sim.qpos[0], abs=1e-6)
    assert sensed[1] - sensed[0] == pytest.approx(offset[1], abs=1e-6)


def test_a_loaded_gear_is_at_the_end_of_its_backlash_as_with_a_loose_hinge(op3):
    play, leads, torques = 0.02, [], []
    knees = [op3.joint_names.index(name) for name in ("l_knee", "r_knee")]  # of contrary signs
    for parameter, variants in ((play, []), (0.0, [backlash(play)])):
        world = build_training_world(op3, FLAT_SCENE, 0.002, variants=variants)
        model, sim = world.model, make_sim(world, 1, backlash=parameter)
        sim.place(np.array([0]), place(op3, model, op3.standing)[None])
        target = angles(op3, sim)
        assert sim.sense().joint_pos == pytest.approx(target)
        for _ in range(30):  # until the robot is still, its weight on its bent knees
            sim.follow(target, target)
        link = angles(op3, sim)
        if variants:
            link += sim.qpos[:, [model.joint(f"{n}_backlash").qposadr[0] for n in op3.joint_names]]
        leads.append((sim.sense().joint_pos - link)[0, knees])
        torques.append(sim.torque[0, knees])
    assert np.abs(torques).min() > BACKLASH_TORQUE
    assert np.prod(np.sign(torques[0])) < 0.0
    assert leads[0] == pytest.approx(0.5 * play * np.sign(torques[0]), abs=1e-4)
    assert leads[0] == pytest.approx(leads[1], abs=5e-4)


def test_a_tilted_imu_measures_rotated_gravity_and_a_biased_rate(world, falls):
    tilt = np.array([[0.0, 0.0, 0.0], [0.0, 0.1, 0.0]])
    bias = np.array([[0.0, 0.0, 0.0], [0.01, 0.02, 0.03]])
    sim = make_sim(world, 2, imu_tilt=tilt, gyro_bias=bias)
    sim.place(np.arange(2), np.tile(falls[0], (2, 1)))
    sensed = sim.sense()
    cosine = sensed.gravity[0] @ sensed.gravity[1]
    assert np.linalg.norm(sensed.gravity, axis=1) == pytest.approx([1.0, 1.0])
    assert np.arccos(cosine) <= 0.1 + 1e-6
    assert np.arccos(cosine) > 0.01
    assert np.linalg.norm(sensed.gyro[1] - sensed.gyro[0]) == pytest.approx(np.linalg.norm(bias[1]))


def test_noise_comes_from_the_seed_and_has_its_standard_deviation(world, falls):
    noise = ObservationNoise(joint_pos=0.01, joint_vel=0.1, gyro=0.05, gravity=0.02)
    sim = TrainingSim(world, 16, cycles=CYCLES, threads=1, noise=noise)
    sim.place(np.arange(16), falls)
    exact = sim.sense()
    one, again, other = (sim.sense(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(one.joint_pos, again.joint_pos)
    assert not np.array_equal(one.joint_pos, other.joint_pos)
    assert np.std(one.joint_pos - exact.joint_pos) == pytest.approx(0.01, rel=0.2)
    assert np.std(one.joint_vel - exact.joint_vel) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize("bad", [np.nan, 1e12])
def test_only_a_robot_whose_physics_fails_has_diverged(op3, world, bad, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where MuJoCo writes its log
    sim = TrainingSim(world, 3, cycles=CYCLES, threads=1)
    target = op3.standing.joint_pos[None].repeat(3, axis=0)
    sim.place(np.arange(3), in_the_air(op3, world.model, 3))
    for _ in range(2):  # the second time MuJoCo has already reset it
        sim.follow(target, target)
        assert not sim.diverged.any()
        sim.push(np.array([1]), np.array([[0.0, bad, 0.0]]))
        sim.follow(target, target)
        assert sim.diverged.tolist() == [False, True, False]
        assert np.isfinite(sim.qpos).all()


N = 400


@pytest.fixture(scope="module")
def drawn(world) -> DomainParameters:
    return R.draw(world, N, np.random.default_rng(0))


def test_draws_fill_their_range_and_stay_inside(drawn):
    for name, lower, upper in (
        ("com_shift", -0.01, 0.01),
        ("friction", 0.3, 1.2),
        ("voltage", 10.5, 12.6),  # shares of the nominal 12 V
        ("friction_loss", 0.3, 1.6),
        ("joint_offset", -0.026, 0.026),
        ("backlash", 0.0, 0.018),
    ):
        values, margin = getattr(drawn, name), 0.1 * (upper - lower)
        assert np.all((values >= lower) & (values <= upper)), name
        assert values.min() < lower + margin, name
        assert values.max() > upper - margin, name


def test_delays_share_what_they_may_last_together(drawn):
    both = drawn.action_delay + drawn.sensor_delay
    for delay in (drawn.action_delay, drawn.sensor_delay):
        assert np.all((delay >= 0.0) & (delay <= MOST_DELAY))
        assert delay.max() > 0.8 * MOST_DELAY
    assert both.max() <= 0.06
    assert both.max() > 0.8 * 0.06


def test_a_share_of_robots_has_all_its_torque_and_a_share_one_weak_servo(op3, drawn):
    own = op3.max_torque.max()
    assert np.mean(drawn.torque_limit == own) == pytest.approx(0.35, abs=0.08)
    assert np.mean(drawn.limit_by == PWM) == pytest.approx(0.5, abs=0.08)
    assert set(drawn.limit_by.tolist()) == {CURRENT, PWM}, "OP3's own, else"
    weak = drawn.strength < 0.92
    assert np.all(weak.sum(axis=1) <= 1)
    assert drawn.strength.min() >= 0.92 * 0.55
