"""Serial ports, and explanations for those that do not open."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import grp
import os
import select
import stat
import termios
import time
from collections.abc import Callable
from pathlib import Path

import serial

from drivers.errors import DriverError, SetupError

SDK = "sdk:"
"""Before the path of a device that the maker's own library opens."""
CHUNK = 4096  # bytes, more than any reply
# Longest wait for the system to accept bytes to send [s]. It accepts them at once unless the
# adapter hangs.
SEND_TIMEOUT = 0.1
REOPEN_EVERY = 0.2  # s between two attempts to open a port that was lost
# s; an adapter without a latency timer (ttyACM) passes on what came once in a frame of full-speed
# USB, and a program behind a pseudo-terminal takes its share of such a time.
USB_FRAME = 0.001
UNIX98_SLAVES = range(136, 144)  # major numbers of pseudo-terminals (Linux, devices.txt)


class PortError(DriverError):
    """A serial port cannot be used."""

    def __init__(self, path: str, text: str) -> None:
        super().__init__(f"port {path}: {text}")
        self.path = path


class PortRefusedError(PortError, SetupError):
    """A port does not open."""


class PortLostError(PortError):
    """A port went away while it was in use: a fault of the hardware."""

    def __init__(self, path: str) -> None:
        super().__init__(path, "lost; is the adapter still plugged in?")


class SerialPort:
    """A serial line over pyserial, locked against other programs.

    Half duplex, 8 data bits, no parity, 1 stop bit. pyserial opens and configures the device;
    bytes bypass it, straight to the descriptor: a read then waits in one `select` until a
    deadline, and a hung adapter cannot block.
    """

    def __init__(self, path: str, baud: int) -> None:
        """Prepare to open a device file, with `SDK` before it through dynamixel-sdk."""
        self.path = path.removeprefix(SDK)
        """Device file."""
        self._is_by_sdk = path.startswith(SDK)
        self.baud = baud
        """Baud rate [bit/s]; `set_baud` changes it."""
        self._serial: serial.Serial | None = None
        self._fd = -1

    @property
    def is_open(self) -> bool:
        """Return whether the device is open."""
        return self._fd >= 0

    def open(self) -> None:
        """Open and lock the device; harmless if it is open.

        Raises:
            PortRefusedError: if it is missing, busy, forbidden, or not a serial port.
        """
        if self.is_open:
            return
        try:
            self._serial = self._open_serial()
            self._fd = self._serial.fileno()
            # The lock does not keep out programs that ignore it.
            fcntl.ioctl(self._fd, termios.TIOCEXCL)
        except (OSError, ValueError, termios.error) as error:
            self.close()
            reason = explain_refusal(self.path, self.baud, error)
            raise PortRefusedError(self.path, reason) from error

    def close(self) -> None:
        """Unlock and close the device; harmless if it is closed."""
        device, self._serial, self._fd = self._serial, None, -1
        if device is not None:
            # A device that was unplugged refuses even this.
            with contextlib.suppress(OSError, termios.error):
                fcntl.ioctl(device.fileno(), termios.TIOCNXCL)
            with contextlib.suppress(OSError, termios.error):
                device.close()

    def set_baud(self, baud: int) -> None:
        """Change the baud rate [bit/s], open or not; what was received before is dropped."""
        was_open = self.is_open
        self.close()
        self.baud = baud
        if was_open:
            self.open()
            self.flush()

    def write(self, data: bytes) -> None:
        """Pass bytes to the device, without waiting until they are sent.

        Raises:
            PortLostError: if the device is gone or accepts no more bytes.
        """
        deadline = time.monotonic() + SEND_TIMEOUT
        while data:
            try:
                data = data[os.write(self._fd, data) :]
            except BlockingIOError:
                left = deadline - time.monotonic()
                if left <= 0.0 or not select.select((), (self._fd,), (), left)[1]:
                    raise PortLostError(self.path) from None
            except OSError as error:
                raise PortLostError(self.path) from error

    def read(self, deadline: float) -> bytes:
        """Return received bytes; wait for one until a deadline of the monotonic clock [s].

        Returns nothing at the deadline.

        Raises:
            PortLostError: if the device is gone.
        """
        try:
            left = max(deadline - time.monotonic(), 0.0)
            if not select.select((self._fd,), (), (), left)[0]:
                return b""
            data = os.read(self._fd, CHUNK)
        except BlockingIOError:
            return b""
        except (OSError, ValueError) as error:
            raise PortLostError(self.path) from error
        if not data:  # readable, but without data: the other end has hung up
            raise PortLostError(self.path)
        return data

    def flush(self) -> int:
        """Drop received bytes; return their number. Raises `PortLostError`."""
        count = 0
        try:
            while data := os.read(self._fd, CHUNK):
                count += len(data)
        except BlockingIOError:
            pass
        except OSError as error:
            raise PortLostError(self.path) from error
        return count

    def _open_serial(self) -> serial.Serial:
        if self._is_by_sdk:
            return open_by_sdk(self.path, self.baud)
        return serial.Serial(self.path, self.baud, timeout=0, exclusive=True)


