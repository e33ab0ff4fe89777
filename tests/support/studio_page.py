"""The studio's page in a headless Chromium, driven as a person drives it."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from waiting import LONGEST_WAIT

from humanoid_getup.experiments.falls import sample_fall_set
from humanoid_getup.simulation.world import World
from robots import Posture, load_robot, quaternion

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Locator, Page

TIMEOUT = 60_000.0  # ms; a wait ends with its event, this only bounds a failure
COARSE = "fixedDpr=0.25"  # pixels of the scene for each of the page, in both directions
WINDOW = {"width": 1400, "height": 900}
# Chromium draws in software where there is no GPU; a sandbox needs rights that containers lack.
OPTIONS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")

DISMISS = """for (const each of document.querySelectorAll("[class*=Notification-closeButton]")) {
    each.click();
}"""


def find_chromium() -> str | None:
    """Find the browser of the system."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)


class StudioPage:
    """One browser window with the studio."""

    def __init__(self, page: Page) -> None:
        self.page = page
        page.set_default_timeout(TIMEOUT)

    def open_tab(self, name: str) -> None:
        self.page.get_by_role("tab", name=name).click()

    def click(self, label: str) -> None:
        self.page.get_by_role("button", name=label, exact=True).click()

    def choose(self, label: str, option: str) -> None:
        self.find_input(label).click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def type(self, label: str, text: str) -> None:
        field = self.find_input(label)
        field.fill(text)
        field.press("Enter")

    def fall(self, side: str) -> None:
        """Pose the robot in a sampled fall of a class."""
        self.choose("Class", side)
        self.click("Random fall")
        self.see(f"A fall that settled {side}")

    def find_input(self, label: str) -> Locator:
        """Find the visible input beside a label."""
        row = self.page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]")
        return row.locator("input:visible").last

    def see(self, text: str) -> None:
        """Wait until a text is visible."""
        self.page.get_by_text(text).first.wait_for()

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag what is at a pixel to another, with the mouse."""
        self.page.mouse.move(*begin)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=8)
        self.page.mouse.up()

    def find_pixel(self, camera: Any, point: Any) -> tuple[float, float]:
        """Find where a point in the world [m], (3,), is seen by the camera of a client."""
        wxyz, seen = camera.wxyz, np.asarray(point) - camera.position
        right, down, ahead = quaternion.rotate(quaternion.inverse(wxyz), seen)
        box = self.page.locator("canvas").first.bounding_box()
        assert box is not None
        scale = 0.5 * box["height"] / math.tan(0.5 * camera.fov) / ahead
        x, y = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
        return x + scale * right, y + scale * down

    def tick(self, label: str) -> None:
        self.find_input(label).click()

    def see_value(self, label: str, text: str) -> None:
        """Wait until the input beside a label has a value."""
        from playwright.sync_api import expect

        expect(self.find_input(label)).to_have_value(text, timeout=TIMEOUT)

    def drag_point(self, server: Any, start: Any, end: Any) -> None:
        """Drag what is drawn at a point of the scene to another one, (3,) [m] each."""
        (client,) = server.get_clients().values()
        client.get_render(height=8, width=8)  # what was added before is drawn now
        pixels = (self.find_pixel(client.camera, point) for point in (start, end))
        self.drag(*pixels)

    def take_picture(self, file: Path) -> None:
        self.page.screenshot(path=str(file))


@contextmanager
def serve_studio(
    browser: Browser, *, coarse: bool = True, **options: Any
) -> Iterator[tuple[Any, StudioPage]]:
    """Serve a studio at a free port; open it in a window, and wait until its elements are there.

    The scene is coarse, without reflections and shadows, unless pictures are taken of it: where
    there is no GPU, they take most of the processor time until a page is shown.
    """
    from humanoid_getup.commands.look.studio import StudioRequest
    from humanoid_getup.studio.studio import Studio

    with Studio(StudioRequest(port=0, **options)) as studio:
        address = studio.address
        if coarse:
            simplify_scene(studio)
            address += f"{'&' if '?' in address else '?'}{COARSE}"
        page = browser.new_page(viewport=WINDOW)  # pyright: ignore[reportArgumentType]
        try:
            page.goto(address)
            shown = StudioPage(page)
            shown.see("Timeline")
            yield studio, shown
        finally:
            page.close()


def simplify_scene(studio: Any) -> None:
    """Leave out reflections and shadows, on this page and on those that replace it."""
    scene = studio.server.scene
    scene.configure_environment_map(None)
    scene.configure_default_lights(cast_shadow=False)
    scene.configure_environment_map = scene.configure_default_lights = lambda *_, **__: None


class SharedStudio:
    """A studio in a window for many tests, each of which gets another page in it."""

    def __init__(self) -> None:
        self._opened: tuple[Any, StudioPage] | None = None
        self._stack, self._count = ExitStack(), 0

    @contextmanager
    def open(self, browser: Browser, **options: Any) -> Iterator[tuple[Any, StudioPage]]:
        """Fill the page; after a test that fails, the next one gets a window of its own."""
        if self._opened is None:
            self._opened = self._stack.enter_context(serve_studio(browser, **options))
        else:
            self._refill(*self._opened, **options)
        try:
            yield self._opened
            self._opened[0].page.rest()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        self._opened = None
        self._stack.close()

    def _refill(self, studio: Any, window: StudioPage, **options: Any) -> None:
        from humanoid_getup.commands.look.studio import StudioRequest

        for job in studio.page.jobs:
            job.wait(LONGEST_WAIT)
        window.page.bring_to_front()
        studio.change(StudioRequest(port=0, **options))
        self._count += 1
        studio.page.say(f"Page {self._count}.")
        window.see(f"Page {self._count}.")
        window.page.evaluate(DISMISS)


SHARED = SharedStudio()


@contextmanager
def open_studio(
    browser: Browser, *, coarse: bool = True, **options: Any
) -> Iterator[tuple[Any, StudioPage]]:
    """Open a page in the window that tests share, or a studio of its own for fine pictures."""
    opening = SHARED.open if coarse else partial(serve_studio, coarse=False)
    with opening(browser, **options) as opened:
        yield opened


def lay_down(studio: Any, side: str) -> None:
    """Pose the robot in a sampled fall of a class."""
    studio.page.pose(_sample_fall(studio.page.request.robot, side))


@cache
def _sample_fall(robot: str, side: str) -> Posture:
    return sample_fall_set(World(load_robot(robot)), {side: 1}, 0).falls[0].posture
