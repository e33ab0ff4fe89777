"""Takes pictures of the studio's page for docs/how-to/studio.md.

python tests/support/studio_pictures.py docs/pictures
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio_page import OPTIONS, StudioPage, find_chromium, open_studio

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SCRUBBED = "2.62"  # s, at which the arms push


def main(folder: Path) -> None:
    """Take all pictures."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=find_chromium(), args=list(OPTIONS))
        for name, show in PICTURES.items():
            _take(browser, show, folder / f"studio_{name}.png")


def show_pose(studio: Any, window: StudioPage) -> None:
    """Show a robot that was dragged by its hand."""
    window.fall("supine")
    window.choose("Drag", "left_arm")
    _draw(studio)


def show_plan(studio: Any, window: StudioPage) -> None:
    """Show a planned rise while it pushes itself up."""
    window.type("Seed", "2")
    window.fall("prone")
    window.open_tab("Plan")
    window.click("Plan")
    window.see("stands after")
    window.click("Pause")
    window.type("Time [s]", SCRUBBED)
    take = studio.timeline.take
    row = take.find(float(SCRUBBED))
    studio.timeline.wait_for(lambda: (studio.timeline.picture.qpos == take.qpos[row]).all(), 60.0)
    _draw(studio)


def show_live(studio: Any, window: StudioPage) -> None:
    """Show the numbers of a limp robot."""
    window.fall("left")
    window.open_tab("Live")
    window.click("Read")
    window.see("torso on its left side")
    _draw(studio)


PICTURES: dict[str, Callable[[Any, StudioPage], None]] = {
    "pose": show_pose,
    "plan": show_plan,
    "live": show_live,
}


def _take(browser: Browser, show: Callable[[Any, StudioPage], None], file: Path) -> None:
    with open_studio(browser, folder=(file.parent,)) as (studio, window):
        window.page.locator("button.mantine-Notification-closeButton").first.click()
        show(studio, window)
        window.take_picture(file)


def _draw(studio: Any) -> None:
    """Wait until the browser has drawn what was sent."""
    (client,) = studio.server.get_clients().values()
    for _ in range(3):
        client.get_render(height=8, width=8)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
