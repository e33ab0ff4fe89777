"""Key draft: the motion whose keys are edited, and its earlier states."""

from __future__ import annotations

from collections.abc import Callable

from humanoid_getup.motions.keyframes import Keyframes

MOST_UNDONE = 100
"""Number of states that are kept."""


class KeyDraft:
    """One motion at a time; every change can be undone."""

    def __init__(self) -> None:
        """Begin without a motion."""
        self._states: list[Keyframes] = []
        self.when_changed: list[Callable[[Keyframes], None]] = []
        """Called after every change."""

    @property
    def keyframes(self) -> Keyframes:
        """Return the motion.

        Raises:
            ValueError: if there is none.
        """
        if not self._states:
            raise ValueError("no motion yet, expected one that was opened, or New")
        return self._states[-1]

    def put(self, keyframes: Keyframes) -> None:
        """Replace the motion by another state of it, or by another motion."""
        self._states = [*self._states, keyframes][-MOST_UNDONE:]
        self._tell()

    def undo(self) -> None:
        """Return to the state before.

        Raises:
            ValueError: if there is none.
        """
        if len(self._states) < 2:
            raise ValueError("nothing to undo")
        self._states.pop()
        self._tell()

    def _tell(self) -> None:
        for update in self.when_changed:
            update(self.keyframes)
