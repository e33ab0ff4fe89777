from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from studio_page import StudioPage, lay_down, open_studio
from waiting import LONGEST_WAIT, wait_until

pytest.importorskip("viser", reason="needs the studio extra")

from humanoid_getup.studio.tabs.style_tab import StyleTab
from humanoid_getup.studio.takes import Take
from humanoid_getup.style.style import load_style, write_style
from humanoid_getup.style.style_editor import find_rise
from robots import load_robot

if TYPE_CHECKING:
    from playwright.sync_api import Browser

NECK, SEVENTH, LAST = 0, 6, 8
LATER = 0.1  # s that a rise is later at least


class StyleDesk:
    """The Style tab of a studio in a window, for a robot that lies supine."""

    def __init__(self, studio: Any, window: StudioPage) -> None:
        self.studio, self.window = studio, window
        self.tab: StyleTab = studio.page.tabs["Style"]
        lay_down(studio, "supine")
        window.open_tab("Style")

    @contextmanager
    def rolling(self) -> Iterator[None]:
        """Wait until what is done has led to another take."""
        before = self.studio.page.timeline.take
        yield
        wait_until(lambda: self.studio.page.timeline.take is not before)

    @property
    def rise_time(self) -> float:
        """When the neck passes its middle height in the take [s]."""
        take: Take = self.studio.page.timeline.take
        return find_rise(take.time, take.plots[NECK].curves["followed"])

    def choose(self, style: str) -> None:
        with self.rolling():
            self.window.choose("Preset", style)

    def show_curves(self) -> None:
        """Show the board, and wait until the browser looks at it."""
        (client,), seen = self.studio.server.get_clients().values(), []
        client.camera.on_update(lambda camera: seen.append(camera.position.copy()))
        self.window.page.get_by_text("Show curves", exact=True).click()
        wait_until(lambda: any(np.allclose(at, self.tab.board.viewpoint, atol=1e-3) for at in seen))

    def drag_point(self, feature: int, point: int, value: float) -> None:
        """Drag a control point to a value with the mouse."""
        (client,) = self.studio.server.get_clients().values()
        board = self.tab.board
        spots = board.find_point(feature, point), board.find_spot(feature, point, value)
        self.window.drag(*(self.window.find_pixel(client.camera, spot) for spot in spots))

    def save(self, name: str) -> None:
        self.window.type("File", name)
        self.window.click("Save style")
        self.window.see(f"Saved {name}.")


@contextmanager
def open_desk(browser: "Browser", folder: Path) -> Iterator[StyleDesk]:
    with open_studio(browser, folder=(folder,)) as (studio, window):
        yield StyleDesk(studio, window)


def test_a_control_point_that_is_dragged_down_lets_the_robot_rise_later(
    browser: "Browser", tmp_path: Path
):
    with open_desk(browser, tmp_path) as desk:
        desk.choose("side-sit")
        desk.window.see("Stands at")
        sooner = desk.rise_time
        desk.show_curves()
        before = desk.tab.editor.curves
        desk.drag_point(NECK, SEVENTH, 0.32)
        wait_until(lambda: desk.tab.editor.curves is not before)
        wait_until(lambda: desk.rise_time > sooner + LATER)
        assert desk.tab.rollouts.wait(LONGEST_WAIT)
        dragged = desk.rise_time
        desk.save("dragged.toml")
        after = load_style(tmp_path / "dragged.toml", load_robot("op3")).curves[0]
        moved = np.argwhere(np.abs(after.points - before.points) > 1e-3)
        assert moved.tolist() == [[SEVENTH, NECK]]
        assert after.points[SEVENTH, NECK] == pytest.approx(0.32, abs=0.03)
        desk.window.take_picture(tmp_path / "style.png")
        with desk.rolling():
            desk.window.click("Undo")
        undone = round(float(before.points[SEVENTH, NECK]), 3)
        field = desk.window.find_input("Value")
        wait_until(lambda: float(field.input_value()) == undone)  # before it is typed over
        with desk.rolling():
            typed = round(float(after.points[SEVENTH, NECK]), 3)
            desk.window.type("Value", str(typed))
            wait_until(lambda: desk.tab.value.value == typed)
            desk.window.click("Set")
        assert desk.rise_time == pytest.approx(dragged, abs=0.02)


def test_a_curve_that_ends_below_a_stand_springs_back(browser: "Browser", tmp_path: Path):
    with open_desk(browser, tmp_path) as desk:
        desk.show_curves()
        before, board = desk.tab.editor.style, desk.tab.board
        spot = board.find_point(NECK, LAST)
        desk.drag_point(NECK, LAST, 0.5)
        desk.window.see("a rise ends in a stand")
        np.testing.assert_allclose(board.find_point(NECK, LAST), spot)
        assert desk.tab.editor.style is before


def test_the_first_run_takes_a_fall_that_suits_the_preset_and_stands(
    browser: "Browser", tmp_path: Path
):
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.open_tab("Style")
        window.click("Run")
        window.see("Stands at")
        assert studio.page.tabs["Style"].editor.style.name == "long-sit"


def test_a_saved_style_is_the_same_when_it_is_loaded_again(browser: "Browser", tmp_path: Path):
    with open_desk(browser, tmp_path) as desk:
        with desk.rolling():
            desk.window.click("Later")
        with desk.rolling():
            desk.window.click("Slower")
        desk.save("mine.toml")
        desk.choose("side-sit")
        desk.choose("mine.toml")
        desk.save("again.toml")
        first, again = ((tmp_path / name).read_text() for name in ("mine.toml", "again.toml"))
        assert first == again
        desk.window.click("Copy as command")
        desk.window.see("getup run styled")
        assert (tmp_path / "again-start.json").exists()


def test_curves_are_taken_from_a_motion_and_a_file_elsewhere_is_not_written(
    browser: "Browser", tmp_path: Path
):
    with open_desk(browser, tmp_path) as desk:
        with desk.rolling():
            desk.window.choose("Source", "supine_sit_up_fast")
            desk.window.click("Take curves")
        desk.window.see("supine_sit_up_fast")
        desk.window.type("File", "../outside.toml")
        desk.window.click("Save style")
        desk.window.see(f"expected a file in {tmp_path}")
        assert not (tmp_path.parent / "outside.toml").exists()


def test_a_robot_that_stands_or_has_no_such_policy_is_told_in_a_line(
    browser: "Browser", tmp_path: Path
):
    with open_studio(browser, folder=(tmp_path,)) as (_, window):
        window.open_tab("Style")
        window.click("Run")
        window.see("The start stands")
    with open_studio(browser, folder=(tmp_path,), robot="wolfgang") as (_, window):
        window.open_tab("Style")
        window.see("No policy of robot 'wolfgang' follows styles")


def test_files_of_other_things_are_no_styles(browser: "Browser", tmp_path: Path):
    robot = load_robot("op3")
    write_style(load_style("push-up", robot), robot, tmp_path / "mine.toml")
    (tmp_path / "scene.toml").write_text('about = "a scene"\n')
    with open_studio(browser, folder=(tmp_path,)) as (_, window):
        window.open_tab("Style")
        window.find_input("Preset").click()
        options = window.page.get_by_role("option").all_inner_texts()
    assert options == ["long-sit", "push-up", "side-sit", "sit-up", "half-kneel", "mine.toml"]
