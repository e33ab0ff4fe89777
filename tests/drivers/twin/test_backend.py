"""The twin's physics and sensors, beyond what every backend promises."""

import math
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from nonempty import nonempty

from drivers import Command, SafetyGuard, Twin
from drivers.errors import SetupError
from drivers.servo_units import ServoUnits
from drivers.twin.simulation import build_flat_world
from humanoid_getup.simulation.world import World
from robots import Posture, quaternion


def play(twin, command, cycles):
    with twin:
        for _ in range(cycles):
            twin.read()
            twin.write(command)
        return twin.read()


def test_a_period_is_bit_for_bit_four_plain_physics_steps(op3):
    target = ServoUnits(op3).round_goal(op3.standing.joint_pos + 0.1)
    twin = Twin(op3, limit_by="pwm")
    play(twin, Command.position(op3, target), 100)

    model = build_flat_world(op3)
    data, layout = mujoco.MjData(model), op3.layout(model)
    data.qpos[layout.root_qpos :][:3] = op3.standing.position
    data.qpos[layout.root_qpos + 3 :][:4] = op3.standing.orientation
    data.qpos[layout.qpos] = op3.standing.joint_pos
    data.ctrl[:] = target
    mujoco.mj_step(model, data, nstep=400)
    assert np.array_equal(twin.data.qpos, data.qpos)


def test_a_placed_robot_is_at_rest_and_its_clock_at_zero(tiny):
    twin = Twin(tiny)
    play(twin, Command.position(tiny, np.array([0.5, -0.5])), 30)
    posture = in_the_air(quaternion.from_yaw(0.7), joint_pos=0.3)
    twin.place(posture)
    with twin:
        state = twin.read()
    assert state.time == 0.0
    assert np.array_equal(twin.truth.posture.joint_pos, posture.joint_pos)
    assert np.array_equal(twin.truth.posture.position, posture.position)
    assert np.all(state.joint_vel == 0.0)
    assert state.orientation == pytest.approx(quaternion.IDENTITY), "a robot does not know its yaw"


def in_the_air(orientation=quaternion.IDENTITY, joint_pos=0.0) -> Posture:
    joints = np.full(2, joint_pos)
    return Posture(position=np.array([0.0, 0.0, 5.0]), orientation=orientation, joint_pos=joints)


def test_sensors_have_the_resolution_of_the_real_ones(op3):
    twin = Twin(op3)
    state = play(twin, Command.position(op3, op3.standing.joint_pos + 0.2), 10)
    steps = {
        "joint_pos": 2.0 * math.pi / 4096,
        "joint_vel": 0.229 * 2.0 * math.pi / 60.0,
        "joint_current": 2.69e-3,
        "gyro": math.radians(1.0 / 16.4),
        "temperature": 1.0,
    }
    for name, step in nonempty(steps.items()):
        counts = getattr(state, name) / step
        assert np.any(counts != 0.0), name
        assert counts == pytest.approx(np.rint(counts), abs=1e-6), name


def test_gyro_is_the_mean_turn_rate_in_the_imu_frame(tiny):
    twin = Twin(tiny)
    twin.place(in_the_air(quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), 0.5)))
    spin = twin.data.qvel[3:6]  # root frame
    spin[:] = [0.5, 1.0, -2.0]
    before = twin.truth.posture.orientation
    state = play(twin, Command.position(tiny, np.zeros(2)), 1)
    turned = quaternion.angle_between(before, twin.truth.posture.orientation)
    assert np.linalg.norm(state.gyro) * 0.008 == pytest.approx(turned, rel=2e-3)
    assert state.gyro == pytest.approx(spin, abs=0.05)


