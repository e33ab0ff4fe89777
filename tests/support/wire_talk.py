"""Talk to virtual devices: frames in, statuses out."""

from collections.abc import Iterable

from drivers.dynamixel.protocol2 import FrameParser, Packet, Status
from drivers.virtual_bus.devices.chain import Chain, Reply
from drivers.virtual_bus.devices.device import VirtualDevice
from drivers.virtual_bus.devices.sensors import Measured
from drivers.virtual_bus.devices.servo import VirtualServo

ROOM = 25.0  # °C


def request(frame: bytes) -> Packet:
    """Read the one good frame in some bytes."""
    (item,) = FrameParser().feed(frame)
    assert isinstance(item, Packet)
    return item


def find_device(chain: Chain, device_id: int) -> VirtualDevice:
    """Find the first device of an id."""
    return next(device for device in chain.devices if device.id == device_id)


def talk(chain: Chain, frame: bytes) -> bytes:
    """Send a frame; return all bytes that come back."""
    return b"".join(answer.data for answer in chain.handle(request(frame)))


def read_answers(answers: Iterable[Reply]) -> list[Status]:
    """Read ordinary statuses; each answer must be one good frame."""
    statuses = []
    for answer in answers:
        statuses.append(Status.from_packet(request(answer.data)))
        assert statuses[-1].id == answer.device
    return statuses


def write(device: VirtualDevice, name: str, value: int) -> int:
    """Write an item as a client would; return the status' error byte."""
    item = device.table[name]
    params = item.address.to_bytes(2, "little") + item.encode(value)
    status = device.handle(0x03, params)
    assert status is not None
    return status.error


def read(device: VirtualDevice, name: str) -> int:
    """Read an item as a client would; there must be no error number."""
    item = device.table[name]
    status = device.handle(
        0x02, item.address.to_bytes(2, "little") + item.size.to_bytes(2, "little")
    )
    assert status is not None
    assert status.number == 0
    return item.decode(status.data)


def sense(servo: VirtualServo, **measured: float) -> None:
    """Set what a servo measures; anything not given is at rest."""
    servo.sense(Measured(**{"ticks": 2048.0, "temperature": ROOM} | measured))


def powered(**registers: int) -> VirtualServo:
    """Make a servo under torque, with some registers set before."""
    servo = VirtualServo(1)
    for name, value in (registers | {"torque_enable": 1}).items():
        assert write(servo, name, value) == 0
    return servo
