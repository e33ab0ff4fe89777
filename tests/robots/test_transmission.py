"""Gears between servos and joints, against MuJoCo's own gears and the law of energy."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import GuardLimits
from drivers.servo_units import ServoUnits
from robots import Robot
from robots.drive import Drive
from robots.transmission import Transmission

GEARS = st.lists(st.floats(0.1, 10.0), min_size=2, max_size=2).map(np.array)
PAIRS = st.lists(st.floats(-5.0, 5.0), min_size=2, max_size=2).map(np.array)


@given(gear=GEARS, angle=PAIRS, stiffness=PAIRS)
def test_a_gain_at_the_joint_is_a_gain_at_the_servo_seen_through_the_gear(gear, angle, stiffness):
    transmission = Transmission(gear)
    assert transmission.motion_at_actuator(transmission.to_servo(angle)) == pytest.approx(angle)
    servo_torque = stiffness * transmission.to_servo(angle)
    at_joint = transmission.gain_at_actuator(stiffness) * angle
    assert at_joint == pytest.approx(transmission.torque_at_actuator(servo_torque))


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
