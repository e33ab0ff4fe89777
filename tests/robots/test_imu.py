"""The IMU of a robot.toml."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spoiling import complaint, spoil

from robots import RobotError, load_robot
from robots.imu import SensorAxes

AXES = st.permutations("xyz").flatmap(
    lambda names: st.tuples(*(st.sampled_from([name, f"-{name}"]) for name in names))
)
VECTORS = st.tuples(*3 * [st.floats(-10.0, 10.0)]).map(np.array)
BOARD = '[bus.board]\nmodel = "OpenCR"\n'
BY_ADDRESS = """[bus.board]
gyro_address = 60
accelerometer_address = 66
gyro_scale = 0.001
accelerometer_scale = 0.01
"""


@given(names=AXES, vector=VECTORS)
def test_axes_are_a_signed_permutation_and_lead_back(names, vector):
    axes = SensorAxes.of(names)
    assert axes.to_sensor(axes.to_site(vector)) == pytest.approx(vector, abs=0.0)
    assert axes.matrix @ vector == pytest.approx(axes.to_site(vector), abs=0.0)
    assert abs(np.linalg.det(axes.matrix)) == pytest.approx(1.0)
    # The site's x axis is the sensor's -y: what the sensor feels along y is felt along -x.
    assert SensorAxes.of(("-y", "x", "z")).to_site(np.arange(1.0, 4.0)).tolist() == [-2.0, 1.0, 3.0]


def describe(robot: Path, table: str) -> None:
    """Append an [imu] table to a robot.toml."""
    file = robot / "robot.toml"
    file.write_text(f"{file.read_text()}\n[imu]\n{table}\n")


def test_a_board_on_the_bus_is_the_imu_unless_another_is_described(own_robot):
    assert load_robot(own_robot).imu_kind == "board"
    describe(own_robot, 'kind = "bno08x"\naxes = ["-y", "x", "z"]')
    robot = load_robot(own_robot)
    assert robot.imu_kind == "bno08x" and robot.imu is not None and robot.imu.is_serial
    assert robot.imu.address == 0x4A


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ('kind = "mpu6050"', "imu.kind is 'mpu6050', expected board, bno055, bno08x, serial_line"),
        ('kind = "bno055"\naxes = ["x", "y"]', "expected three signs (-1 or 1), or three signed"),
        ('kind = "bno055"\naxes = ["x", "y", "y"]', "expected each of x, y and z once"),
        ('kind = "bno055"\naxes = ["x", "y", "-z"]', "expected right-handed axes: turn the sign"),
        ('kind = "bno055"\naxes = [1, "y", "z"]', "expected three signs or three axes, not both"),
        ('kind = "serial_line"\nformat = "gx gy"', "imu.format is 'gx gy', expected gx gy gz ax"),
        ('kind = "serial_line"\ngyro_unit = "rpm"', "imu.gyro_unit is 'rpm', expected rad/s, deg/"),
    ],
)
def test_a_wrong_imu_is_reported_with_what_is_expected(own_robot, table, words):
    describe(own_robot, table)
    assert words in complaint(own_robot)


def test_a_board_by_its_addresses_is_accepted_and_overlaps_are_reported(own_robot):
    spoil(own_robot, BOARD, BY_ADDRESS)
    spoil(own_robot, "powers_servos = true", "powers_servos = false")
    assert load_robot(own_robot).imu_kind == "board"
    spoil(own_robot, "accelerometer_address = 66", "accelerometer_address = 64")
    words = "gyro_address is 60 and accelerometer_address 64, expected 6 bytes"
    assert words in complaint(own_robot)


def test_a_robot_may_be_without_an_imu(own_robot: Path):
    file = own_robot / "robot.toml"
    file.write_text(file.read_text().split("[bus.board]")[0])
    spoil(own_robot, 'imu_site = "imu"\n', "")
    robot = load_robot(own_robot)
    assert (robot.imu_site, robot.imu_kind) == (None, None)
    with pytest.raises(RobotError, match=r"'tiny' has no IMU.*expected imu_site in"):
        robot.require_imu_site()
