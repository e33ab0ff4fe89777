"""A port of the makers' handlers that keeps what is written to it."""


class RecordingPort:
    def __init__(self) -> None:
        self.written = b""

    @property
    def is_using(self) -> bool:
        return False

    @is_using.setter
    def is_using(self, busy: bool) -> None:
        """Stay free: a vendor's handler leaves a port busy after some instructions."""

    def clearPort(self) -> None:
        pass

    def writePort(self, packet: list[int]) -> int:
        self.written = bytes(packet)
        return len(packet)

    def setPacketTimeout(self, length: int) -> None:
        pass
