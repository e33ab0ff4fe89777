"""Workspace: what is on the page for one robot in one scene."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanoid_getup.scenes.named_scenes import SUFFIX, list_scenes
from humanoid_getup.studio.folders import containing
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.stage import Stage
from humanoid_getup.studio.tabs.discover_tab import DiscoverTab
from humanoid_getup.studio.tabs.flight_tab import FlightTab
from humanoid_getup.studio.tabs.keyframe_tab import KeyframeTab
from humanoid_getup.studio.tabs.picture_tab import PictureTab
from humanoid_getup.studio.tabs.plan_tab import PlanTab
from humanoid_getup.studio.tabs.pose_tab import PoseTab
from humanoid_getup.studio.tabs.style_tab import StyleTab
from humanoid_getup.studio.timeline import Timeline
from robots import list_robots

if TYPE_CHECKING:
    import viser

    from humanoid_getup.commands.look.studio import StudioRequest
    from humanoid_getup.simulation.world import World
    from humanoid_getup.studio.folders import Folders

ROBOT_FILE = "robot.toml"
SCENE_KEYS = re.compile(rb"^\[*(ground|boxes|capsules|spheres|starts)\b", re.MULTILINE)
"""One of them is in every scene file that is not level ground."""
GROUND = "Of rough ground: one seed gives the same ground again."
BODY = "Factors on the lengths of shoulders, arms, torso or legs, such as arms=1.6,torso=2.2."
CAMERA = (1.9, -1.6, 1.1)  # standing neck heights from the robot
WIDTH = 430  # pixels, for the names of all tabs
TIMEOUT = 12.0  # s for jobs to release a robot and to end
TABS: dict[str, Callable[[Page], object]] = {
    "Pose": PoseTab,
    "Keyframes": KeyframeTab,
    "Plan": PlanTab,
    "Discover": DiscoverTab,
    "Style": StyleTab,
    "Flight": FlightTab,
}


class SetupFolder:
    """Elements that choose robot, body and scene; a change empties the page."""

    def __init__(self, page: Page, change: Callable[[StudioRequest], None]) -> None:
        self._page, self._change = page, change
        given, gui, folders = page.request, page.gui, page.folders
        robots = _unite(given.robot, [*list_robots(), *find_robots(folders)])
        files = folders.list_files(SUFFIX, containing(SCENE_KEYS))
        scenes = _unite(given.scene, [*(scene.name for scene in list_scenes()), *files])
        title = f"{page.world.robot.name}, {page.world.scene.name}"
        with gui.add_folder(title, expand_by_default=False):
            self._robot = gui.add_dropdown("Robot", robots, initial_value=given.robot)
            self._body = gui.add_text("Body", given.body, hint=BODY)
            self._scene = gui.add_dropdown("Scene", scenes, initial_value=given.scene)
            self._ground = gui.add_number("Ground seed", given.seed, min=0, step=1, hint=GROUND)
            page.add_button("Open", self._open, main=True)

    def _open(self) -> None:
        given, robot, scene = self._page.request, self._robot.value, self._scene.value
        if robot not in (given.robot, *list_robots()):
            robot = str(self._page.folders.resolve(robot))
        if scene != given.scene and scene.endswith(SUFFIX):
            scene = str(self._page.folders.resolve(scene))
        seed = int(self._ground.value)
        self._page.say(f"Opens {self._robot.value} …")
        changed = replace(given, robot=robot, body=self._body.value, scene=scene, seed=seed)
        self._change(changed)


def find_robots(folders: Folders) -> list[str]:
    """Find the robot folders within the folders of a page, by names that these resolve.

    No name is one of a robot that comes with the package.
    """
    files = folders.list_files(".toml", lambda path: path.name == ROBOT_FILE)
    names = [str(Path(file).parent) for file in files]
    return [f"./{name}" if name in (".", *list_robots()) else name for name in names]


def _unite(first: str, others: list[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*others, first]))


class Workspace:
    """Timeline, tabs and stage."""

    def __init__(
        self,
        request: StudioRequest,
        server: viser.ViserServer,
        world: World,
        scratch: Path,
        change: Callable[[StudioRequest], None],
    ) -> None:
        """Fill an empty page; ``change`` shows another robot or scene."""
        _aim_camera(server, world.robot.standing_neck_height)
        self.timeline = Timeline(server, Stage(server, world))
        self.page = Page(request, server, world, self.timeline, scratch)
        with self.timeline.panel.add_tab("Picture"), self._speaking("Picture"):
            PictureTab(self.page)
        SetupFolder(self.page, change)
        tabs = server.gui.add_tab_group()
        self.tabs: dict[str, Any] = {}
        """What was made of `TABS`."""
        for name, tab in TABS.items():
            with tabs.add_tab(name), self._speaking(name):
                self.tabs[name] = tab(self.page)
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(WIDTH)

    @contextmanager
    def _speaking(self, name: str) -> Iterator[None]:
        """Let the elements that are added meanwhile speak in the name of a tab."""
        self.page.tab = name
        yield
        self.page.tab = ""

    def close(self) -> None:
        """Cancel all jobs, and stop to draw."""
        self.page.close()
        for job in self.page.jobs:
            job.wait(TIMEOUT)
        self.timeline.close()


def _aim_camera(server: viser.ViserServer, height: float) -> None:
    """Let every browser look at a robot of a standing neck height [m]."""
    position = (CAMERA[0] * height, CAMERA[1] * height, CAMERA[2] * height)
    aim = (0.0, 0.0, 0.3 * height)
    server.initial_camera.position, server.initial_camera.look_at = position, aim
    for client in server.get_clients().values():
        client.camera.position, client.camera.look_at = position, aim
