"""Who may talk to the studio: pages that it served itself, on this machine."""

import socket
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any
from urllib.parse import urlsplit

from joda.errors import JodaError

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
USUAL = 8642
"""The port, if it is free."""

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Any, Any], Awaitable[None]]


class OnlyHere:
    """Refuses requests that name another host, or come from a page of another origin.

    A page of the internet can make a browser ask a server on its own machine: across origins, or by
    a name of its own that it lets point to 127.0.0.1 (DNS rebinding).
    """

    def __init__(self, app: App) -> None:
        """Args: the ASGI application that is guarded."""
        self._app = app

    async def __call__(self, scope: Scope, receive: Any, send: Any) -> None:
        """Passes on what is allowed; the rest gets 403, or no WebSocket."""
        if scope["type"] in ("http", "websocket") and not allowed(scope["headers"]):
            if scope["type"] == "websocket":
                await receive()
                await send({"type": "websocket.close", "code": 1008})
                return
            plain = [(b"content-type", b"text/plain")]
            await send({"type": "http.response.start", "status": 403, "headers": plain})
            await send({"type": "http.response.body", "body": b"only from this machine\n"})
            return

        async def framed(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], (b"x-frame-options", b"DENY")]
            await send(message)

        await self._app(scope, receive, framed)


def allowed(headers: list[tuple[bytes, bytes]]) -> bool:
    """Whether `Host` is this machine, and `Origin`, if there is one, the same host and port."""
    found = {name.lower(): value.decode("latin-1") for name, value in headers}
    host, origin = found.get(b"host", ""), found.get(b"origin")
    if urlsplit(f"//{host}").hostname not in NAMES:
        return False
    return origin is None or origin == f"http://{host}"


def free_port(asked: int | None) -> int:
    """The port that is asked for, or the usual one, or any; raises JodaError if it is taken."""
    for port in (USUAL, 0) if asked is None else (asked,):
        with socket.socket() as tried:
            tried.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                tried.bind((HOST, port))
            except (OSError, OverflowError):
                continue
            return int(tried.getsockname()[1])
    raise JodaError(f"--port {asked} cannot be used: it is taken, or not yours; choose another.")
