"""Saved arrays: the state of an object in a training that is saved and resumed."""

from __future__ import annotations

from typing import Any, ClassVar

SavedState = dict[str, Any]
"""State of an object by the names of its parts: arrays, numbers and states within it."""


class SavedArrays:
    """An object whose state is in some of its arrays."""

    saved: ClassVar[tuple[str, ...]]
    """Attributes that hold the state."""

    def save_state(self) -> SavedState:
        """Return a copy of the state, for :meth:`restore_state`."""
        return {name: getattr(self, name).copy() for name in self.saved}

    def restore_state(self, state: SavedState) -> None:
        """Restore a state of :meth:`save_state`."""
        for name in self.saved:
            setattr(self, name, state[name].copy())
