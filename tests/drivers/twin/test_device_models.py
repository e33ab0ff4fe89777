"""Models of devices: the IMU at a site of the torso, and the heat of servos of any size."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tiny_robots import with_types

from drivers.twin.device_models import AMBIENT_TEMPERATURE, TwinImu, Windings
from robots import Robot

GYRO_STEP = np.radians(1.0 / 16.4)  # ICM-20648 at 2000 deg/s
FORCE_STEP = 9.81 / 16384.0  # at 2 g
PERIOD = 0.01

XML = """
<mujoco><option gravity="0 0 -9.81" timestep="0.01" integrator="Euler"/>
<worldbody><body name="b" pos="0 0 1"><freejoint/>
<geom type="box" size="0.1 0.2 0.3" mass="1"/><site name="imu" pos="0 0 0"/></body></worldbody>
</mujoco>
"""


class Body:
    def __init__(self) -> None:
        self.model = mujoco.MjModel.from_xml_string(XML)
        self.data = mujoco.MjData(self.model)
        self.imu = TwinImu(self.model, "imu")
        mujoco.mj_forward(self.model, self.data)
        self.imu.start(self.data)

    def fall(self, steps: int = 1) -> None:
        for _ in range(steps):
            mujoco.mj_step2(self.model, self.data)
            mujoco.mj_step1(self.model, self.data)
            self.imu.advance(self.data, PERIOD)


def test_forces_and_turns_are_in_the_axes_of_the_body():
    """On its right side the world's up is the body's left; it spins about its own z."""
    body = Body()
    assert body.imu.accelerometer == pytest.approx([0.0, 0.0, 9.81], abs=FORCE_STEP)
    assert body.imu.gyro.tolist() == [0.0, 0.0, 0.0]
    body.data.qpos[3:7] = [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]
    body.data.qvel[5] = 2.0
    mujoco.mj_forward(body.model, body.data)
    body.imu.start(body.data)
    assert body.imu.accelerometer == pytest.approx([0.0, 9.81, 0.0], abs=FORCE_STEP)
    body.fall()
    assert body.imu.gyro == pytest.approx([0.0, 0.0, 2.0], abs=GYRO_STEP)


def test_readings_are_whole_counts_within_the_range():
    body = Body()
    body.data.qvel[3:6] = [0.3, 50.0, -50.0]
    mujoco.mj_forward(body.model, body.data)
    body.fall()
    assert body.imu.gyro / GYRO_STEP == pytest.approx(np.rint(body.imu.gyro / GYRO_STEP))
    assert np.abs(body.imu.gyro).max() == pytest.approx(32767 * GYRO_STEP)
    body.data.qvel[2] = 100.0  # thrown: 10,000 m/s²
    body.fall()
    assert np.abs(body.imu.accelerometer).max() == pytest.approx(32767 * FORCE_STEP, rel=1e-9)


# Heat ---------------------------------------------------------------------------------------------


def test_heat_follows_from_the_mass_of_a_type(tiny: Robot):
    windings = Windings(with_types(tiny, "XM430-W350", "XM540-W270"))
    # By hand: 82 g and 165 g of 0.5 J/(g·K); the surface of the XM540 is 2.012^(2/3) = 1.594
    # times that of the XM430, which has 13 K/W. From its own dimensions it is 1.55 times.
    assert windings.heat_capacity == pytest.approx([41.0, 82.5])
    assert windings.heat_resistance == pytest.approx([13.0, 13.0 / 1.594], rel=1e-3)


@settings(max_examples=10)
@given(current=st.floats(0.1, 2.0))
def test_a_servo_settles_where_the_air_takes_all_its_loss_away(tiny: Robot, current: float):
    robot = with_types(tiny, "XC330-T288", "XM430-W350")
    windings = Windings(robot)
    for _ in range(2000):
        windings.heat(np.full(2, current), 5.0)
    models = [joint.servo.model for joint in robot.joints]
    loss = np.array([current**2 * m.nominal_voltage / m.stall_current for m in models])
    excess = windings.temperature - AMBIENT_TEMPERATURE
    assert excess == pytest.approx(loss * windings.heat_resistance)
