"""Picture tab: saves what a browser shows, as a picture, or as a video of the take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.progress.callback import Cancel, ProgressMonitor
from humanoid_getup.reporting.video import find_rate, write_video
from humanoid_getup.studio.page import PLAIN
from robots.storage.files import atomic_path

if TYPE_CHECKING:
    import viser

    from humanoid_getup.studio.page import Page
    from humanoid_getup.studio.takes import Take

MOST_PIXELS = 1280  # in a row
TIMEOUT = 30.0  # s for a browser to draw a picture
FORMATS = ("mp4", "gif")
LONGEST = 60.0  # s; a GIF is kept in memory until it is written


@dataclass(frozen=True, kw_only=True, eq=False)
class Filming:
    """A video to make."""

    camera: Camera
    take: Take
    path: Path


class PictureTab:
    """Elements that save pictures and videos, as seen by the browser in which they are pressed."""

    def __init__(self, page: Page) -> None:
        self._page, self._tab, gui = page, page.speaker, page.gui
        self._file = gui.add_text("File name", "studio", hint="without .png, .mp4 or .gif")
        gui.add_button("Save picture").on_click(self._answer(self._save_picture))
        self._format = gui.add_dropdown("Video as", FORMATS)
        gui.add_button("Save video", color=PLAIN).on_click(self._answer(self._begin_video))
        busy = "a video is being drawn, expected its end"
        self._job = page.add_job(self._film, self._tell_video, apart=False, busy=busy)
        page.add_button("Cancel", self._job.cancel)

    def _answer(self, work: Callable[[Camera], None]) -> Callable[[Any], None]:
        """Make a callback that knows which browser it came from."""

        def run(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            client = event.client
            if client is not None:
                self._page.answer(lambda: work(Camera(client)), self._tab)(event)

        return run

    def _resolve(self, suffix: str) -> Path:
        """Return the path of a file that is named without its suffix."""
        name = self._file.value.strip()
        if not Path(name).name or name.endswith("/"):
            raise BadInputError("the file has no name, expected one")
        return self._page.folders.resolve(f"{name.removesuffix(f'.{suffix}')}.{suffix}")

    def _tell_video(self, filming: Filming, _: None) -> None:
        self._tell(filming.path)

    def _tell(self, path: Path) -> None:
        self._page.say(f"Saved {self._page.folders.name(path)}.")

    def _save_picture(self, camera: Camera) -> None:
        path = self._resolve("png")
        picture = Image.fromarray(camera.draw())
        with atomic_path(path) as partial:
            picture.save(partial, "PNG")
        self._tell(path)

    # Video ------------------------------------------------------------------------------------

    def _begin_video(self, camera: Camera) -> None:
        take, suffix = self._page.timeline.take, self._format.value
        if take is None:
            raise BadInputError(
                "nothing is on the timeline, expected a rise, a rollout or a flight"
            )
        if take.duration > LONGEST:
            raise BadInputError(
                f"'{take.name}' lasts {take.duration:.0f} s, expected at most {LONGEST:.0f} s"
            )
        if suffix not in FORMATS:
            raise BadInputError(f"video as {suffix}: expected {' or '.join(FORMATS)}")
        self._job.ask(Filming(camera=camera, take=take, path=self._resolve(suffix)))

    def _film(self, filming: Filming, cancel: Cancel) -> None:
        """Scrub through the take, and let the browser draw each picture."""
        rate = find_rate(filming.path)
        pictures = self._draw(filming, rate, ProgressMonitor(cancel=cancel))
        write_video(pictures, rate, filming.path)

    def _draw(self, filming: Filming, rate: int, monitor: ProgressMonitor) -> Iterator[np.ndarray]:
        timeline, take = self._page.timeline, filming.take
        times = np.arange(0.0, take.duration + 0.5 / rate, 1.0 / rate)
        for number, time in enumerate(times, start=1):
            monitor.check()
            self._page.say(f"Draws picture {number} of {len(times)} …", self._tab)
            drawn = timeline.pictures
            timeline.scrub(min(float(time), take.duration))
            if not timeline.wait_for(lambda drawn=drawn: timeline.pictures > drawn, TIMEOUT):
                raise BadInputError("the page does not draw, so no video was saved")
            if timeline.take is not take:
                raise BadInputError("the timeline shows something else now, so no video was saved")
            self._page.server.flush()
            yield filming.camera.draw()


class Camera:
    """What a browser sees, in pictures of one size."""

    def __init__(self, client: viser.ClientHandle) -> None:
        """Take over the size of its window."""
        self._client = client
        width, height = client.camera.image_width, client.camera.image_height
        scale = min(1.0, MOST_PIXELS / max(width, 1))
        self._height, self._width = (max(2, 2 * round(0.5 * scale * s)) for s in (height, width))

    def draw(self) -> np.ndarray:
        """Let the browser draw the scene as it shows it, (height, width, 3), both even."""
        return self._client.get_render(self._height, self._width, timeout=TIMEOUT)
