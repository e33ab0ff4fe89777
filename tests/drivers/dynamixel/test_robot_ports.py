"""The ports of a robot are built from its description, and opened or refused together."""

from dataclasses import replace

import pytest
from memory_port import MemoryPort

from drivers.dynamixel.bus import FACTORY_RETURN_DELAY, DynamixelBus
from drivers.dynamixel.robot_ports import build_ports, find_imu, open_ports, using_margin
from drivers.errors import SetupError
from drivers.imu.bno08x_rvc import Bno08xRvc
from drivers.serial_port import PortError
from robots import ImuSettings, Robot
from robots.description.servo_catalog import servo_models
from robots.imu import IMU_PORT

PATHS = {"left": "/dev/a", "right": "/dev/b", "main": "/dev/c"}


class NamedPort(MemoryPort):
    def __init__(self, path: str, baud: int) -> None:
        super().__init__(None, baud)
        self.path = path


def test_the_imu_is_the_board_a_line_of_its_own_or_none(tiny: Robot):
    ports = build_ports(tiny, PATHS, NamedPort, answer_margin=0.01)
    assert find_imu(tiny, ports, PATHS) is ports[0].board
    own = replace(tiny, imu=ImuSettings(kind="bno08x", port="/dev/described"))
    assert isinstance(find_imu(own, ports, PATHS), Bno08xRvc)
    assert find_imu(own, ports, PATHS).name.endswith("/dev/described")
    assert find_imu(own, ports, PATHS | {IMU_PORT: "/dev/named"}).name.endswith("/dev/named")
    bare = replace(tiny, bus=replace(tiny.bus, board=None), imu=None)
    assert find_imu(bare, build_ports(bare, PATHS, NamedPort, answer_margin=0.01), PATHS) is None


def test_every_port_that_does_not_open_is_named():
    buses = [DynamixelBus(NamedPort(path, 1_000_000)) for path in PATHS.values()]
    for bus in buses:
        bus.return_delay = 0.0
    buses[0].port.unplugged = True
    with pytest.raises(PortError, match=r"^port /dev/a: does not exist$"):
        open_ports(buses)
    buses[2].port.unplugged = True
    both = r"^port /dev/a: does not exist; port /dev/c: does not exist$"
    with pytest.raises(SetupError, match=both):
        open_ports(buses)
    assert buses[1].port.is_open
    assert {bus.return_delay for bus in buses} == {FACTORY_RETURN_DELAY}


def test_a_margin_is_each_bus_own_again_after_the_block_even_after_an_error():
    buses = [DynamixelBus(NamedPort("", 1_000_000), answer_margin=m) for m in (0.001, 0.002)]
    with pytest.raises(KeyboardInterrupt), using_margin(iter(buses), 0.5):
        assert [bus.answer_margin for bus in buses] == [0.5, 0.5]
        raise KeyboardInterrupt
    assert [bus.answer_margin for bus in buses] == [0.001, 0.002]


def test_servos_without_known_registers_are_refused_in_one_line(tiny: Robot):
    unknown = replace(servo_models()["STS3250-C001"], name="home-made")
    joints = tuple(
        replace(joint, servo=replace(joint.servo, model=unknown)) for joint in tiny.joints
    )
    with pytest.raises(SetupError, match="has servos home-made, expected those with") as caught:
        build_ports(replace(tiny, joints=joints), PATHS, NamedPort, answer_margin=0.01)
    assert str(caught.value).endswith("by --backend twin")
