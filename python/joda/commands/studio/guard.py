"""Who may talk to the studio: who has the address that the terminal shows, on this machine."""

import socket
from collections.abc import Awaitable, Callable, MutableMapping
from secrets import compare_digest, token_urlsafe
from typing import Any
from urllib.parse import parse_qs

from joda.errors import JodaError

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
USUAL = 8642
"""The port, if it is free."""

Scope = MutableMapping[str, Any]
App = Callable[[Scope, Any, Any], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]

ELSEWHERE = "joda studio answers only its own page, on this machine."
NO_TOKEN = "joda studio: open the address that the terminal shows, with its token."


class Guard:
    """Refuses who names another host, comes from a page of another origin, or has no token.

    A page of the internet can make a browser ask a server on its own machine: across origins, or by
    a name of its own that it lets point to 127.0.0.1 (DNS rebinding). Other users of the machine
    can ask it themselves. The address that opens the page holds a token; it is exchanged for a
    cookie, with which the browser asks for all else, the WebSocket included.

    Attributes:
        address: of the page, with the token.
    """

    def __init__(self, port: int) -> None:
        """Makes a token; Args: the port of the page."""
        self._hosts = [f"{name}:{port}" for name in NAMES]
        self._token = token_urlsafe(32)
        self._cookie = f"joda_studio_{port}"  # browsers keep the cookies of all ports together
        self.address = f"http://{HOST}:{port}/?token={self._token}"

    def protecting(self, app: App) -> App:
        """The ASGI application, behind this guard."""

        async def guarded(scope: Scope, receive: Any, send: Any) -> None:
            if scope["type"] not in ("http", "websocket"):
                await app(scope, receive, send)
            elif sentence := self._refusal(scope):
                await _refuse(scope, receive, send, sentence)
            elif scope["type"] == "http" and self._known(_token_in(scope)):
                await _answer(send, 303, [(b"location", b"/"), (b"set-cookie", self._kept())])
            else:
                await app(scope, receive, _framed(send))

        return guarded

    def _refusal(self, scope: Scope) -> str:
        """Why a request is refused; empty if it is not."""
        hosts, origins = (_all(scope["headers"], name) for name in (b"host", b"origin"))
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return ELSEWHERE
        if any(origin != f"http://{hosts[0]}" for origin in origins):
            return ELSEWHERE
        tokens = [_cookie_in(scope["headers"], self._cookie)]
        if scope["type"] == "http":
            tokens.append(_token_in(scope))
        return "" if any(map(self._known, tokens)) else NO_TOKEN

    def _known(self, token: str) -> bool:
        return compare_digest(token.encode(), self._token.encode())

    def _kept(self) -> bytes:
        return f"{self._cookie}={self._token}; Path=/; HttpOnly; SameSite=Strict".encode()


def _all(headers: Headers, name: bytes) -> list[str]:
    """The values of all headers of a name (in lower case)."""
    return [value.decode("latin-1") for key, value in headers if key.lower() == name]


def _cookie_in(headers: Headers, name: str) -> str:
    """The value of a cookie; empty if there is none."""
    pairs = [pair.partition("=") for line in _all(headers, b"cookie") for pair in line.split(";")]
    return next((value.strip() for key, _, value in pairs if key.strip() == name), "")


def _token_in(scope: Scope) -> str:
    """The token in the address; empty if there is none."""
    query: bytes = scope.get("query_string", b"")
    asked = parse_qs(query.decode("latin-1"))
    return asked.get("token", [""])[0]


async def _refuse(scope: Scope, receive: Any, send: Any, sentence: str) -> None:
    """403 and a sentence, or no WebSocket."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
    else:
        plain = (b"content-type", b"text/plain; charset=utf-8")
        await _answer(send, 403, [plain], f"{sentence}\n".encode())


async def _answer(send: Any, status: int, headers: Headers, body: bytes = b"") -> None:
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})


def _framed(send: Any) -> Callable[[MutableMapping[str, Any]], Awaitable[None]]:
    """What is sent, and that no other page may show it, nor be told from where it was opened."""

    async def sent(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            own = [(b"x-frame-options", b"DENY"), (b"referrer-policy", b"no-referrer")]
            message["headers"] = [*message["headers"], *own]
        await send(message)

    return sent


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
