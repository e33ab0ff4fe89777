"""Of the boards of all tabs one is shown at a time."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

viser = pytest.importorskip("viser", reason="needs the studio extra")

from humanoid_getup.studio.boards.plot_board import BoardSwitch, PlotBoard


@pytest.fixture
def server() -> Iterator[Any]:
    served = viser.ViserServer(port=0, verbose=False)
    yield served
    served.stop()


def make_page(server: Any) -> Any:
    start = SimpleNamespace(position=np.array([1.0, 2.0, 0.3]))
    page = SimpleNamespace(gui=server.gui, start=start, on_change=lambda *_: None)
    page.hide_board = lambda: None
    return page


def test_a_board_that_is_shown_hides_the_other_one_unless_it_cannot_be_drawn(server: Any):
    page = make_page(server)
    first, second = (PlotBoard(server, name, 0.5) for name in ("/first", "/second"))
    switches = [BoardSwitch(page, "Show", board) for board in (first, second)]
    assert not first.visible
    for k, shown in ((0, (True, False)), (1, (False, True)), (1, (False, True))):
        switches[k].show()
        assert (first.visible, second.visible) == shown
    switches[1].hide()
    assert (first.visible, second.visible) == (False, False)

    def refuse() -> None:
        raise ValueError("nothing to draw")

    switches[0].show()
    with pytest.raises(ValueError, match="nothing to draw"):
        BoardSwitch(page, "Show", second, refuse).show()
    assert (first.visible, second.visible) == (True, False)
