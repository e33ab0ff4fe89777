"""Studio: serves the page until it is stopped."""

from __future__ import annotations

import hmac
import inspect
import io
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, redirect_stdout
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

import viser
import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import load_world
from humanoid_getup.commands.look.studio import StudioRequest

if TYPE_CHECKING:
    from humanoid_getup.simulation.world import World
    from humanoid_getup.studio.page import Page

LEFT_OPEN = 5.0  # s after which a closed page leaves nothing running; a reload is quicker
TOKEN = "token"
"""Name of the token in the address; the cookie has it as well, with the port."""
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")


class Studio:
    """A page that is served; a context manager that ends everything it began."""

    def __init__(
        self, request: StudioRequest, announce: Callable[[str], None] = lambda _: None
    ) -> None:
        """Load the robot, and serve the page; the address is announced once it is served."""
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
        self.page = self._fill(request, world)
        """What all tabs share."""
        self.server.on_client_disconnect(lambda _: self._leave())

    @property
    def address(self) -> str:
        """Return the address to open in a browser."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        token = f"?{TOKEN}={self._guard.token}" if self._guard.token else ""
        return f"http://{host}:{self._port}/{token}"

    def change(self, request: StudioRequest) -> None:
        """Show another robot, body or scene; what was on the page is gone."""
        if self.page.is_busy:
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
                self.page.close()
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
        self.page.close()
        try:
            self.page = self._refill(request, world)
        except Exception as error:
            self.page = self._refill(*before)
            self.page.refuse(f"{type(error).__name__}: {error}")
            raise

    def _refill(self, request: StudioRequest, world: World) -> Page:
        self.server.gui.reset()
        self.server.scene.reset()
        return self._fill(request, world)

    def _fill(self, request: StudioRequest, world: World) -> Page:
        from humanoid_getup.studio.workspace import fill_page  # slow to import

        return fill_page(request, self.server, world, Path(self._scratch.name), self.change)

    def _leave(self) -> None:
        """End all jobs soon, unless a page is open by then."""
        leaving = threading.Timer(LEFT_OPEN, self._rest_if_left)
        leaving.daemon = True
        leaving.start()

    def _rest_if_left(self) -> None:
        if not self.server.get_clients():
            self.page.rest()


def find_port(host: str, port: int) -> int:
    """Return a port that is free at an address; 0 stands for any."""
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


@dataclass(frozen=True, kw_only=True)
class PageGuard:
    """Refuses requests from other pages, and, where there is a token, those without it.

    A page of another site that is open in the same browser can reach servers of this machine as
    well: it is refused by the address that the browser names as its origin.
    """

    token: str | None = None
    """Secret that a browser shows once, in the address; None for all users of this machine."""
    port: int = 0
    """For the name of the cookie, as browsers share cookies among the ports of a machine."""

    @classmethod
    def for_address(cls, host: str, port: int) -> PageGuard:
        """Make the guard of an address; all but the loopback address get a token."""
        return cls(token=None if is_loopback(host) else secrets.token_urlsafe(16), port=port)

    @contextmanager
    def protecting(self) -> Iterator[None]:
        """Put every web server that is started within the block behind this guard."""
        serve, guarded = websockets.asyncio.server.serve, list[bool]()

        def serve_guarded(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
            guarded.append(True)
            check = partial(self._check, process_request)
            return serve(*arguments, process_request=check, **options)

        websockets.asyncio.server.serve = serve_guarded  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = serve
        if not guarded:
            raise RuntimeError("the page's server was started without its guard")

    def refuse(self, request: Request) -> Response | None:
        """Return the response to a request that is not let through; None for one that is."""
        host, origin = request.headers.get("Host", ""), request.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != host:
            return _respond(HTTPStatus.FORBIDDEN, f"origin {origin}: expected http://{host}")
        if self.token is None:
            if urlsplit(f"//{host}").hostname not in LOOPBACK_NAMES:
                return _respond(HTTPStatus.FORBIDDEN, f"host {host}: expected localhost")
            return None
        if self._matches(parse_qs(urlsplit(request.path).query).get(TOKEN, [""])[0]):
            cookie = f"{self._cookie}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            return _respond(HTTPStatus.FOUND, "", Location="/", Set_Cookie=cookie)
        if self._matches(_read_cookie(request.headers.get("Cookie", ""), self._cookie)):
            return None
        return _respond(HTTPStatus.FORBIDDEN, "expected the address with the token as printed")

    async def _check(
        self, process: Callable[..., Any] | None, connection: ServerConnection, request: Request
    ) -> Response | None:
        try:
            if (refused := self.refuse(request)) is not None or process is None:
                return refused
            response = process(connection, request)
            return await response if inspect.isawaitable(response) else response
        except (LookupError, ValueError) as error:  # a header twice, an address that is none
            return _respond(HTTPStatus.BAD_REQUEST, f"malformed request: {error!r}")

    def _matches(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(), (self.token or "").encode())

    @property
    def _cookie(self) -> str:
        return f"studio_{TOKEN}_{self.port}"


def is_loopback(host: str) -> bool:
    """Return whether an address reaches programs of this machine alone."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _read_cookie(header: str, name: str) -> str:
    try:
        cookie = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return "" if cookie is None else cookie.value


def _respond(status: HTTPStatus, text: str, **fields: str) -> Response:
    body = f"{text}\n".encode() if text else b""
    headers = Headers({name.replace("_", "-"): value for name, value in fields.items()})
    headers["Content-Type"] = "text/plain; charset=utf-8"
    headers["Content-Length"] = str(len(body))
    headers["Connection"] = "close"
    return Response(status, status.phrase, headers, body)
