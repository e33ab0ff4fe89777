"""The frame that several devices write in turn to answer a fast read."""

from collections.abc import Sequence

from drivers.dynamixel.protocol2 import BROADCAST, HEADER, Instruction, Status, seal


def encode_fast_status(replies: Sequence[Status]) -> bytes:
    """Build the frame; nothing in it is stuffed.

    Each device adds its error, id and data, and the CRC of all that came before.
    """
    length = 1 + sum(4 + len(reply.data) for reply in replies)
    frame = HEADER + bytes((BROADCAST, *length.to_bytes(2, "little"), Instruction.STATUS))
    for reply in replies:
        frame = seal(frame + bytes((reply.error, reply.id)) + reply.data)
    return frame
