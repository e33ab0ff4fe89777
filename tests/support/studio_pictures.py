"""Takes pictures of the studio's page for docs/how-to/studio.md.

python tests/support/studio_pictures.py docs/pictures
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from flight_recording import record_swing, twin_of
from searched_robot import copy_bare_robot, search_a_little, store
from studio_page import OPTIONS, StudioPage, find_chromium, open_studio
from waiting import wait_until

from drivers import Cycle
from humanoid_getup.motions.motion_database import find_motion
from humanoid_getup.simulation.world import World
from humanoid_getup.studio.boards.state_board import WAY_UP, read_search_map
from robots import load_robot

if TYPE_CHECKING:
    from playwright.sync_api import Browser

NECK, SEVENTH = 0, 6  # a curve, and one of its control points
SCRUBBED = "2.62"  # s, at which the arms push


def main(folder: Path, names: Sequence[str] = ()) -> None:
    """Take all pictures, or those named."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play, TemporaryDirectory() as made:
        browser = play.chromium.launch(executable_path=find_chromium(), args=list(OPTIONS))
        for name in names or PICTURES:
            place = Path(made) / name
            place.mkdir()
            _take(browser, PICTURES[name], folder / f"studio_{name}.png", place)


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


def record_flight(place: Path) -> dict[str, Any]:
    """Record a flight whose left knee turned further than its twin's."""
    robot = load_robot("op3")
    off = 0.2 * (np.arange(robot.n) == robot.joint_names.index("l_knee"))

    def bend(cycle: Cycle) -> Cycle:
        angles = cycle.state.joint_pos + off * (cycle.state.time > 0.4)
        return replace(cycle, state=replace(cycle.state, joint_pos=angles))

    events = ("phase", "over"), ("ended", "attempt 1: its neck came to 0.3")
    twin = twin_of(robot)
    record_swing(place / "op3.mcap", robot, twin, robot.standing, bend, events=events)
    return {"folder": (place,)}


def show_flight(studio: Any, window: StudioPage) -> None:
    """Show a flight where its knee has left the twin."""
    window.open_tab("Flight")
    window.choose("Log", "op3.mcap")
    window.click("Open")
    window.see("diverged: joint")
    window.type("Time [s]", "0.6")
    _draw(studio)


def search_motions(place: Path) -> dict[str, Any]:
    """Search motions for a robot that has none, and keep one that it finds."""
    op3 = load_robot("op3")
    bare = load_robot(copy_bare_robot(op3, place))
    store(search_a_little(World(bare)))
    (bare.folder / "motions").mkdir()
    found = replace(find_motion(op3, "supine_sit_up_fast"), name="supine_found_1")
    found.save(bare.folder / "motions" / "supine_found_1.npz")
    return {"robot": str(bare.folder), "folder": (place,)}


def show_discover(studio: Any, window: StudioPage) -> None:
    """Show the map of a search, and the state of it that is highest."""
    window.open_tab("Discover")
    window.see("A search is stored")
    window.tick("Show map")
    window.see("states (supine")
    known = read_search_map(World(load_robot(studio.page.world.robot.folder)))
    assert known is not None
    state = max((s for s in known.states if s.side != WAY_UP and s.moves), key=lambda s: s.neck[-1])
    _draw(studio)
    (client,) = studio.server.get_clients().values()
    spot = studio.tabs["Discover"].board.find_spot(state)
    window.page.mouse.click(*window.find_pixel(client.camera, spot))
    window.see("neck at ")
    _draw(studio)


@dataclass(frozen=True)
class Picture:
    """A picture: what is shown, and what is prepared for it."""

    show: Callable[[Any, StudioPage], None]
    prepare: Callable[[Path], dict[str, Any]] = lambda place: {"folder": (place,)}
    """Fills a folder; returns the options of the studio."""


PICTURES = {
    "pose": Picture(show_pose),
    "plan": Picture(show_plan),
    "keyframes": Picture(show_keyframes),
    "style": Picture(show_style),
    "flight": Picture(show_flight, record_flight),
    "discover": Picture(show_discover, search_motions),
}


def _take(browser: Browser, picture: Picture, file: Path, place: Path) -> None:
    with open_studio(browser, coarse=False, **picture.prepare(place)) as (studio, window):
        window.page.locator("button.mantine-Notification-closeButton").first.click()
        picture.show(studio, window)
        window.take_picture(file)


def _draw(studio: Any) -> None:
    """Wait until the browser has drawn what was sent."""
    (client,) = studio.server.get_clients().values()
    for _ in range(3):
        client.get_render(height=8, width=8)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
