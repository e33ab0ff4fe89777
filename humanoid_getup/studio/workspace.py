"""Workspace: fills the page for one robot in one scene."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from humanoid_getup.scenes.named_scenes import SUFFIX, list_scenes
from humanoid_getup.studio.folders import containing
from humanoid_getup.studio.form import Form
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.stage import Stage
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
CAMERA = (1.9, -1.6, 1.1)  # standing neck heights from the robot
WIDTH = 430  # pixels, for the names of all tabs
TABS: dict[str, Callable[[Page], object]] = {
    "Pose": PoseTab,
    "Keyframes": KeyframeTab,
    "Plan": PlanTab,
    "Style": StyleTab,
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
            self._scene = gui.add_dropdown("Scene", scenes, initial_value=given.scene)
            shown = {"body": given.body, "seed": given.seed}
            self._form = Form(gui, type(given), {"body": "Body", "seed": "Ground seed"}, **shown)
            page.add_button("Open", self._open, main=True)

    def _open(self) -> None:
        given, robot, scene = self._page.request, self._robot.value, self._scene.value
        if robot not in (given.robot, *list_robots()):
            robot = str(self._page.folders.resolve(robot))
        if scene != given.scene and scene.endswith(SUFFIX):
            scene = str(self._page.folders.resolve(scene))
        self._page.say(f"Opens {self._robot.value} …")
        self._change(replace(given, robot=robot, scene=scene, **self._form.read()))


def find_robots(folders: Folders) -> list[str]:
    """Find the robot folders within the folders of a page, by names that these resolve.

    No name is one of a robot that comes with the package.
    """
    files = folders.list_files(".toml", lambda path: path.name == ROBOT_FILE)
    names = [str(Path(file).parent) for file in files]
    return [f"./{name}" if name in (".", *list_robots()) else name for name in names]


def _unite(first: str, others: list[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*others, first]))


def fill_page(
    request: StudioRequest,
    server: viser.ViserServer,
    world: World,
    scratch: Path,
    change: Callable[[StudioRequest], None],
) -> Page:
    """Fill an empty page for one robot in one scene; ``change`` shows another one."""
    _aim_camera(server, world.robot.standing_neck_height)
    page = Page(request, server, world, Timeline(server, Stage(server, world)), scratch)
    with page.timeline.panel.add_tab("Picture"), page.speaking("Picture"):
        PictureTab(page)
    SetupFolder(page, change)
    tabs = server.gui.add_tab_group()
    for name, tab in TABS.items():
        with tabs.add_tab(name), page.speaking(name):
            page.tabs[name] = tab(page)
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(WIDTH)
    return page


def _aim_camera(server: viser.ViserServer, height: float) -> None:
    """Let every browser look at a robot of a standing neck height [m]."""
    position = (CAMERA[0] * height, CAMERA[1] * height, CAMERA[2] * height)
    aim = (0.0, 0.0, 0.3 * height)
    server.initial_camera.position, server.initial_camera.look_at = position, aim
    for client in server.get_clients().values():
        client.camera.position, client.camera.look_at = position, aim
