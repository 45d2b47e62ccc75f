"""The gate before the viewer's server: only its own pages come in, and of what they send only what makes sense."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from http import HTTPStatus
from typing import Any

import websockets.asyncio.server as websockets_server
from websockets import Headers
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from atra.light.viewer.messages import LARGEST_BYTES, Messages

MOST_CLIENTS = 16
"""Pages that may be connected at once."""

MOST_BAD = 100
"""Messages that make no sense after which a connection is closed."""

_OWN_HOSTS = ("127.0.0.1", "localhost")
_POLICY_VIOLATION = 1008


class GatedConnection(ServerConnection):
    """A connection that passes on only messages that make sense, and takes one turn for each message.

    So one client costs a bounded time before it is the turn of the others, however much it sends.
    """

    def __init__(self, messages: Messages, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._messages, self._bad = messages, 0

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that makes sense. Raises what `websockets` does where the connection is closed."""
        while True:
            message = await super().recv(decode)
            await asyncio.sleep(0)  # messages that are already here would come without a pause
            if self._messages.make_sense(message):
                return message
            self._bad += 1
            if self._bad >= MOST_BAD:
                await self.close(_POLICY_VIOLATION, "too many messages that make no sense")


def refusal(headers: Headers, connected: int) -> Response | None:
    """The answer to a request that does not come from a page of this very server; None: it may come in.

    Browsers tell where a page is from by `Origin`, always of a websocket, and whom it asks by `Host`, which names
    another machine where a foreign name was made to lead here (DNS rebinding). connected: pages that are connected.
    """
    hosts, origins = headers.get_all("Host"), headers.get_all("Origin")
    is_websocket = headers.get("Upgrade", "").lower() == "websocket"
    if len(hosts) != 1 or hosts[0].rpartition(":")[0] not in _OWN_HOSTS:
        return _answer(HTTPStatus.FORBIDDEN, "This server answers to 127.0.0.1 and localhost alone.")
    if any(origin != f"http://{hosts[0]}" for origin in origins) or (is_websocket and not origins):
        return _answer(HTTPStatus.FORBIDDEN, "This server answers to its own pages alone.")
    if is_websocket and connected >= MOST_CLIENTS:
        return _answer(HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_CLIENTS} pages are open; close one.")
    return None


def _answer(status: HTTPStatus, text: str) -> Response:
    body = f"{text}\n".encode()
    headers = Headers([("Content-Type", "text/plain; charset=utf-8"), ("Content-Length", str(len(body)))])
    return Response(status, status.phrase, headers, body)


@contextmanager
def gated(messages: Messages) -> Iterator[None]:
    """Servers of `websockets` that start inside have the gate; viser has no option for one."""
    serve = websockets_server.serve

    def serve_gated(
        handler: Any, *arguments: Any, process_request: Callable[..., Any] | None = None, **more: Any
    ) -> Any:
        def admit(connection: ServerConnection, request: Request) -> Any:
            refused = refusal(request.headers, len(connection.server.connections))
            if refused is not None or process_request is None:
                return refused
            return process_request(connection, request)

        own = {"create_connection": partial(GatedConnection, messages), "max_size": LARGEST_BYTES}
        return serve(handler, *arguments, process_request=admit, **{**more, **own})

    websockets_server.serve = serve_gated  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]
