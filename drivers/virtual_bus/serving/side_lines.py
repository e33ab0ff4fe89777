"""The lines of a robot beside its servo buses, served by the thread of one of them."""

from __future__ import annotations

import errno
import os
import select
import shutil
import socket
import tempfile
from pathlib import Path

from drivers.imu.i2c import GREETING, LONGEST_PACKET, TRANSFER, I2cChip, reaching
from drivers.virtual_bus.imu.virtual_imu import VirtualUartImu
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal, refuse_link

BACKLOG = 8  # clients that may wait to be accepted


class ImuLine(PseudoTerminal):
    """A pseudo-terminal in front of a virtual IMU; all methods are for the bus' thread."""

    def __init__(self, imu: VirtualUartImu, *, link: Path | None, repeats: bool) -> None:
        """Plug the port in, under a path or a temporary one.

        ``repeats`` says whether to send while time stands still, as it does in lock-step: a
        sensor's own clock does not.
        """
        self._imu, self._repeats = imu, repeats
        super().__init__(link)

    def serve(self) -> None:
        """Reply to what the client has sent."""
        self.write(self._imu.receive(self.read()))

    def pass_on(self) -> None:
        """Send what the sensor has sent by itself."""
        self.write(self._imu.take())

    def idle(self) -> None:
        """Keep sending while the bus is idle, to a client that has read everything."""
        if self._repeats and self.plugged and not self.unread:
            self.write(self._imu.repeat())


class I2cLine:
    """A virtual I2C bus with one chip; all methods are for the bus' thread.

    As on /dev/i2c-N, several programs may transfer, and other addresses do not acknowledge.
    """

    def __init__(self, chip: I2cChip, address: int, *, link: Path | None) -> None:
        """Plug the bus in, with a chip at an address; its socket at a path or a temporary one."""
        self._chip, self._address = chip, address
        self._folder = Path(tempfile.mkdtemp(prefix="virtual-bus-")) if link is None else None
        self._link = link or Path(self._folder or "", "i2c")
        self.path = str(self._link)
        """Path of the socket."""
        self._clients: dict[int, socket.socket] = {}
        self._ends = select.epoll()  # whose descriptor can be waited on as that of a single line
        try:
            self._listener = _listen(self._link)
        except BaseException:
            self._ends.close()
            shutil.rmtree(self._folder or "", ignore_errors=True)
            raise
        self._ends.register(self._listener.fileno(), select.EPOLLIN)

    def fileno(self) -> int:
        """Return the descriptor to wait on."""
        return self._ends.fileno()

    def serve(self) -> None:
        """Accept new clients, and do the transfers of the others."""
        for end, _ in self._ends.poll(0):
            if end == self._listener.fileno():
                self._accept()
            elif end in self._clients:
                self._answer(self._clients[end])

    def idle(self) -> None:
        """Do nothing: a chip sends nothing by itself."""

    def close(self) -> None:
        """Remove the socket; clients see that the bus has ended."""
        for client in list(self._clients.values()):
            self._drop(client)
        self._ends.close()
        self._listener.close()
        self._link.unlink(missing_ok=True)
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def _accept(self) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError:  # it has left already
            return
        client.setblocking(False)
        self._clients[client.fileno()] = client
        self._ends.register(client.fileno(), select.EPOLLIN)
        self._send(client, GREETING)

    def _answer(self, client: socket.socket) -> None:
        try:
            packet = client.recv(LONGEST_PACKET)
        except BlockingIOError:  # it has the number of one that has just left
            return
        except OSError:
            packet = b""
        if packet:
            self._send(client, self._transfer(packet))
        else:
            self._drop(client)

    def _send(self, client: socket.socket, data: bytes) -> None:
        """Send to a client, and drop one that has ended or does not read."""
        try:
            client.send(data)
        except OSError:
            self._drop(client)

    def _drop(self, client: socket.socket) -> None:
        del self._clients[client.fileno()]
        self._ends.unregister(client.fileno())
        client.close()

    def _transfer(self, packet: bytes) -> bytes:
        if len(packet) < TRANSFER.size:
            return bytes([errno.EINVAL])
        address, count = TRANSFER.unpack_from(packet)
        if address != self._address:
            return bytes([errno.EREMOTEIO])  # as Linux reports a missing acknowledgement
        try:
            return b"\0" + self._chip.transfer(packet[TRANSFER.size :], count)
        except OSError as error:
            return bytes([error.errno or errno.EIO])


def _listen(link: Path) -> socket.socket:
    """Create the socket; one that a dead virtual bus left behind is removed."""
    if os.path.lexists(link) and not _is_dead(link):
        raise refuse_link(link, "a file is there, name another path or remove it")
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    listener.setblocking(False)
    try:
        link.unlink(missing_ok=True)
        with reaching(link) as address:
            listener.bind(address)
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        raise refuse_link(link, f"{error.strerror}, name a path you may write") from error
    return listener


def _is_dead(link: Path) -> bool:
    """Return whether a file is a socket that no program listens at."""
    if not link.is_socket():
        return False
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe, reaching(link) as address:
        return probe.connect_ex(address) == errno.ECONNREFUSED


SideLine = ImuLine | I2cLine
