from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image, ImageSequence
from studio_page import open_studio

from humanoid_getup.studio.takes import Take

if TYPE_CHECKING:
    from playwright.sync_api import Browser

RISE = 0.4  # m
DURATION = 0.4  # s


def lift_robot(studio: Any) -> Take:
    """Make a take in which the standing robot rises through the air at a steady speed."""
    time = np.linspace(0.0, DURATION, 41)
    qpos = np.tile(studio.page.timeline.picture.qpos, (len(time), 1))
    qpos[:, 2] += RISE * time / DURATION
    return Take(name="lift", time=time, qpos=qpos)


def find_row(picture: Any) -> float:
    """Find the mean row of the colored pixels, those of the limbs."""
    rgb = np.asarray(picture.convert("RGB"), float)
    colored = np.ptp(rgb, axis=2) > 60.0
    return float(np.nonzero(colored)[0].mean())


@pytest.mark.slow
def test_a_video_shows_every_time_of_the_take_in_its_place(browser: "Browser", tmp_path: Path):
    with open_studio(browser, coarse=False, folder=(tmp_path,)) as (studio, window):
        studio.page.timeline.load(lift_robot(studio), play=False)
        window.see("lift")
        window.open_tab("Picture")
        window.choose("Video as", "gif")
        window.click("Save video")
        window.see("Saved studio.gif")
    with Image.open(tmp_path / "studio.gif") as video:
        rows = [find_row(frame) for frame in ImageSequence.Iterator(video)]
        assert video.info["duration"] == 50  # ms
    steps = -np.diff(rows)  # up
    assert len(rows) == 9
    assert (steps > 0.7 * steps.mean()).all()


@pytest.mark.slow
def test_a_picture_shows_the_robot_and_not_the_panels(browser: "Browser", tmp_path: Path):
    with open_studio(browser, coarse=False, folder=(tmp_path,)) as (_, window):
        window.open_tab("Picture")
        window.type("File name", "robot")
        window.click("Save picture")
        window.see("Saved robot.png")
        with Image.open(tmp_path / "robot.png") as picture:
            width, height = picture.size
            assert abs(find_row(picture) - height / 2) < 0.2 * height
        box = window.page.locator("canvas").first.bounding_box()
    assert box is not None
    assert width <= box["width"] + 1


def test_pictures_are_saved_in_the_folders_and_no_video_of_a_take_that_was_replaced(
    browser: "Browser", tmp_path: Path
):
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.open_tab("Picture")
        window.click("Save video")
        window.see("nothing is on the timeline")
        window.type("File name", "../outside")
        window.click("Save picture")
        window.see("expected a file in")
        window.type("File name", "robot")
        window.click("Save picture")
        window.see("Saved robot.png")
        studio.page.timeline.load(lift_robot(studio), play=False)
        window.click("Save video")
        window.see("Draws picture")
        window.click("Save video")
        window.see("a video is being drawn, expected its end, or Cancel first")
        studio.page.timeline.load(lift_robot(studio), play=False)
        window.see("the timeline shows something else now")
    assert [file.name for file in tmp_path.iterdir()] == ["robot.png"]
    assert not (tmp_path.parent / "outside.png").exists()
