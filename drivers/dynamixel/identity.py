"""Model and firmware of a device: the reply to a ping, or registers where a ping names neither."""

from __future__ import annotations

import struct

from drivers.dynamixel.protocol1 import FEETECH
from drivers.dynamixel.protocol2 import Span, Status
from drivers.dynamixel.wire import PROTOCOL_2, Wire

PING_DATA = 3  # bytes: model number, firmware
FIRST = Span(0, 6)
"""Registers that name a device where a ping does not: AX and MX have model, firmware and id at 0,
2 and 3, Feetech's have firmware, model and id at 0, 3 and 5."""
AT_ID = {"1.0": 3, "feetech": 5}
"""Place of the id in those registers, by protocol."""


def decode_identity(wire: Wire, status: Status) -> Status:
    """Return a reply as that to a ping of Protocol 2.0: model number and firmware."""
    data = status.data
    if wire is PROTOCOL_2 or len(data) < FIRST.length:
        return status
    number, firmware = data[0] | data[1] << 8, data[2]
    if wire is FEETECH:
        number, firmware = data[3] | data[4] << 8, data[0]
    return Status(status.id, status.error, struct.pack("<HB", number, firmware), status.alarms)
