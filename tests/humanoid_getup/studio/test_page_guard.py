import asyncio
from http import HTTPStatus

import pytest

pytest.importorskip("viser", reason="needs the studio extra")

import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from humanoid_getup.studio.studio import PageGuard

pytestmark = pytest.mark.studio

OPEN = PageGuard.for_address("127.0.0.1", 8090)
CLOSED = PageGuard.for_address("0.0.0.0", 8090)
HERE = {"Host": "localhost:8090"}
THERE = {"Host": "robot.example:8090"}


def ask(guard: PageGuard, path: str = "/", **headers: str) -> tuple[int, Headers] | None:
    response = guard.refuse(Request(path, Headers(headers)))
    return None if response is None else (response.status_code, response.headers)


def test_a_browser_of_this_machine_is_let_through_and_no_page_of_another_site():
    for host in ("localhost:8090", "127.0.0.1:8090", "[::1]:8090"):
        assert ask(OPEN, Host=host) is None
        assert ask(OPEN, Host=host, Origin=f"http://{host}") is None
    for headers in (
        HERE | {"Origin": "http://elsewhere.example"},
        HERE | {"Origin": "http://localhost:3000"},
        HERE | {"Origin": "null"},
        {"Host": "elsewhere.example:8090"},  # a name of another site that leads to this machine
        {},
    ):
        refused = ask(OPEN, **headers)
        assert refused is not None and refused[0] == HTTPStatus.FORBIDDEN, headers


def test_another_address_is_opened_once_with_its_token_and_then_by_cookie():
    assert CLOSED.token is not None
    given = ask(CLOSED, f"/?token={CLOSED.token}", **THERE)
    assert given is not None
    assert (given[0], given[1]["Location"]) == (HTTPStatus.FOUND, "/")
    cookie = given[1]["Set-Cookie"].split(";")[0]
    assert ask(CLOSED, Cookie=cookie, **THERE) is None
    assert ask(CLOSED, Cookie=f"other=1; {cookie}", **THERE) is None


def test_another_address_without_its_token_is_refused():
    for path in ("/", "/?token=", "/?token=guess", "/index.html?token=x"):
        for cookie in ("", "studio_token_8090=", "studio_token_8090=guess", "=;;="):
            refused = ask(CLOSED, path, Cookie=cookie, **THERE)
            assert refused is not None and refused[0] == HTTPStatus.FORBIDDEN, (path, cookie)


def get(*headers: bytes) -> bytes:
    """Send a request to a guarded server; return the first line of the response."""

    async def talk() -> bytes:
        with OPEN.protecting():
            serve = websockets.asyncio.server.serve
            server = await serve(lambda _: None, "127.0.0.1", 0, process_request=answer)
        async with server:
            port = server.sockets[0].getsockname()[1]
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(b"\r\n".join((b"GET / HTTP/1.1", *headers, b"", b"")))
            response = await reader.read()
            writer.close()
            return response.split(b"\r\n")[0]

    return asyncio.run(asyncio.wait_for(talk(), 30.0))


def answer(_connection: object, request: Request) -> Response:
    request.headers.get("Accept-Encoding", "")  # as viser does
    return Response(HTTPStatus.OK, "OK", Headers())


HOST = b"Host: localhost:8090"


@pytest.mark.parametrize(
    "headers",
    [
        (HOST, b"Host: elsewhere.example"),
        (b"Host: [",),
        (HOST, b"Origin: http://["),
        (HOST, b"Origin: http://localhost:8090", b"Origin: http://elsewhere.example"),
        (HOST, b"Accept-Encoding: gzip", b"Accept-Encoding: br"),
    ],
)
def test_a_malformed_request_is_one(headers: tuple[bytes, ...], caplog: pytest.LogCaptureFixture):
    assert get(HOST) == b"HTTP/1.1 200 OK"
    assert get(*headers) == b"HTTP/1.1 400 Bad Request"
    assert not caplog.records


def test_a_server_that_would_start_without_its_guard_is_an_error():
    with pytest.raises(RuntimeError, match="without its guard"), OPEN.protecting():
        pass
