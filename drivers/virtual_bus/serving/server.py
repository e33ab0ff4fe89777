"""A bus of virtual devices behind a serial port, served by its own thread."""

from __future__ import annotations

import os
import select
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from drivers.errors import DriverError
from drivers.real_time_class import WIRE_PRIORITY, enter_real_time_class
from drivers.virtual_bus.devices.chain import Chain
from drivers.virtual_bus.serving.exchange import Exchange, Line, Physics, WireStatistics
from drivers.virtual_bus.serving.lock_step import LockStep
from drivers.virtual_bus.serving.pseudo_terminal import PseudoTerminal
from drivers.virtual_bus.serving.real_time import RealTime
from drivers.virtual_bus.serving.side_lines import SideLine

T = TypeVar("T")
LONGEST_STOP = 30.0  # s that one run of physics steps may take before `stop` gives up


class TimeMode(Enum):
    """How time advances on a virtual bus."""

    REAL_TIME = "real time"
    """By the wall clock, and each byte takes its time on the wire, as on a real bus."""
    LOCK_STEP = "lock-step"
    """One control period for each sync write of goal positions by the client."""


@dataclass(frozen=True, kw_only=True)
class PortOptions:
    """Properties of a virtual port."""

    link: Path | str | None = None
    """Its path; None for a temporary one."""
    adapter_latency: float = 0.0
    """In real time, latency timer of the USB adapter [s] (FTDI: 0.016 as shipped, at best 0.001);
    0 for none."""


class CallQueue:
    """Queues actions of other threads; the serving thread runs them between instructions.

    Only the serving thread touches devices and physics, so they need no locks.
    """

    def __init__(self) -> None:
        """Create a closed queue: until `open` and after `close`, callers run their own actions."""
        self._lock = threading.RLock()
        self._server: int | None = None
        self._waiting: deque[tuple[Callable[[], Any], Future[Any]]] = deque()
        self._bell: int | None = None  # an eventfd
        self.lines: list[SideLine] = []
        """Further lines; what comes on them is handled before what came on the waiting one's."""

    def open(self) -> None:
        """Make the calling thread the serving one."""
        with self._lock:
            self._bell = os.eventfd(0)
            self._server = threading.get_ident()

    def close(self) -> None:
        """Run the queued actions; later ones run in their caller's thread."""
        with self._lock:
            self._server = None
            self._do_waiting()
            if self._bell is not None:
                os.close(self._bell)
            self._bell = None

    def call(self, action: Callable[[], T]) -> T:
        """Run an action in the serving thread; return its result."""
        with self._lock:
            is_ours = self._server in (None, threading.get_ident())
            future: Future[T] = Future()
            if not is_ours:
                self._waiting.append((action, future))
                self.ring()
        return action() if is_ours else future.result()

    def ring(self) -> None:
        """Wake the serving thread."""
        with self._lock:
            if self._bell is not None:
                os.eventfd_write(self._bell, 1)

    def wait(self, port: int, duration: float) -> bool:
        """Wait for bytes on a file descriptor, -1 for none; return whether bytes are there.

        Runs queued actions. Waits for ``duration`` seconds at most, below 0 not at all.
        """
        bell = self._bell
        assert bell is not None
        lines = {line.fileno(): line for line in self.lines}
        ends = [end for end in (port, bell, *lines) if end >= 0]
        ready = select.select(ends, (), (), max(duration, 0.0))[0]
        for end in lines.keys() & set(ready):
            lines[end].serve()
        if not ready:
            for line in self.lines:
                line.idle()
        if bell in ready:
            os.eventfd_read(bell)
            self._do_waiting()
        return port in ready

    def _do_waiting(self) -> None:
        while self._waiting:
            action, future = self._waiting.popleft()
            try:
                future.set_result(action())
            except BaseException as error:  # raised in the caller, not in the bus
                future.set_exception(error)


