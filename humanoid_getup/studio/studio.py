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
from humanoid_getup.studio.page_guard import TOKEN, PageGuard

if TYPE_CHECKING:
    from humanoid_getup.simulation.world import World
    from humanoid_getup.studio.page import Page
    from humanoid_getup.studio.timeline import Timeline
    from humanoid_getup.studio.workspace import Workspace

LEFT_OPEN = 5.0  # s after which a closed page leaves nothing running; a reload is quicker


class Studio:
    """A page that is served; a context manager that ends everything it began."""

    def __init__(
        self, request: StudioRequest, announce: Callable[[str], None] = lambda _: None
    ) -> None:
        """Load the robot, and serve the page.

        Args:
            request: What is asked for.
            announce: Called with the address once it is served; the page is filled while a
                browser opens it.

        Raises:
            BadInputError: if robot or scene cannot be used, or the port is taken.
        """
        StudioRequest.accept(request)
        world = load_world(request)
        port = find_port(request.host, request.port)
        self._scratch = TemporaryDirectory(prefix="getup-studio-")
        self._changing, self._is_closed = threading.Lock(), False
        self._guard = PageGuard.for_address(request.host, port)
        self._host, self._port = request.host, port
        with self._guard.protecting(), redirect_stdout(io.StringIO()):
            self.server = viser.ViserServer(
                host=request.host, port=port, label="getup studio", verbose=False
            )
        self.server.gui.configure_theme(show_share_button=False, control_width="large")
        announce(self.address)
        self._workspace = self._fill(request, world)
        self.server.on_client_disconnect(lambda _: self._leave())

    @property
    def address(self) -> str:
        """Return the address to open in a browser."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        token = f"?{TOKEN}={self._guard.token}" if self._guard.token else ""
        return f"http://{host}:{self._port}/{token}"

    @property
    def page(self) -> Page:
        """Return what all tabs share."""
        return self._workspace.page

    @property
    def timeline(self) -> Timeline:
        """Return the timeline."""
        return self._workspace.timeline

    @property
    def tabs(self) -> dict[str, Any]:
        """Return the tabs by their names."""
        return self._workspace.tabs

    def change(self, request: StudioRequest) -> None:
        """Show another robot, body or scene; what was on the page is gone.

        Raises:
            BadInputError: if robot or scene cannot be used, or a job runs.
        """
        if any(job.is_running for job in self.page.jobs):
            raise BadInputError("a job is running, expected its end, or Cancel first")
        StudioRequest.accept(request)
        world = load_world(request)
        with self._changing:
            if not self._is_closed:
                self._replace(request, world)

    def close(self) -> None:
        """Cancel all jobs, and stop to serve."""
        with self._changing:
            self._is_closed = True
            try:
                self._workspace.close()
            finally:
                with redirect_stdout(io.StringIO()):
                    self.server.stop()
                self._scratch.cleanup()

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _replace(self, request: StudioRequest, world: World) -> None:
        """Empty the page and fill it; as it was, if that fails."""
        before = self.page.request, self.page.world
        self._workspace.close()
        try:
            self._workspace = self._refill(request, world)
        except Exception as error:
            self._workspace = self._refill(*before)
            self.page.refuse(f"{type(error).__name__}: {error}")
            raise

    def _refill(self, request: StudioRequest, world: World) -> Workspace:
        self.server.gui.reset()
        self.server.scene.reset()
        return self._fill(request, world)

    def _fill(self, request: StudioRequest, world: World) -> Workspace:
        """Fill the page."""
        from humanoid_getup.studio.workspace import Workspace  # slow to import

        return Workspace(request, self.server, world, Path(self._scratch.name), self.change)

    def _leave(self) -> None:
        """End all jobs soon, unless a page is open by then."""
        leaving = threading.Timer(LEFT_OPEN, self._rest_if_left)
        leaving.daemon = True
        leaving.start()

    def _rest_if_left(self) -> None:
        if not self.server.get_clients():
            self.page.rest()


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
