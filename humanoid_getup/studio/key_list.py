"""Key list: the keys of a draft, one of which is chosen, and the buttons that change them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.motion import MAX_DURATION
from humanoid_getup.studio.button_row import add_button_row
from humanoid_getup.studio.edit_keys import LEAST_DURATION, KeyEditor
from humanoid_getup.studio.key_draft import KeyDraft
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.plain_text import escape
from robots.quaternion import Array

if TYPE_CHECKING:
    pass

NO_KEYS: str = "none"
SLOWER = 0.005  # s by which servos stretch a duration that is told


class KeyList:
    """Elements that list, choose, time and change keys."""

    def __init__(
        self, page: Page, draft: KeyDraft, editor: KeyEditor, show: Callable[[int], None]
    ) -> None:
        """Add the elements where the caller is adding them.

        Args:
            page: The page.
            draft: The motion.
            editor: Changes keys.
            show: Shows a key, which is counted from 0, on the stage.
        """
        self._page, self._draft, self._editor, self._show = page, draft, editor, show
        gui = page.gui
        self._state = gui.add_markdown("")
        self._choice = gui.add_dropdown("Key", (NO_KEYS,))
        self._duration = gui.add_number(
            "Duration [s]",
            LEAST_DURATION,
            min=LEAST_DURATION,
            max=MAX_DURATION,
            step=0.01,
            hint="Time from the key before the chosen one.",
        )
        page.on_change(self._choice, self._choose)
        page.on_change(self._duration, self._time)
        page.add_button("Add key", self._add)
        change = {"Replace": self._replace, "Delete": self._delete, "Show": self._choose}
        add_button_row(page, "Chosen key", change)
        move = {"Earlier": lambda: self._swap(-1), "Later": lambda: self._swap(1)}
        add_button_row(page, "Move key", move)
        whole = {"Mirror motion": self._mirror, "Undo": draft.undo}
        add_button_row(page, "Whole motion", whole)
        draft.when_changed.append(self._update)

    @property
    def number(self) -> int:
        """Return the chosen key, counted from 0."""
        return self._choice.options.index(self._choice.value)

    def choose(self, number: int) -> None:
        """Choose a key, without showing it."""
        self._choice.value = self._choice.options[number]
        self._show_duration(self._draft.keyframes)

    def _update(self, keyframes: Keyframes) -> None:
        """List the keys of a changed motion; the chosen place stays."""
        number = min(self.number, len(keyframes.keys) - 1)
        self._choice.options = list_keys(keyframes, self._editor.count(keyframes))
        self._state.content = self._describe(keyframes)
        self.choose(number)

    def _describe(self, keyframes: Keyframes) -> str:
        way = f"{keyframes.start_class} to {keyframes.end_class}"
        lines = [f"**{escape(keyframes.name)}**, {way}, {keyframes.duration.sum():.2f} s"]
        if len(keyframes.keys) > 1:
            took = np.diff(keyframes.times(self._page.world.robot))
            slower = np.flatnonzero(took > keyframes.duration + SLOWER)
            needed = ", ".join(f"{took[k]:.2f} s to key {k + 2}" for k in slower)
            lines += [f"The servos need longer: {needed}."] if needed else []
        return "\n\n".join(lines)

    def _show_duration(self, keyframes: Keyframes) -> None:
        number = self.number
        self._duration.disabled = number == 0
        if number > 0:
            self._duration.value = round(float(keyframes.duration[number - 1]), 3)

    def _choose(self) -> None:
        self._show_duration(self._draft.keyframes)
        self._show(self.number)

    def _time(self) -> None:
        editor, number = self._editor, self.number
        self._draft.put(editor.time(self._draft.keyframes, number, self._duration.value))

    def _add(self) -> None:
        self._draft.put(self._editor.insert(self._draft.keyframes, self.number, self._posed))
        self.choose(min(self.number + 1, self._editor.count(self._draft.keyframes) - 1))

    def _replace(self) -> None:
        self._draft.put(self._editor.put(self._draft.keyframes, self.number, self._posed))

    def _delete(self) -> None:
        self._draft.put(self._editor.delete(self._draft.keyframes, self.number))

    def _swap(self, way: int) -> None:
        number = self.number
        self._draft.put(self._editor.swap(self._draft.keyframes, number, number + way))
        self.choose(number + way)

    def _mirror(self) -> None:
        self._draft.put(self._editor.mirror(self._draft.keyframes))

    @property
    def _posed(self) -> Array:
        return self._page.start.joint_pos


def list_keys(keyframes: Keyframes, count: int) -> list[str]:
    """List the keys of a motion with their times and durations; those after a count are stances."""
    times = np.concatenate([[0.0], np.cumsum(keyframes.duration)])
    names = [f"{number}" if number <= count else "stand" for number in range(1, len(times) + 1)]
    after = ["", *(f" (+{duration:.2f})" for duration in keyframes.duration)]
    return [f"{name}: {t:.2f} s{d}" for name, t, d in zip(names, times, after, strict=True)]
