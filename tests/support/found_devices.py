"""Devices on a bus at its present baud rate, found as a scan of one rate finds them."""

from drivers.dynamixel.bus import DynamixelBus
from drivers.service import scan


def find_devices(bus: DynamixelBus) -> list[scan.FoundDevice]:
    """List the devices, by id."""
    found, is_empty = scan._find_broadcast(bus)
    return scan._find_swept(bus) if is_empty else found
