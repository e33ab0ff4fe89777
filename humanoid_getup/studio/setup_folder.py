"""Setup folder: robot, body and scene of the page."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from humanoid_getup.scenes.named_scenes import SUFFIX, list_scenes
from humanoid_getup.studio.folders import containing
from robots import list_robots

if TYPE_CHECKING:
    from humanoid_getup.jobs.requests.studio import StudioRequest
    from humanoid_getup.studio.folders import Folders
    from humanoid_getup.studio.page import Page

ROBOT_FILE = "robot.toml"
SCENE_KEYS = re.compile(rb"^\[*(ground|boxes|capsules|spheres|starts)\b", re.MULTILINE)
"""One of them is in every scene file that is not level ground."""
GROUND = "Of rough ground: one seed gives the same ground again."
BODY = "Factors on the lengths of shoulders, arms, torso or legs, such as arms=1.6,torso=2.2."


class SetupFolder:
    """Elements that choose robot, body and scene; a change empties the page."""

    def __init__(self, page: Page, change: Callable[[StudioRequest], None]) -> None:
        """Add the elements where the caller is adding them."""
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
    return [_name_folder(Path(file).parent) for file in files]


def _name_folder(folder: Path) -> str:
    """Name a folder by a path, if need be from the present one."""
    name = str(folder)
    return f"./{name}" if name in (".", *list_robots()) else name


def _unite(first: str, others: list[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys([*others, first]))
