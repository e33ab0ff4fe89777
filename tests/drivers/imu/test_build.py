"""Which source reads which IMU, and on which port."""

import pytest
from imu_bench import KINDS

from drivers.imu.background import BackgroundImu
from drivers.imu.bno055 import Bno055
from drivers.imu.bno08x_rvc import Bno08xRvc
from drivers.imu.build import build_imu_source
from drivers.imu.serial_line import SerialLineImu
from drivers.serial_port import SerialPort
from robots import ImuSettings

SOURCES = {
    "serial line": SerialLineImu,
    "described line": SerialLineImu,
    "BNO055 on a UART": Bno055,
    "BNO055 on I2C": BackgroundImu,
    "BNO08x UART-RVC": Bno08xRvc,
    "BNO08x on I2C": BackgroundImu,
}


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_has_its_source(kind: str):
    assert type(build_imu_source(KINDS[kind], "/dev/imu", SerialPort)) is SOURCES[kind]


def test_a_port_that_is_given_goes_before_that_of_the_robot():
    settings = ImuSettings(kind="serial_line", port="/dev/ttyS0", baud=9600)
    opened = []

    def make_port(path: str, baud: int) -> SerialPort:
        opened.append((path, baud))
        return SerialPort(path, baud)

    build_imu_source(settings, "/dev/ttyUSB7", make_port)
    build_imu_source(settings, "", make_port)
    assert opened == [("/dev/ttyUSB7", 9600), ("/dev/ttyS0", 9600)]
