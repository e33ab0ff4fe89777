"""Studio: serves the page until it is stopped."""

from __future__ import annotations

import io
import socket
import threading
from collections.abc import Callable
from contextlib import closing, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import viser

from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.inputs import load_world
from humanoid_getup.jobs.requests.studio import StudioRequest
from humanoid_getup.studio.flight_tab import FlightTab
from humanoid_getup.studio.keyframe_tab import KeyframeTab
from humanoid_getup.studio.live_tab import LiveTab
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.page_guard import TOKEN, PageGuard
from humanoid_getup.studio.plan_tab import PlanTab
from humanoid_getup.studio.pose_tab import PoseTab
from humanoid_getup.studio.recorder import Recorder
from humanoid_getup.studio.setup_folder import SetupFolder
from humanoid_getup.studio.stage import Stage
from humanoid_getup.studio.style_tab import StyleTab
from humanoid_getup.studio.timeline import Timeline

if TYPE_CHECKING:
    from humanoid_getup.simulation.world import World

CAMERA = (1.9, -1.6, 1.1)  # standing neck heights from the robot
PATIENCE = 12.0  # s for jobs to release a robot and to end
LEFT_OPEN = 5.0  # s after which a closed page leaves nothing running; a reload is quicker


class Studio:
    """A page that is served; a context manager that ends everything it began."""

    def __init__(self, request: StudioRequest) -> None:
        """Load the robot, and serve the page.

        Raises:
            BadInputError: if robot or scene cannot be used, or the port is taken.
        """
        StudioRequest.accept(request)
        world = load_world(request)
        port = find_port(request.host, request.port)
        self._scratch = TemporaryDirectory(prefix="getup-studio-")
        self._changing = threading.Lock()
        self._guard = PageGuard.for_address(request.host, port)
        self._host, self._port = request.host, port
        with self._guard.protecting(), redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(
                host=request.host, port=port, label="getup studio", verbose=False
            )
        self.server.gui.configure_theme(show_share_button=False, control_width="large")
        self._build(request, world)
        self.server.on_client_disconnect(lambda _: self._leave())

    @property
    def address(self) -> str:
        """Return the address to open in a browser."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        token = f"?{TOKEN}={self._guard.token}" if self._guard.token else ""
        return f"http://{host}:{self._port}/{token}"

    def change(self, request: StudioRequest) -> None:
        """Show another robot, body or scene; what was on the page is gone.

        Raises:
            BadInputError: if robot or scene cannot be used, or a job runs.
        """
        if any(job.is_running for job in self.page.jobs):
            raise BadInputError("a job is running, expected its end, or Cancel first")
        world = load_world(request)
        with self._changing:
            self._clear()
            self.server.gui.reset()
            self.server.scene.reset()
            self._build(request, world)
        for client in self.server.get_clients().values():
            client.camera.position = self.server.initial_camera.position
            client.camera.look_at = self.server.initial_camera.look_at

    def close(self) -> None:
        """Cancel all jobs, and stop to serve."""
        with self._changing:
            self._clear()
        with redirect_stdout(io.StringIO()):
            self.server.stop()
        self._scratch.cleanup()

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _build(self, request: StudioRequest, world: World) -> None:
        """Fill the page."""
        self._aim_camera(world.robot.standing_neck_height)
        self.timeline = Timeline(self.server, Stage(self.server, world))
        self.page = Page(request, self.server, world, self.timeline, Path(self._scratch.name))
        with self.timeline.panel.add_tab("Picture"):
            self.recorder = Recorder(self.page)
        SetupFolder(self.page, self.change)
        tabs = self.server.gui.add_tab_group()
        self.tabs: dict[str, Any] = {}
        """What was made of `TABS`."""
        for name, tab in TABS.items():
            with tabs.add_tab(name):
                self.tabs[name] = tab(self.page)
        self.server.gui.main_panel.dock_right()

    def _clear(self) -> None:
        """Cancel all jobs, and stop to draw."""
        self.page.close()
        for job in self.page.jobs:
            job.wait(PATIENCE)
        self.tabs["Live"].close()
        self.timeline.close()

    def _leave(self) -> None:
        """End all jobs soon, unless a page is open by then."""
        leaving = threading.Timer(LEFT_OPEN, self._rest_if_left)
        leaving.daemon = True
        leaving.start()

    def _rest_if_left(self) -> None:
        if not self.server.get_clients():
            self.page.rest()

    def _aim_camera(self, height: float) -> None:
        camera = self.server.initial_camera
        camera.position = (CAMERA[0] * height, CAMERA[1] * height, CAMERA[2] * height)
        camera.look_at = (0.0, 0.0, 0.3 * height)


TABS: dict[str, Callable[[Page], object]] = {
    "Pose": PoseTab,
    "Keyframes": KeyframeTab,
    "Plan": PlanTab,
    "Style": StyleTab,
    "Flight": FlightTab,
    "Live": LiveTab,
}


def find_port(host: str, port: int) -> int:
    """Return a port that is free at an address; 0 stands for any.

    Raises:
        BadInputError: if it is taken, or there is no such address.
    """
    try:
        family = socket.getaddrinfo(host, port)[0][0]
        with closing(socket.socket(family)) as trial:
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((host, port))
            return int(trial.getsockname()[1])
    except OSError as error:
        raise BadInputError(
            f"the page cannot be served at {host}, port {port}: {error.strerror or error}; "
            "expected a free port, see --port"
        ) from error
