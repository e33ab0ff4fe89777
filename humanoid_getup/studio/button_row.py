"""Button row: buttons side by side, each with its callback."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import viser

    from humanoid_getup.studio.page import Page


def add_button_row(page: Page, label: str, actions: dict[str, Callable[[], None]]) -> None:
    """Add buttons where the caller is adding elements, by their labels, in order."""
    answers = {name: page.answer(action) for name, action in actions.items()}

    def run(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        answers[event.target.value](event)

    page.gui.add_button_group(label, tuple(actions)).on_click(run)
