"""The serial port that a virtual bus shows to its clients: a pseudo-terminal.

The bus holds the master; a client opens the slave by a path that stays the same when the
port is unplugged and plugged in again.
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


class WireError(SetupError):
    """The virtual port cannot be made where it was asked for."""

    def __init__(self, link: Path, reason: str) -> None:
        super().__init__(f"virtual port {link}: {reason}")
        self.link = link


class Wire:
    """One end of a pseudo-terminal whose other end any serial program can open.

    All methods are for one thread, but ``path`` may be read by any.
    """

    def __init__(self, link: Path | str | None = None) -> None:
        """Plug the port in.

        Args:
            link: Where clients find it; ``None`` for a folder of its own.

        Raises:
            WireError: if no link can be put there.
        """
        self._folder = Path(tempfile.mkdtemp(prefix="virtual-bus-")) if link is None else None
        self.link = self._folder / "port" if self._folder else Path(link or "")
        self._master = self._slave = -1
        self._device = ""
        try:
            self.plug()
        except BaseException:
            self.close()
            raise

    @property
    def path(self) -> str:
        """Return the path that a client opens; it outlives an unplugging."""
        return str(self.link)

    @property
    def plugged(self) -> bool:
        """Tell whether a client can open the port."""
        return self._master >= 0

    def fileno(self) -> int:
        """Return the master, to wait on for a client's bytes; -1 while unplugged."""
        return self._master

    def plug(self) -> None:
        """Make a new port, raw and ready, and then let the link point to it."""
        if self.plugged:
            return
        self._clear_link()
        self._master, self._slave = os.openpty()
        os.set_blocking(self._master, False)
        tty.setraw(self._slave)  # before a client comes, or the kernel echoes its bytes
        self._device = os.ttyname(self._slave)
        self._publish()

    def unplug(self) -> None:
        """Take the port away: clients get errors, the path is gone."""
        if not self.plugged:
            return
        # The name may soon be another program's terminal, so no link is left to it.
        if self.link.is_symlink() and self.link.readlink() == Path(self._device):
            self.link.unlink()
        master, slave = self._master, self._slave
        self._master = self._slave = -1
        os.close(master)
        os.close(slave)

    def close(self) -> None:
        """Unplug for good."""
        self.unplug()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def read(self) -> bytes:
        """Return what clients have sent and nobody has read, b"" for nothing."""
        try:
            return os.read(self._master, READ_SIZE) if self.plugged else b""
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Hand bytes to the client; return how many fitted.

        A client that does not read fills its queue; what comes then is lost, as in the
        buffer of a serial adapter.
        """
        try:
            return os.write(self._master, data) if self.plugged else 0
        except BlockingIOError:
            return 0

    @property
    def baud(self) -> int:
        """Return the rate that the client has set [bit/s], 0 while unplugged."""
        if not self.plugged:
            return 0
        settings = fcntl.ioctl(self._master, _TCGETS2, bytes(_TERMIOS2_SIZE))
        return struct.unpack_from("<I", settings, _TERMIOS2_OUTPUT_SPEED)[0]

    def tidy(self) -> bool:
        """Make the port as new if no client holds it; tell whether none does.

        A killed client leaves the port exclusive and its answers unread: our own slave
        keeps the terminal alive, so nobody else would clean up.
        """
        if not self.plugged or not self._is_deserted():
            return False
        fcntl.ioctl(self._slave, termios.TIOCNXCL)
        termios.tcflush(self._slave, termios.TCIFLUSH)
        # A raw port is left alone: a client that has just come may be setting its speed.
        if termios.tcgetattr(self._slave)[3] & (termios.ECHO | termios.ICANON):
            tty.setraw(self._slave)
        return True

    def _is_deserted(self) -> bool:
        """Let go of the slave for a moment: the master hangs up if nobody else holds it."""
        exclusive = any(fcntl.ioctl(self._slave, _TIOCGEXCL, bytes(4)))
        fcntl.ioctl(self._slave, termios.TIOCNXCL)  # or we could not open it again
        os.close(self._slave)
        poll = select.poll()
        poll.register(self._master, 0)
        deserted = bool(poll.poll(0))
        self._slave = os.open(self._device, os.O_RDWR | os.O_NOCTTY)
        if exclusive:
            fcntl.ioctl(self._slave, termios.TIOCEXCL)
        return deserted

    def _publish(self) -> None:
        """Create the link to the terminal."""
        try:
            self.link.symlink_to(self._device)
        except OSError as error:
            raise WireError(self.link, f"{error.strerror}, name a path you may write") from error

    def _clear_link(self) -> None:
        """Make room for the link: only one that a dead virtual bus left behind is removed."""
        if not self.link.parent.is_dir():
            raise WireError(self.link, f"there is no folder {self.link.parent}, create it first")
        if not os.path.lexists(self.link):
            return
        if not self.link.is_symlink():
            raise WireError(self.link, "a file is there, name another path or remove it")
        target = self.link.readlink()
        if target.parent != TERMINALS or target.exists():
            raise WireError(
                self.link, f"a link to {target} is there, name another path or remove it"
            )
        self.link.unlink()