def test_a_lower_supply_makes_slower_servos(tiny):
    def swing(voltage):
        twin = Twin(tiny, voltage=voltage)
        twin.place(in_the_air(joint_pos=-1.0))
        return play(twin, Command.position(tiny, np.full(2, 1.0)), 12).joint_vel.mean()

    # No load but the servo's own friction: speed goes with voltage, less the loss
    # 0.105 N·m of 4.1 N·m stall, about 0.12 rad/s.
    fast, slow = swing(12.0), swing(10.0)
    assert (slow + 0.12) / (fast + 0.12) == pytest.approx(10.0 / 12.0, rel=0.03)


def test_a_stalled_servo_heats_up_and_is_stopped_by_the_guard(tiny):
    twin = Twin(replace(tiny, control_period=0.1))  # few cycles, and the same physics
    twin.model.jnt_range[1:] = [[0.0, 0.001]] * 2  # legs that cannot move
    stall = Command.position(tiny, np.full(2, 1.0))
    with SafetyGuard(twin) as guard:
        while guard.fault is None and (time := guard.read().time) < 40.0:
            guard.write(stall)
            if time == pytest.approx(10.0):
                # 2.3 A through 12 V / 2.3 A are 27.6 W, in 41 J/K; cooling takes a little.
                heated = twin.simulation.temperature - 25.0
                assert heated == pytest.approx([27.6 / 41.0 * 10.0] * 2, rel=0.02)
                twin.simulation.temperature[:] = 75.4  # from 65 °C on, less torque
        assert "°C" in str(guard.fault) and 10.0 < time < 40.0
        assert guard.clips.torque.min() > 0


def test_physics_that_do_not_fit_the_robot_are_refused(tiny):
    for period in (0.005, 0.0):
        with pytest.raises(SetupError, match="not a multiple"):
            Twin(World(replace(tiny, control_period=period), model=build_flat_world(tiny)))
    model = build_flat_world(tiny)
    model.opt.timestep = 0.004
    with pytest.raises(SetupError, match=r"0\.004 s, expected at most 0\.002 s"):
        Twin(World(tiny, model=model))
    bare = mujoco.MjModel.from_xml_path(str(tiny.model_file))
    with pytest.raises(SetupError, match="no servo for: l_hip, r_hip"):
        Twin(World(tiny, model=bare))


def test_a_copy_of_a_twin_goes_on_as_the_twin_does(op3):
    tilt = quaternion.normalize(np.array([1.0, 0.2, 0.7, 0.0]))
    lying = replace(op3.standing, position=np.array([0.0, 0.0, 0.3]), orientation=tilt)
    stand = Command.position(op3, op3.standing.joint_pos)
    twin = Twin(op3, lying)
    play(twin, Command.limp(op3.n), 40)
    copied, again = twin.copy(), twin.copy()
    for each in (twin, copied):
        play(each, stand, 40)
        play(each, replace(stand, torque_limit=0.2 * stand.torque_limit), 20)
    np.testing.assert_array_equal(copied.truth.qpos, twin.truth.qpos)
    np.testing.assert_array_equal(copied.simulation.temperature, twin.simulation.temperature)
    assert np.abs(again.truth.qpos - twin.truth.qpos).max() > 0.01
    assert again.simulation.time == pytest.approx(40 * twin.period)


def test_limits_that_change_back_are_those_from_before(op3):
    twin, stand = Twin(op3), Command.position(op3, op3.standing.joint_pos)
    weak = replace(stand, torque_limit=0.1 * stand.torque_limit, pwm_limit=0.5 * stand.pwm_limit)
    with twin:
        first, second, third = (twin.write(command) for command in (stand, weak, stand))
        twin.limit_by = "pwm"
        by_pwm = twin.write(weak)
    np.testing.assert_array_equal(first.torque_limit, third.torque_limit)
    np.testing.assert_array_equal(first.pwm_limit, third.pwm_limit)
    assert np.all(second.torque_limit < 0.11 * first.torque_limit)
    assert np.all(by_pwm.pwm_limit < 0.2)
    assert np.all(second.pwm_limit > 0.4)
