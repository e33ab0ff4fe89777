"""Takes pictures of the studio's page for docs/how-to/studio.md.

python tests/support/studio_pictures.py docs/pictures
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from studio_page import OPTIONS, StudioPage, find_chromium, open_studio
from waiting import wait_until

if TYPE_CHECKING:
    from playwright.sync_api import Browser

NECK, SEVENTH = 0, 6  # a curve, and one of its control points
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


def show_keyframes(studio: Any, window: StudioPage) -> None:
    """Show a rise from a squat of two keys, played in physics."""
    window.open_tab("Keyframes")
    window.type("Motion name", "up")
    window.choose("Starts", "squat")
    for height, button in (("75", "New"), ("90", "Add key")):
        window.type("Height [%]", height)
        window.click("Squat")
        window.see(f"A balanced squat at {height[0]}")
        window.click(button)
    window.see("up, squat to standing")
    window.click("Play keys")
    window.see("As it should: stood after")
    window.click("Pause")
    window.type("Time [s]", "0.4")
    _draw(studio)


def show_style(studio: Any, window: StudioPage) -> None:
    """Show a rise that a control point which was dragged down makes later."""
    window.fall("supine")
    window.open_tab("Style")
    tab = studio.tabs["Style"]
    window.choose("Preset", "side-sit")
    window.see("Stands at")
    (client,), seen = studio.server.get_clients().values(), []
    client.camera.on_update(lambda camera: seen.append(camera.position.copy()))
    window.page.get_by_text("Show curves", exact=True).click()
    wait_until(lambda: any(np.allclose(at, tab.board.viewpoint, atol=1e-3) for at in seen))
    before = tab.editor.curves
    spots = tab.board.find_point(NECK, SEVENTH), tab.board.find_spot(NECK, SEVENTH, 0.32)
    window.drag(*(window.find_pixel(client.camera, spot) for spot in spots))
    wait_until(lambda: tab.editor.curves is not before)
    assert tab.rollouts.wait(60.0)
    _draw(studio)


PICTURES: dict[str, Callable[[Any, StudioPage], None]] = {
    "pose": show_pose,
    "plan": show_plan,
    "live": show_live,
    "keyframes": show_keyframes,
    "style": show_style,
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