MakePort = Callable[[str, int], SerialPort]
"""Makes a port of a path and a baud rate [bit/s]."""


def open_by_sdk(path: str, baud: int) -> serial.Serial:
    """Open a device through the port handler of ROBOTIS' dynamixel-sdk, if it is installed."""
    try:
        from dynamixel_sdk import PortHandler
    except ModuleNotFoundError as error:
        text = "there is no package 'dynamixel_sdk': pip install 'humanoid-getup[sdk]'"
        raise PortRefusedError(path, text) from error
    handler = PortHandler(path)
    if not handler.setBaudRate(baud):
        raise ValueError(f"dynamixel-sdk cannot set {baud} bit/s; use pyserial")
    device = handler.ser
    assert device is not None
    try:
        fcntl.flock(device.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        device.close()
        raise
    return device


def explain_refusal(path: str, baud: int, error: Exception) -> str:
    """Explain why a port does not open, and what to do."""
    number = getattr(error, "errno", None)
    if number in (errno.EAGAIN, errno.EBUSY):
        return "in use by another program; stop that one first"
    if number in (errno.EACCES, errno.EPERM):
        return f"permission denied; {_explain_permission(path)}"
    if not Path(path).exists():
        return "does not exist; plug the adapter in, or name another port (ls /dev/serial/by-id)"
    if isinstance(error, ValueError):
        return f"{baud} bit/s is refused ({error})"
    if "configure" in str(error) or isinstance(error, termios.error):
        return "is not a serial port; name the adapter's device (ls /dev/serial/by-id)"
    return f"does not open ({error})"


def _explain_permission(path: str) -> str:
    with contextlib.suppress(OSError, KeyError):
        group = grp.getgrgid(Path(path).stat().st_gid).gr_name
        if group != "root":
            return f"join the group '{group}' (sudo usermod -aG {group} $USER) and log in again"
    return "its owner is root: add a udev rule that gives it to the group 'dialout'"


def is_pseudo_terminal(path: str) -> bool:
    """Return whether a port is a Linux pseudo-terminal, as that of a virtual bus is."""
    with contextlib.suppress(OSError):
        status = Path(path.removeprefix(SDK)).stat()
        return stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) in UNIX98_SLAVES
    return False


def read_latency_timer(path: str) -> int | None:
    """Read how long a USB adapter holds back a short reply [ms]; ``None`` if it has no timer."""
    name = Path(path.removeprefix(SDK)).resolve().name
    with contextlib.suppress(OSError, ValueError):
        return int(Path(f"/sys/bus/usb-serial/devices/{name}/latency_timer").read_text())
    return None


def read_latency(path: str) -> float:
    """Return how long the adapter of a port holds back a reply [s]; if unknown, a USB frame."""
    timer = read_latency_timer(path)
    return USB_FRAME if timer is None else timer * 1e-3