class VirtualBus:
    """A serial port with devices behind it, for any program that speaks Dynamixel.

    Use it in a ``with`` block, or call `start` and `stop`. An exception in its thread is raised
    by `stop`; clients see an unplugged port from then on.

    A client in the same process shares the interpreter with the bus, so a client that computes
    for milliseconds delays its replies. Where timing matters, run the client in another process.
    """

    def __init__(
        self,
        devices: Chain,
        physics: Physics,
        *,
        time_mode: TimeMode = TimeMode.REAL_TIME,
        options: PortOptions | None = None,
        advances_time: bool = True,
        line: SideLine | None = None,
    ) -> None:
        """Create a bus of devices, and the physics behind them; `start` creates its port.

        It ``advances_time`` unless another bus of the robot does. A ``line`` is served in the same
        thread, such as the IMU's.
        """
        options = options or PortOptions()
        self.devices = devices
        self.physics = physics
        self.time_mode = time_mode
        self._exchange = Exchange(devices, physics, advances_time=advances_time)
        self._options = options
        self._calls = CallQueue()
        if line is not None:
            self._calls.lines.append(line)
        self._wire: PseudoTerminal | None = None
        self._served: RealTime | LockStep | None = None
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None
        self._stopping = threading.Event()

    # Starting and stopping -----------------------------------------------------------------

    def start(self) -> VirtualBus:
        """Create the port and serve it, once."""
        if self._wire is not None:
            raise DriverError("a virtual bus runs once: create another one")
        self._wire = PseudoTerminal(self._options.link)
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(self._wire, ready), name="virtual bus", daemon=True
        )
        self._thread.start()
        ready.wait()
        return self

    def stop(self) -> None:
        """End the thread, remove the port, raise what ended it early; again is harmless."""
        if self._thread is None:
            return
        self._stopping.set()
        self._calls.ring()
        self._thread.join(LONGEST_STOP)
        if self._thread.is_alive():
            raise DriverError(f"the physics of the bus did not return within {LONGEST_STOP} s")
        self._thread = None
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def __enter__(self) -> VirtualBus:
        return self if self.running else self.start()

    def __exit__(self, *error: object) -> None:
        self.stop()

    # For its users -------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Return whether the bus serves its port."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def path(self) -> str:
        """Return the path of the port, which survives replugging."""
        if self._wire is None:
            raise DriverError("the virtual bus has no port yet: start it first")
        return self._wire.path

    @property
    def handled(self) -> int:
        """Return the bytes of clients whose instructions are executed; 0 in real time."""
        return self._served.handled if isinstance(self._served, LockStep) else 0

    @property
    def delivered(self) -> int:
        """Return the bytes that were written to clients."""
        return self._wire.delivered if self._wire else 0

    @property
    def time(self) -> float:
        """Return the bus time that devices and physics have reached [s]."""
        return self._exchange.time

    @property
    def statistics(self) -> WireStatistics:
        """Return a copy of the counters."""
        return self.call(lambda: replace(self._exchange.statistics))

    @property
    def line(self) -> Line:
        """Return what is between client and devices."""
        return self._exchange.line

    @line.setter
    def line(self, line: Line) -> None:
        self._exchange.line = line

    def call(self, action: Callable[[], T]) -> T:
        """Run an action between two instructions; return its result.

        While the bus runs, its thread runs the action, so nothing else touches devices or
        physics meanwhile. Before and after, the calling thread does.
        """
        return self._calls.call(action)

    def plug(self) -> None:
        """Plug in a new port under the same path."""
        self.call(self._running_wire().plug)

    def unplug(self) -> None:
        """Unplug the port while clients may use it."""
        self.call(self._running_wire().unplug)

    def _running_wire(self) -> PseudoTerminal:
        if self._wire is None or not self.running:
            raise DriverError("the virtual bus has no port: it is not running")
        return self._wire

    # Its thread ----------------------------------------------------------------------------

    def _run(self, wire: PseudoTerminal, ready: threading.Event) -> None:
        try:
            self._calls.open()
            if self.time_mode is TimeMode.LOCK_STEP:
                served = LockStep(wire, self._exchange, self._calls.wait)
            else:
                if self.physics.is_light:  # real devices reply however busy the computer is
                    enter_real_time_class(WIRE_PRIORITY)
                latency = self._options.adapter_latency
                served = RealTime(wire, self._exchange, self._calls.wait, latency)
            self._served = served
            ready.set()
            while not self._stopping.is_set():
                served.serve()
        except BaseException as error:  # raised by stop()
            self._error = error
        finally:
            wire.close()
            self._calls.close()
            ready.set()
