"""The serial port of a virtual bus: a pseudo-terminal.

The bus holds the master; clients open the slave by a path that survives replugging.
"""

from __future__ import annotations

import fcntl
import os
import select
import shutil
import struct
import tempfile
import termios
import tty
from pathlib import Path

from drivers.errors import SetupError

READ_SIZE = 65536
TERMINALS = Path("/dev/pts")

# From Linux' asm-generic/ioctls.h and termbits.h; Python's termios has no names for them.
_TCGETS2 = 0x802C542A
_TIOCGEXCL = 0x80045440
_TERMIOS2_SIZE, _TERMIOS2_OUTPUT_SPEED = 44, 40


def refuse_link(link: Path, reason: str) -> SetupError:
    """Make the error of a link to a virtual port that cannot be created."""
    return SetupError(f"virtual port {link}: {reason}")


class PseudoTerminal:
    """The bus's end of a pseudo-terminal; any serial program can open the other end.

    All methods are for one thread; ``path`` may be read by any.
    """

    def __init__(self, link: Path | str | None = None) -> None:
        """Plug the port in: under a path, or under one in a temporary folder."""
        self._folder = Path(tempfile.mkdtemp(prefix="virtual-bus-")) if link is None else None
        self.link = self._folder / "port" if self._folder else Path(link or "")
        self.path = str(self.link)
        """Path that a client opens, which survives replugging."""
        self._master = self._slave = -1
        self._device = ""
        self.delivered = 0
        """Bytes written to clients."""
        try:
            self.plug()
        except BaseException:
            self.close()
            raise

    @property
    def plugged(self) -> bool:
        """Return whether a client can open the port."""
        return self._master >= 0

    def fileno(self) -> int:
        """Return the master's file descriptor, -1 while unplugged."""
        return self._master

    def plug(self) -> None:
        """Create a new port in raw mode, then the link to it."""
        if self.plugged:
            return
        self._clear_link()
        self._master, self._slave = os.openpty()
        os.set_blocking(self._master, False)
        tty.setraw(self._slave)  # before a client opens it, or the kernel echoes its bytes
        self._device = os.ttyname(self._slave)
        try:
            self.link.symlink_to(self._device)
        except OSError as error:
            raise refuse_link(self.link, f"{error.strerror}, name a path you may write") from error

    def unplug(self) -> None:
        """Remove port and path; clients get errors."""
        if not self.plugged:
            return
        # The device name may soon belong to another terminal: leave no link to it.
        if self.link.is_symlink() and self.link.readlink() == Path(self._device):
            self.link.unlink()
        master, slave = self._master, self._slave
        self._master = self._slave = -1
        os.close(master)
        os.close(slave)

    def close(self) -> None:
        """Unplug and remove the temporary folder."""
        self.unplug()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def read(self) -> bytes:
        """Return the bytes that clients have sent, b"" for none."""
        try:
            return os.read(self._master, READ_SIZE) if self.plugged else b""
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Deliver bytes to the client; return how many fitted into its queue.

        As in a serial adapter, the rest is lost when the client does not read.
        """
        try:
            count = os.write(self._master, data) if self.plugged else 0
        except BlockingIOError:
            return 0
        self.delivered += count
        return count

    @property
    def unread(self) -> int:
        """Return the number of bytes that the client has not read yet."""
        if not self.plugged:
            return 0
        count = fcntl.ioctl(self._slave, termios.FIONREAD, bytes(4))
        return struct.unpack("<I", count)[0]

    @property
    def baud(self) -> int:
        """Return the baud rate that the client has set [bit/s], 0 while unplugged."""
        if not self.plugged:
            return 0
        settings = fcntl.ioctl(self._master, _TCGETS2, bytes(_TERMIOS2_SIZE))
        return struct.unpack_from("<I", settings, _TERMIOS2_OUTPUT_SPEED)[0]

    def tidy(self) -> bool:
        """Reset the port if no client holds it; return whether that is so.

        A killed client leaves the port locked and its replies unread, because our own open slave
        keeps the terminal alive.
        """
        if not self.plugged or not self._is_unused():
            return False
        fcntl.ioctl(self._slave, termios.TIOCNXCL)
        termios.tcflush(self._slave, termios.TCIFLUSH)
        # A raw port is left as it is: a new client may be setting its baud rate.
        if termios.tcgetattr(self._slave)[3] & (termios.ECHO | termios.ICANON):
            tty.setraw(self._slave)
        return True

    def _is_unused(self) -> bool:
        """Close our slave for a moment: the master hangs up if no client holds one."""
        exclusive = any(fcntl.ioctl(self._slave, _TIOCGEXCL, bytes(4)))
        fcntl.ioctl(self._slave, termios.TIOCNXCL)  # or we could not open it again
        os.close(self._slave)
        poll = select.poll()
        poll.register(self._master, 0)
        unused = bool(poll.poll(0))
        self._slave = os.open(self._device, os.O_RDWR | os.O_NOCTTY)
        if exclusive:
            fcntl.ioctl(self._slave, termios.TIOCEXCL)
        return unused

    def _clear_link(self) -> None:
        """Make room for the link: only one that a dead virtual bus left behind is removed."""
        if not self.link.parent.is_dir():
            raise refuse_link(self.link, f"there is no folder {self.link.parent}, create it first")
        if not os.path.lexists(self.link):
            return
        if not self.link.is_symlink():
            raise refuse_link(self.link, "a file is there, name another path or remove it")
        target = self.link.readlink()
        if target.parent != TERMINALS or target.exists():
            raise refuse_link(
                self.link, f"a link to {target} is there, name another path or remove it"
            )
        self.link.unlink()
