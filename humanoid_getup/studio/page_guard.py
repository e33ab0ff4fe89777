"""Page guard: decides who may open the studio's page, before anything is sent."""

from __future__ import annotations

import hmac
import inspect
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from typing import Any
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

TOKEN = "token"
"""Name of the token in the address; the cookie has it as well, with the port."""
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")


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
        """Put every web server that is started within the block behind this guard.

        Raises:
            RuntimeError: at the end of the block if no server was.
        """
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
