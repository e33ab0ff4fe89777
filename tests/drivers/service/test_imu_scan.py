"""IMU chips on I2C buses, found by what they say of themselves."""

from drivers.service.scan import FoundImu, find_imus
from drivers.virtual_bus.imu.bno055 import VirtualBno055
from drivers.virtual_bus.imu.bno08x_i2c import VirtualBno08xI2c


class OtherChip(VirtualBno055):
    """A chip whose registers all hold 0xFF."""

    def transfer(self, data: bytes, count: int = 0) -> bytes:
        del data
        return b"\xff" * count


def place(chips: dict):
    """Return what makes the chips of some buses and addresses; elsewhere nothing replies."""

    def make(bus: int, address: int):
        chip = chips.get((bus, address))
        if chip is None:
            chip = VirtualBno055()
            chip.alive = False
        return chip

    return make


def test_each_chip_is_named_with_its_bus_and_others_are_left_out():
    chips = {(1, 0x29): VirtualBno055(), (3, 0x4A): VirtualBno08xI2c()}
    chips |= {(1, 0x28): OtherChip(), (1, 0x4B): OtherChip()}
    assert find_imus((1, 2, 3), place(chips)) == [
        FoundImu(path="virtual I2C", model="BNO055"),
        FoundImu(path="virtual I2C", model="BNO08x"),
    ]


def test_buses_that_are_not_there_hold_nothing():
    assert find_imus((250,)) == []
