"""Recorder: saves what a browser shows, as a picture, or as a video of the take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from humanoid_getup.progress.callback import Cancel, ProgressMonitor
from humanoid_getup.reporting.video import find_rate, write_video
from robots.storage.files import atomic_path

if TYPE_CHECKING:
    import viser

    from humanoid_getup.studio.page import Page

MOST_PIXELS = 1280  # in a row
PATIENCE = 30.0  # s for a browser to draw a picture
SUFFIXES = ("mp4", "gif")


@dataclass(frozen=True, kw_only=True, eq=False)
class Filming:
    """A video to make."""

    client: viser.ClientHandle
    """Browser that draws it."""
    path: Path


class Recorder:
    """Elements that save pictures and videos, as seen by the browser in which they are pressed."""

    def __init__(self, page: Page) -> None:
        """Add the elements where the caller is adding them."""
        self._page, gui = page, page.gui
        self._file = gui.add_text("File name", "studio")
        gui.add_button("Save picture").on_click(self._answer(self._save_picture))
        self._format = gui.add_dropdown("Video as", SUFFIXES)
        gui.add_button("Save video").on_click(self._answer(self._begin_video))
        gui.add_button("Cancel").on_click(page.answer(self._cancel))
        self._job = page.run_latest(self._film, self._tell)

    def _answer(self, work: Callable[[viser.ClientHandle], None]) -> Callable[[Any], None]:
        """Make a callback that knows which browser it came from."""

        def run(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            client = event.client
            if client is not None:
                self._page.answer(lambda: work(client))(event)

        return run

    def _resolve(self, suffix: str) -> Path:
        return self._page.folders.resolve(f"{self._file.value.strip()}.{suffix}")

    def _tell(self, path: Path) -> None:
        self._page.say(f"Saved {self._page.folders.name(path)}.")

    def _save_picture(self, client: viser.ClientHandle) -> None:
        path = self._resolve("png")
        picture = Image.fromarray(_render(client))
        with atomic_path(path) as partial:
            picture.save(partial, "PNG")
        self._tell(path)

    # Video ------------------------------------------------------------------------------------

    def _begin_video(self, client: viser.ClientHandle) -> None:
        if self._page.timeline.take is None:
            raise ValueError("nothing is on the timeline, expected a rise, a rollout or a flight")
        self._job.ask(Filming(client=client, path=self._resolve(self._format.value)))

    def _cancel(self) -> None:
        self._job.cancel()
        self._page.say("Cancelled.")

    def _film(self, filming: Filming, cancel: Cancel) -> Path:
        """Scrub through the take, and let the browser draw each picture."""
        rate = find_rate(filming.path)
        write_video(self._draw(filming, rate, ProgressMonitor(cancel=cancel)), rate, filming.path)
        return filming.path

    def _draw(self, filming: Filming, rate: int, monitor: ProgressMonitor) -> Iterator[np.ndarray]:
        timeline, take = self._page.timeline, self._page.timeline.take
        assert take is not None
        times = np.arange(0.0, take.duration + 0.5 / rate, 1.0 / rate)
        for number, time in enumerate(times, start=1):
            monitor.check()
            self._page.say(f"Draws picture {number} of {len(times)} …")
            drawn = timeline.pictures
            timeline.scrub(min(float(time), take.duration))
            timeline.wait_for(lambda drawn=drawn: timeline.pictures > drawn, PATIENCE)
            self._page.server.flush()
            yield _render(filming.client)


def _render(client: viser.ClientHandle) -> np.ndarray:
    """Let a browser draw the scene as it shows it, (height, width, 3), both even."""
    width, height = client.camera.image_width, client.camera.image_height
    scale = min(1.0, MOST_PIXELS / max(width, 1))
    size = [max(2, 2 * round(0.5 * scale * side)) for side in (height, width)]
    return client.get_render(*size, timeout=PATIENCE)
