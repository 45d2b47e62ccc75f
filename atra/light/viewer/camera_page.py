"""A page of the browser with a camera in people's hands: pictures come, and where they look from goes."""

from __future__ import annotations

import asyncio
import contextlib
import io
import socket
import sys
from collections.abc import Callable
from math import degrees, radians
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.light.viewer.messages import Messages
from atra.light.viewer.request import Pose

if TYPE_CHECKING:
    from viser import CameraHandle, ClientHandle, GuiEvent, ViserServer

HOST = "127.0.0.1"

LEAVE_S = 10.0
"""Seconds without any page before the viewer ends; reloading a page takes less."""

_JPEG_QUALITY = 85

MOVEMENTS = ("orbit", "walk")
"""orbit: dragging turns the scene. walk: dragging turns the head; W, A, S, D, Q, E or buttons move."""

_ACROSS = 8.0
"""Diagonal of the scene in units of the page, whose keys move two of them a second."""

_STEPS_PER_S, _STEP = 10.0, 0.2
"""How often a held button moves the camera, and how far, in units of the page: as fast as keys do."""

_NEAR, _FAR = 0.01, 1e4
"""Distances from the eye to the point it turns about: always, while walking; and most, in orbit."""

_WAYS = {"forward": (0.0, 1.0), "back": (0.0, -1.0), "left": (-1.0, 0.0), "right": (1.0, 0.0)}
"""Buttons: how far to the right and ahead."""


class CameraPage:
    """A server of pages, bound to this machine alone, that show one picture each. It answers to its own pages only
    (`gate`), and ignores messages that make no sense (`messages`).

    title: of the panel. size: diagonal of the scene, which sets how fast one moves. Raises InputError where viser is
    missing or the port is taken.
    """

    def __init__(self, port: int, title: str, size: float) -> None:
        self._unit = size / _ACROSS if size > 0.0 else 1.0
        self._distances: dict[int, float] = {}
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
        camera.position, camera.look_at = np.array(first.eye) / self._unit, np.array(first.target) / self._unit
        camera.up = np.array(first.up)
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

    def add_camera_controls(self) -> None:
        """Add the choice between orbiting and walking, and buttons to walk by."""
        gui = self._server.gui
        self._movement: Any = gui.add_dropdown("movement", MOVEMENTS)  # Any: typed as read-only
        self._messages.controls[uuid_of(self._movement)] = MOVEMENTS.__contains__
        buttons = [gui.add_button(way, visible=False) for way in _WAYS]
        for button, (right, ahead) in zip(buttons, _WAYS.values(), strict=True):

            async def step(event: GuiEvent, right: float = right, ahead: float = ahead) -> None:
                if event.client is not None:
                    _move(event.client, right * _STEP, ahead * _STEP)

            button.on_hold(step, callback_hz=_STEPS_PER_S)
            self._messages.controls[uuid_of(button)] = _is_pressed
            self._messages.held[uuid_of(button)] = _STEPS_PER_S

        async def chosen(_: GuiEvent) -> None:
            for button in buttons:
                button.visible = self._movement.value == "walk"
            for client in self._server.get_clients().values():
                self._set_movement(client)

        self._movement.on_update(chosen)

    def add_button(self, label: str, act: Callable[[ClientHandle], None]) -> None:
        """Add a button; `act` is told whose page it was pressed on."""
        button = self._server.gui.add_button(label)
        self._messages.controls[uuid_of(button)] = _is_pressed

        @button.on_click
        def _(event: GuiEvent) -> None:
            if event.client is not None:
                act(event.client)

    def _set_movement(self, client: ClientHandle) -> None:
        """Put the point that a page's camera turns about right before the eye, or back to where it was."""
        camera, ahead = client.camera, _axes(client.camera)[:, 2]
        if self._movement.value == "walk":
            self._distances[client.client_id] = float(np.linalg.norm(camera.look_at - camera.position))
            with client.atomic():
                camera.look_at = camera.position + _NEAR * ahead
                camera.max_orbit_distance = _NEAR
        elif (distance := self._distances.pop(client.client_id, None)) is not None:
            with client.atomic():
                camera.max_orbit_distance = _FAR
                camera.look_at = camera.position + distance * ahead

    async def _connect(self, client: ClientHandle) -> None:
        @client.camera.on_update
        async def _(camera: CameraHandle) -> None:  # on viser's own thread, so that cameras come in their order
            self.moved(pose_of(camera, self._unit))

        self._movement.value = MOVEMENTS[0]  # of all pages: a new one has not found its own camera yet

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

    from atra.light.viewer.gate import gated  # of what comes with viser

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
    raise InputError(f"port {port} is taken; choose another by --port, or 0 for any that is free")


def _is_free(port: int) -> bool:
    with socket.socket() as one:
        if sys.platform != "win32":
            one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # or one that was just left would seem taken
        try:
            one.bind((HOST, port))
        except OSError:
            return False
    return True


def uuid_of(control: Any) -> str:
    """A control's identifier, for which viser has no public name."""
    return str(control._impl.uuid)


def _is_pressed(value: object) -> bool:
    return value is True


def _axes(camera: CameraHandle) -> NDArray[np.float64]:
    """(3, 3): columns right, down, forward, as viser's axes are those of OpenCV, as ours."""
    from viser.transforms import SO3

    return np.asarray(SO3(np.asarray(camera.wxyz)).as_matrix(), np.float64)


def _move(client: ClientHandle, right: float, ahead: float) -> None:
    """Move a page's camera, in units of the page; ahead means level, wherever the eye looks."""
    camera = client.camera
    axes, up = _axes(camera), np.asarray(camera.up_direction, np.float64)
    level = np.cross(up, axes[:, 0])
    length = float(np.linalg.norm(level))
    if length > 0.0:
        with client.atomic():
            camera.position = camera.position + right * axes[:, 0] + ahead / length * level


def pose_of(camera: CameraHandle, unit: float) -> Pose:
    """Where a page looks from. unit: of the page, in units of the scene."""
    axes = _axes(camera)
    eye = unit * np.asarray(camera.position, np.float64)
    x, y, z = eye.tolist()
    target, up = (eye + axes[:, 2]).tolist(), (-axes[:, 1]).tolist()
    return Pose((x, y, z), tuple(target), tuple(up), degrees(camera.fov), camera.aspect)
