"""Reads a sensor in a thread of its own, for lines on which a transfer waits."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

from drivers.imu.sample import ImuSample
from drivers.imu.source import ImuSource
from drivers.real_time_class import LOOP_PRIORITY, enter_real_time_class

INTERVAL = 0.004  # s between two reads, twice as often as the fastest control cycles


class BackgroundImu(ImuSource):
    """Delivers the newest sample that its thread has read.

    An I2C transfer waits until it is done: 0.7 ms for a sample at 400 kbit/s, and for as long as
    the adapter's timeout if the bus hangs. That must not delay the servos.
    """

    def __init__(self, source: ImuSource) -> None:
        self._source, self.name, self.note = source, source.name, source.note
        self._lock = threading.Lock()
        self._newest: tuple[ImuSample, float] | None = None
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def damaged(self) -> int:
        """Return how many messages were dropped because they were damaged."""
        return self._source.damaged

    def open(self) -> None:
        """Open the sensor, and begin to read it."""
        if self._thread is not None:
            return
        self._source.open()
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name=self.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the reading, and close the sensor."""
        if self._thread is not None:
            self._stopping.set()
            self._thread.join()
            self._thread = None
        self._source.close()
        self._newest = None

    def poll(self) -> ImuSample | None:
        """Return the newest sample with its age."""
        with self._lock:
            newest, self._newest = self._newest, None
        if newest is None:
            return None
        sample, at = newest
        return replace(sample, age=sample.age + time.monotonic() - at)

    def _run(self) -> None:
        enter_real_time_class(LOOP_PRIORITY)  # a sample must not be late where the loop is not
        while not self._stopping.wait(INTERVAL):
            now = time.monotonic()
            self._source.request(now)
            sample = self._source.poll()
            if sample is not None:
                with self._lock:
                    self._newest = sample, now
