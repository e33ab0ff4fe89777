"""Board switch: shows a board behind the robot, one of all tabs at a time."""

from __future__ import annotations

from collections.abc import Callable

from humanoid_getup.studio.boards.plot_board import PlotBoard
from humanoid_getup.studio.page import Page


class BoardSwitch:
    """A checkbox that shows a board, hides the one that was shown, and turns the camera to it."""

    def __init__(
        self, page: Page, label: str, board: PlotBoard, prepare: Callable[[], None] = lambda: None
    ) -> None:
        """Add it where the caller is adding elements; ``prepare`` is called before it is shown."""
        self._page, self._board, self._prepare = page, board, prepare
        self._box = page.gui.add_checkbox(label, False)
        page.on_change(self._box, self._turn)

    def show(self) -> None:
        """Show the board, behind the posture of the page."""
        self._prepare()
        self._page.hide_board()
        self._page.hide_board = self.hide
        self._box.value = self._board.visible = True
        self._board.place(self._page.start.position)
        self._board.face()

    def hide(self) -> None:
        """Hide the board."""
        self._box.value = self._board.visible = False

    def _turn(self) -> None:
        if not self._box.value:
            return self.hide()
        try:
            return self.show()
        except Exception:
            self.hide()
            raise
