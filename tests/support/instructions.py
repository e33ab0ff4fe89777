"""Instructions that the driver never sends."""

from drivers.dynamixel.protocol2 import BROADCAST, Instruction, Packet


def reg_write(device: int, address: int, data: bytes) -> bytes:
    """Store a write in a device until `action`."""
    return Packet(device, Instruction.REG_WRITE, address.to_bytes(2, "little") + data).encode()


def action(device: int = BROADCAST) -> bytes:
    """Apply what `reg_write` stored."""
    return Packet(device, Instruction.ACTION).encode()


def clear_turns(device: int) -> bytes:
    """Bring a device's position back into one turn."""
    return Packet(device, Instruction.CLEAR, b"\x01\x44\x58\x4c\x22").encode()


def backup(device: int) -> bytes:
    """Store a device's control table."""
    return Packet(device, Instruction.BACKUP, b"\x01CTRL").encode()


def restore(device: int) -> bytes:
    """Restore a device's stored control table."""
    return Packet(device, Instruction.BACKUP, b"\x02CTRL").encode()
