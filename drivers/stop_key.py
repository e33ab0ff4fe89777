"""Stop key: any key of the terminal, reported from a thread of its own."""

from __future__ import annotations

from collections.abc import Callable

from drivers.terminal_keys import TerminalKeys

PRESSED = "the operator pressed a key"
LOST = "the terminal is gone"


class StopKey(TerminalKeys):
    """Watches a terminal for any key, inside a ``with`` block.

    Without a terminal there is no stop key; signals still stop the program.
    """

    def __init__(self, stop: Callable[[str], None], terminal: int | None = None) -> None:
        """Prepare to watch a terminal, by file descriptor; ``None`` for standard input.

        ``stop`` is called at every key, with the reason, from the watching thread.
        """
        super().__init__(lambda sent: stop(PRESSED if sent else LOST), terminal)
