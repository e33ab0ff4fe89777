"""A thread that serves a queue of calls and the lines beside it, as that of a bus does."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from drivers.virtual_bus.serving.server import CallQueue
from drivers.virtual_bus.serving.side_lines import SideLine


class Serving:
    """A thread that waits on a queue until it is ended."""

    def __init__(self, queue: CallQueue) -> None:
        self.queue, self.ending = queue, False
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.ready = threading.Event()
        self.thread.start()
        self.ready.wait()

    def _run(self) -> None:
        self.queue.open()
        self.ready.set()
        while not self.ending:
            self.queue.wait(-1, 60.0)
        self.queue.close()

    def end(self) -> None:
        self.ending = True
        self.queue.ring()
        self.thread.join()


@contextmanager
def serving_line(line: SideLine) -> Iterator[CallQueue]:
    """Serve a line inside the block, then close it."""
    queue = CallQueue()
    queue.lines.append(line)
    serving = Serving(queue)
    try:
        yield queue
    finally:
        serving.end()
        line.close()
