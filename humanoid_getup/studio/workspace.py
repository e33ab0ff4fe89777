"""Workspace: what is on the page for one robot in one scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from humanoid_getup.studio.page import Page
from humanoid_getup.studio.setup_folder import SetupFolder
from humanoid_getup.studio.stage import Stage
from humanoid_getup.studio.tabs.discover_tab import DiscoverTab
from humanoid_getup.studio.tabs.flight_tab import FlightTab
from humanoid_getup.studio.tabs.keyframe_tab import KeyframeTab
from humanoid_getup.studio.tabs.picture_tab import PictureTab
from humanoid_getup.studio.tabs.plan_tab import PlanTab
from humanoid_getup.studio.tabs.pose_tab import PoseTab
from humanoid_getup.studio.tabs.style_tab import StyleTab
from humanoid_getup.studio.timeline import Timeline

if TYPE_CHECKING:
    import viser

    from humanoid_getup.jobs.requests.studio import StudioRequest
    from humanoid_getup.simulation.world import World

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
        """Fill an empty page.

        Args:
            request: What is asked for.
            server: Server of the page.
            world: Robot and scene.
            scratch: Folder for files of jobs.
            change: Called to show another robot or scene.
        """
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
