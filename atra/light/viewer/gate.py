"""The viewer's server, and the gate before it: only its own pages come in, and of what they send only what makes sense.

Imported where viser is there, which brings `msgspec` and `websockets`.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from http import HTTPStatus
from math import hypot, pi
from typing import Annotated, Any

import viser
import websockets.asyncio.server as websockets_server
from msgspec import Meta, Struct
from msgspec.msgpack import Decoder
from websockets import Headers
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from atra.errors import InputError

HOST = "127.0.0.1"

MOST_CLIENTS = 16
"""Pages that may be connected at once."""

MOST_BAD = 100
"""Messages that make no sense after which a connection is closed."""

LARGEST_BYTES = 4096
"""Longest message that is read; those of the page have some hundred bytes."""

_OWN_HOSTS = (HOST, "localhost")
_POLICY_VIOLATION = 1008

_Number = Annotated[float, Meta(ge=-1e12, le=1e12)]
_Vector = tuple[_Number, _Number, _Number]
_Size = Annotated[int, Meta(gt=0, le=1 << 15)]


class _Camera(Struct, tag="ViewerCameraMessage", forbid_unknown_fields=True):
    wxyz: tuple[_Number, _Number, _Number, _Number]
    position: _Vector
    fov: Annotated[float, Meta(gt=0.0, lt=pi)]
    near: _Number
    far: _Number
    image_height: _Size
    image_width: _Size
    look_at: _Vector
    up_direction: _Vector


class _Value(Struct, forbid_unknown_fields=True):
    value: Any


class _Control(Struct, tag="GuiUpdateMessage", forbid_unknown_fields=True):
    uuid: str
    updates: _Value


Controls = dict[str, Callable[[Any], bool]]
"""Whether a control can have a value, by the control's identifier."""

_DECODER = Decoder(_Camera | _Control)


def makes_sense(raw: object, controls: Controls) -> bool:
    """Whether these bytes are a message of the page: where its camera is, or the new value of a control. Never
    raises."""
    if not isinstance(raw, bytes) or len(raw) > LARGEST_BYTES:
        return False
    try:
        message = _DECODER.decode(raw)
    except (ValueError, RecursionError):  # msgspec's own errors are ValueErrors
        return False
    if isinstance(message, _Camera):
        return 0.9 < hypot(*message.wxyz) < 1.1
    can_have = controls.get(message.uuid)
    return can_have is not None and can_have(message.updates.value)


class GatedConnection(ServerConnection):
    """A connection that passes on only messages that make sense, and takes one turn for each message.

    So one client costs a bounded time before it is the turn of the others, however much it sends.
    """

    def __init__(self, controls: Controls, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._controls, self._bad = controls, 0

    async def recv(self, decode: bool | None = None) -> Any:
        """The next message that makes sense. Raises what `websockets` does where the connection is closed."""
        while True:
            message = await super().recv(decode)
            await asyncio.sleep(0)  # messages that are already here would come without a pause
            if makes_sense(message, self._controls):
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
    status, text = HTTPStatus.FORBIDDEN, "This server answers to its own pages on this machine alone."
    if len(hosts) == 1 and hosts[0].rpartition(":")[0] in _OWN_HOSTS and set(origins) <= {f"http://{hosts[0]}"}:
        if not is_websocket or (origins and connected < MOST_CLIENTS):
            return None
        if origins:
            status, text = HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_CLIENTS} pages are open; close one."
    body = f"{text}\n".encode()
    headers = Headers([("Content-Type", "text/plain; charset=utf-8"), ("Content-Length", str(len(body)))])
    return Response(status, status.phrase, headers, body)


@contextmanager
def _gated(controls: Controls) -> Iterator[None]:
    """Servers of `websockets` that start inside have the gate; viser has no option for one."""
    serve = websockets_server.serve

    def serve_gated(handler: Any, *arguments: Any, process_request: Callable[..., Any], **more: Any) -> Any:
        def admit(connection: ServerConnection, request: Request) -> Any:
            refused = refusal(request.headers, len(connection.server.connections))
            return refused or process_request(connection, request)

        own = {"create_connection": partial(GatedConnection, controls), "max_size": LARGEST_BYTES}
        return serve(handler, *arguments, process_request=admit, **{**more, **own})

    websockets_server.serve = serve_gated  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]


def serve(port: int, title: str, controls: Controls) -> viser.ViserServer:
    """A server with the gate, bound to this machine alone. controls: filled while its page is made. Raises InputError
    where the port is taken."""
    try:
        socket.create_server((HOST, port)).close()  # viser would take the next one
    except OSError:
        raise InputError(f"port {port} is taken; choose another by --port, or 0 for any that is free") from None
    with contextlib.redirect_stdout(io.StringIO()), _gated(controls):  # its banner
        return viser.ViserServer(host=HOST, port=port, label=title, verbose=False)
