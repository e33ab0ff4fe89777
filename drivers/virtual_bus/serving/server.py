"""A bus of virtual servos behind a serial port, served by a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from pathlib import Path
from types import TracebackType
from typing import TypeVar

import numpy as np

from drivers.errors import DriverError
from drivers.virtual_bus.serving.bus_clock import BusTime
from drivers.virtual_bus.serving.call_queue import Calls
from drivers.virtual_bus.serving.exchange import Exchange
from drivers.virtual_bus.serving.fault_injector import Faults
from drivers.virtual_bus.serving.fault_schedule import Schedule
from drivers.virtual_bus.serving.interfaces import Devices, Physics, StillPhysics, WireStatistics
from drivers.virtual_bus.serving.lock_step import LockStep
from drivers.virtual_bus.serving.pseudo_terminal import Wire
from drivers.virtual_bus.serving.real_time import RealTime

T = TypeVar("T")
LONGEST_STOP = 30.0  # s that one stretch of physics may take before a stop is given up


class TimeMode(Enum):
    """How time passes on a virtual bus."""

    REAL_TIME = "real time"
    """As on a real bus: by the wall clock, and each byte takes its time on the wire."""
    LOCK_STEP = "lock-step"
    """With the client: one control period for each sync write of goal positions."""


class VirtualBusError(DriverError):
    """A virtual bus was asked for what it cannot do now."""


class VirtualBus:
    """A serial port with servos behind it, for any program that speaks Dynamixel.

    Use it in a ``with`` block, or `start` and `stop` it. What goes wrong in its thread is
    raised by `stop`, and clients see an unplugged port from then on.

    A client in the same process shares the interpreter with the bus: one that computes for
    milliseconds without waiting makes the bus answer late. Where times matter, let the
    client run in a process of its own.
    """

    def __init__(
        self,
        devices: Devices,
        body: Physics | None = None,
        *,
        pace: TimeMode = TimeMode.REAL_TIME,
        link: Path | str | None = None,
        rng: np.random.Generator | None = None,
        schedule: Schedule | None = None,
        adapter_latency: float = 0.0,
        strict_stuffing: bool = False,
    ) -> None:
        """Prepare a bus; it has no port yet.

        Args:
            devices: What hangs on the wire.
            body: Physics behind it; ``None`` for devices on a table.
            pace: How time passes.
            link: Path of the port; ``None`` for one of its own.
            rng: Source of chance in faults.
            schedule: Faults to come.
            adapter_latency: In real time, how often the USB adapter hands bytes over [s]
                (an FTDI's latency timer: 0.016 as shipped, at best 0.001); 0 for at once.
            strict_stuffing: Whether devices ignore an instruction with an unstuffed
                FF FF FD in it; else it is only counted.
        """
        self.devices = devices
        self.body = body or StillPhysics(devices)
        self.pace = pace
        self.faults = Faults(self, rng or np.random.default_rng(0))
        self._time = BusTime(self.body, self.faults, schedule)
        self._statistics = WireStatistics()
        self._exchange = Exchange(
            devices, self.faults, self._statistics, strict_stuffing=strict_stuffing
        )
        self._link, self._adapter_latency = link, adapter_latency
        self._calls = Calls()
        self._wire: Wire | None = None
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None
        self._stopping = threading.Event()

    # Life ----------------------------------------------------------------------------------

    def start(self) -> VirtualBus:
        """Make the port and serve it.

        Raises:
            WireError: if the port cannot be put where it was asked for.
            VirtualBusError: if the bus has run before.
        """
        if self._wire is not None:
            raise VirtualBusError("a virtual bus runs once: make another one")
        self._wire = Wire(self._link)
        ready = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(self._wire, ready), name="virtual bus", daemon=True
        )
        self._thread.start()
        ready.wait()
        return self

    def stop(self) -> None:
        """End the thread and take the port away; calling it again is harmless.

        Raises:
            BaseException: what the thread ended with, if it did so by itself.
        """
        if self._thread is None:
            return
        self._stopping.set()
        self._calls.ring()
        self._thread.join(LONGEST_STOP)
        if self._thread.is_alive():
            raise VirtualBusError(f"the bus' physics does not come back, {LONGEST_STOP} s waited")
        self._thread = None
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def __enter__(self) -> VirtualBus:
        """Start, unless it runs already."""
        return self if self.running else self.start()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Stop."""
        self.stop()

    # For its users -------------------------------------------------------------------------

    @property
    def running(self) -> bool:
        """Tell whether the bus serves its port."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def path(self) -> str:
        """Return the path of the port; it stays the same when the port is replugged."""
        if self._wire is None:
            raise VirtualBusError("the virtual bus has no port yet: start it first")
        return self._wire.path

    @property
    def time(self) -> float:
        """Return the bus time up to which devices and body went [s]."""
        return self._time.now

    @property
    def statistics(self) -> WireStatistics:
        """Return what has passed over the wire so far."""
        return self.call(lambda: replace(self._statistics))

    def call(self, action: Callable[[], T]) -> T:
        """Do something between two instructions, and return what it returns.

        While the bus runs, its own thread does it, so nothing else touches devices or body
        meanwhile. Before and after, the caller does.
        """
        return self._calls.call(action)

    def plug(self) -> None:
        """Plug the port in again: a new one, under the old path."""
        wire = self._running_wire()
        self.call(wire.plug)

    def unplug(self) -> None:
        """Pull the port out from under its clients."""
        wire = self._running_wire()
        self.call(wire.unplug)

    def _running_wire(self) -> Wire:
        if self._wire is None or not self.running:
            raise VirtualBusError("the virtual bus has no port: it is not running")
        return self._wire

    # Its thread ----------------------------------------------------------------------------

    def _run(self, wire: Wire, ready: threading.Event) -> None:
        try:
            self._calls.open()
            served = self._make_pace(wire)
            ready.set()
            while not self._stopping.is_set():
                served.serve()
        except BaseException as error:  # stop() raises it
            self._error = error
        finally:
            wire.close()
            self._calls.close()
            ready.set()

    def _make_pace(self, wire: Wire) -> RealTime | LockStep:
        wait, time, exchange = self._calls.wait, self._time, self._exchange
        if self.pace is TimeMode.LOCK_STEP:
            return LockStep(wire, exchange, time, wait)
        return RealTime(wire, exchange, time, wait, adapter_latency=self._adapter_latency)
