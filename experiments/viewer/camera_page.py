"""A page of the browser with a camera in people's hands: pictures come, and where they look from goes."""

from __future__ import annotations

import asyncio
import contextlib
import io
import socket
import sys
from math import degrees, radians
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from experiments.viewer.messages import Messages
from experiments.viewer.request import Pose

if TYPE_CHECKING:
    from viser import CameraHandle, ClientHandle, ViserServer

HOST = "127.0.0.1"

LEAVE_S = 10.0
"""Seconds without any page before the viewer ends; reloading a page takes less."""

_JPEG_QUALITY = 85


class CameraPage:
    """A server of pages, bound to this machine alone, that show one picture each. It answers to its own pages only
    (`gate`), and ignores messages that make no sense (`messages`).

    title: of the panel. Raises InputError where viser is missing or the port is taken.
    """

    def __init__(self, port: int, title: str) -> None:
        self._messages = Messages()
        self._server = _serve(port, title, self._messages)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)

    @property
    def address(self) -> str:
        """Where it is."""
        return f"http://{HOST}:{self._server.get_port()}"

    def follow(self, first: Pose) -> None:
        """Tell `moved` of cameras from now on, and `left` when the last page has been closed for `LEAVE_S`."""
        camera = self._server.initial_camera
        self._server.scene.set_up_direction(first.up)
        camera.position, camera.look_at, camera.up = np.array(first.eye), np.array(first.target), np.array(first.up)
        camera.fov = radians(first.fov_y_degrees)
        self._server.on_client_connect(self._connect)
        self._server.on_client_disconnect(self._leave)

    def moved(self, pose: Pose) -> None:
        """A page looks from there. Called by viser's thread."""
        raise NotImplementedError

    def left(self) -> None:
        """The last page is closed. Called by viser's thread."""
        raise NotImplementedError

    def send(self, image: NDArray[np.uint8], is_still: bool) -> None:
        """Show an (H, W, 3) picture: a JPEG while the camera moves, a PNG when it rests."""
        image = np.ascontiguousarray(image)
        if is_still:
            self._server.scene.set_background_image(image, format="png")
        else:
            self._server.scene.set_background_image(image, format="jpeg", jpeg_quality=_JPEG_QUALITY)
        self._server.flush()

    def close(self) -> None:
        """Close the port."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    async def _connect(self, client: ClientHandle) -> None:
        @client.camera.on_update
        async def _(camera: CameraHandle) -> None:  # on viser's own thread, so that cameras come in their order
            self.moved(pose_of(camera))

    async def _leave(self, client: ClientHandle) -> None:
        def end_without_pages() -> None:
            if not self._server.get_clients():
                self.left()

        asyncio.get_running_loop().call_later(LEAVE_S, end_without_pages)


def _serve(port: int, title: str, messages: Messages) -> ViserServer:
    try:
        import viser
    except ImportError:
        raise InputError("the viewer needs viser, which is not installed; run: pip install -e '.[viewer]'") from None

    from experiments.viewer.gate import gated  # of what comes with viser

    class Server(viser.ViserServer):
        def request_share_url(self, verbose: bool = True) -> None:
            """Refuse: any page that the browser shows could ask for a tunnel to the world."""

    with contextlib.redirect_stdout(io.StringIO()):  # its banner
        if port == 0 or _is_free(port):
            with gated(messages):
                server = Server(host=HOST, port=port, label=title, verbose=False)
            if server.get_port() == port or port == 0:
                return server
            server.stop()  # it took the next one, since another was faster
    raise InputError(f"port {port} is taken; choose another by view.port=..., or 0 for any that is free")


def _is_free(port: int) -> bool:
    with socket.socket() as one:
        if sys.platform != "win32":
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # or one that was just left would seem taken
        try:
            one.bind((HOST, port))
        except OSError:
            return False
    return True


def pose_of(camera: CameraHandle) -> Pose:
    """Where a page looks from. viser's axes are those of OpenCV, as ours: right, down, forward."""
    from viser.transforms import SO3

    axes = SO3(np.asarray(camera.wxyz)).as_matrix()
    eye = np.asarray(camera.position, np.float64)
    x, y, z = eye.tolist()
    target, up = (eye + axes[:, 2]).tolist(), (-axes[:, 1]).tolist()
    return Pose((x, y, z), tuple(target), tuple(up), degrees(camera.fov), camera.aspect)
