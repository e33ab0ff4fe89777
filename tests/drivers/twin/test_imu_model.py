"""The twin's IMU: what a gyro and an accelerometer at a site of the torso read."""

import mujoco
import numpy as np
import pytest

from drivers.twin.device_models import SensorNoise, TwinImu

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
    """A free box with the IMU in its middle."""

    def __init__(self, noise: SensorNoise | None = None) -> None:
        self.model = mujoco.MjModel.from_xml_string(XML)
        self.data = mujoco.MjData(self.model)
        rng = np.random.default_rng(0)
        self.imu = TwinImu(self.model, "imu", noise or SensorNoise(), rng)
        mujoco.mj_forward(self.model, self.data)
        self.imu.start(self.data)

    def fall(self, steps: int = 1) -> None:
        for _ in range(steps):
            mujoco.mj_step2(self.model, self.data)
            mujoco.mj_step1(self.model, self.data)
            self.imu.advance(self.data, PERIOD)


def test_a_body_at_rest_feels_one_g_upwards():
    imu = Body().imu
    assert imu.accelerometer == pytest.approx([0.0, 0.0, 9.81], abs=FORCE_STEP)
    assert imu.gyro.tolist() == [0.0, 0.0, 0.0]


def test_forces_and_turns_are_in_the_axes_of_the_body():
    """On its right side the world's up is the body's left; it spins about its own z."""
    body = Body()
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


def test_noise_has_the_deviation_that_is_set():
    body = Body(SensorNoise(gyro=0.05, accelerometer=0.2))
    gyro, force = [], []
    for _ in range(400):
        body.imu.start(body.data)
        gyro.append(body.imu.gyro)
        force.append(body.imu.accelerometer)
    assert np.std(gyro) == pytest.approx(0.05, rel=0.1)
    assert np.std(force, axis=0) == pytest.approx(0.2, rel=0.15)
