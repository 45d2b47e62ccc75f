"""The page: viser around a `Session`; where people look from and what they set goes in, pictures and times come out."""

from __future__ import annotations

import asyncio
import contextlib
import io
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import degrees, radians
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.saving import encode_png
from atra.light.pictures.finish.tone import TONES
from atra.light.viewer.request import FRAMES, SHADES, SPLITS, Pose, Request
from atra.light.viewer.session import Artist, Frame, Session
from atra.methods import METHODS

if TYPE_CHECKING:
    from viser import CameraHandle, ClientHandle, GuiEvent

LEAVE_S = 10.0
"""Seconds without any page before the viewer ends; reloading a page takes less."""

_JPEG_QUALITY = 85

MOVEMENTS = ("orbit", "walk")
"""orbit: dragging turns the scene. walk: dragging turns the head; W, A, S, D, Q, E or buttons move."""

_ACROSS = 8.0
"""Diagonal of the scene in units of the page, whose keys move two of them a second."""

_STEP = 0.2
"""How far a button moves the camera, in units of the page."""

_NEAR, _FAR = 0.01, 1e4
"""Distances from the eye to the point it turns about: always, while walking; and most, in orbit."""

_OWN_CAMERAS = 3
"""Most cameras of viser's own that a new page sends before it looks from the first view."""

_WAYS = {"forward": (0.0, 1.0), "back": (0.0, -1.0), "left": (-1.0, 0.0), "right": (1.0, 0.0)}
"""Buttons: how far to the right and ahead."""


class Page:
    """The screen of a `Session`: of several open pages, all show what one asked for last.

    It is reached from this machine alone, answers to its own pages only, and ignores messages that make no sense
    (`gate`). title: of the panel. size: diagonal of the scene, for its lengths and for how fast one moves. settings:
    whether those of pictures can be changed. Raises InputError where viser is missing or the port is taken.
    """

    def __init__(
        self, artist: Artist, first: Request, port: int, title: str, size: float, *, settings: bool = True
    ) -> None:
        try:
            from atra.light.viewer.gate import serve
        except ImportError:
            raise InputError(
                "the viewer needs viser, which is not installed; run: pip install -e '.[viewer]'"
            ) from None
        self._can_have: dict[str, Callable[[Any], bool]] = {}
        self._server = serve(port, title, self._can_have)
        self._server.gui.configure_theme(show_logo=False, show_share_button=False)
        self._unit = size / _ACROSS if size > 0.0 else 1.0
        self._distance = float(np.linalg.norm(np.subtract(first.pose.target, first.pose.eye))) / self._unit
        self._frame: Frame | None = None
        self.session = Session(artist, self, first)
        self._numbers = self._server.gui.add_markdown("preparing; a first start compiles kernels")
        if settings:
            self._add_controls(size)
        else:
            self._add_movement()
        self._begin_at(first.pose)

    @property
    def address(self) -> str:
        """Where it is."""
        return f"http://{self._server.get_host()}:{self._server.get_port()}"

    def show(self, frame: Frame) -> None:
        """Send a picture: a JPEG while the camera moves; a PNG and its numbers when it rests."""
        image, scene = np.ascontiguousarray(frame.picture.image), self._server.scene
        if frame.samples:
            scene.set_background_image(image, format="png")
            self._numbers.content = say_numbers(frame)
        else:
            scene.set_background_image(image, format="jpeg", jpeg_quality=_JPEG_QUALITY)
        self._server.flush()
        self._frame = frame

    def tell(self, problem: str) -> None:
        """Show a message in place of the numbers."""
        self._numbers.content = f"**{problem}**"

    def close(self) -> None:
        """Close the port."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def _begin_at(self, first: Pose) -> None:
        """Pages look from there at first, then tell the session; it ends when the last was closed `LEAVE_S` ago."""
        server, camera = self._server, self._server.initial_camera
        server.scene.set_up_direction(first.up)
        server.scene.configure_environment_map(None)  # its light would fade the picture in for seconds
        camera.position, camera.look_at = np.array(first.eye) / self._unit, np.array(first.target) / self._unit
        camera.up, camera.fov = np.array(first.up), radians(first.fov_y_degrees)

        def end_without_pages() -> None:
            if not server.get_clients():
                self.session.close()

        @server.on_client_connect
        async def _(client: ClientHandle) -> None:
            own_left = _OWN_CAMERAS

            async def moved(camera: CameraHandle) -> None:  # on viser's own thread, so that cameras come in their order
                nonlocal own_left
                pose = pose_of(camera, self._unit)
                if own_left == 0 or np.allclose(pose.eye, first.eye, atol=1e-3 * self._unit):
                    own_left = 0
                    self.session.want(pose)
                else:
                    own_left -= 1
                    self.session.want(replace(first, aspect=camera.aspect))

            client.camera.on_update(moved)
            self._movement.value = MOVEMENTS[0]  # of all pages

        @server.on_client_disconnect
        async def _(client: ClientHandle) -> None:
            asyncio.get_running_loop().call_later(LEAVE_S, end_without_pages)

    def _add_controls(self, size: float) -> None:
        gui = self._server.gui
        with gui.add_folder("Picture"):
            self._choice("frame", "frame", FRAMES)
            self._choice("shade", "shade", SHADES)
            self._slider("samples", "samples", 1, 512, 1)
            self._slider("side", "side, pixels", 64, 2048, 64)
            self._slider("exposure", "exposure", -10.0, 10.0, 0.1)
            self._choice("tone", "tone map", TONES)
            denoise = gui.add_checkbox("denoise at rest", self.session.wanted.settings.denoise)
            self._on_update(denoise, lambda one: type(one) is bool, "denoise", bool)
            self._add_button("save picture", self._save_picture)
        with gui.add_folder("Camera"):
            self._add_movement()
            self._add_button("save camera", self._save_camera)
        with gui.add_folder("Primary visibility", expand_by_default=False):
            self._choice("method", "method", tuple(METHODS))
            self._choice("split_x", "columns", tuple(map(str, SPLITS)), int)
            self._choice("jitter", "jitter", ("shared", "off"))
        with gui.add_folder("Hybrid", expand_by_default=False):
            self._slider("shadow_rays", "shadow rays", 0, 8, 1)
            self._slider("shadow_length", "shadow length", 0.01 * size, 2.0 * size, 0.01 * size)
            self._slider("occlusion_rays", "occlusion rays", 0, 8, 1)
            self._slider("occlusion_length", "occlusion length", 0.01 * size, size, 0.01 * size)
            self._choice("occlusion", "occlusion", ("uniform", "cosine"))
        with gui.add_folder("Paths", expand_by_default=False):
            self._slider("bounces", "bounces", 0, 31, 1)
        with gui.add_folder("Light"):
            self._slider("sun_power", "sun's power", 0.0, 10.0, 0.05)
            self._slider("sun_cone", "cone, degrees", 0.0, 10.0, 0.05)
            self._slider("sun_heading", "heading", -180.0, 180.0, 1.0)
            self._slider("sun_height", "height", -90.0, 90.0, 1.0)
            colour = gui.add_rgb("colour", self.session.wanted.settings.sun_colour)
            self._on_update(colour, _is_colour, "sun_colour", tuple)
            self._slider("sky_power", "sky's power", 0.0, 10.0, 0.05)

    def _save_picture(self, client: ClientHandle) -> None:
        """What is shown, as the page sees it."""
        if self._frame is not None:
            client.send_file_download("picture.png", encode_png(self._frame.picture.image), save_immediately=True)

    def _save_camera(self, client: ClientHandle) -> None:
        """As `atra render --camera` reads it."""
        camera = self.session.wanted.camera
        fields = ("eye", "target", "up", "fov_y_degrees", "width", "height")
        content = json.dumps({"view": {name: getattr(camera, name) for name in fields}}, indent=2)
        client.send_file_download("camera.json", content.encode(), save_immediately=True)

    def _add_movement(self) -> None:
        """Add the choice between orbiting and walking, and buttons to walk by."""
        gui = self._server.gui
        self._movement: Any = gui.add_dropdown("movement", MOVEMENTS)  # Any: typed as read-only
        steps = gui.add_button_group("step", tuple(_WAYS), visible=False)

        async def chosen(_: GuiEvent) -> None:
            steps.visible = walks = self._movement.value == "walk"
            for client in self._server.get_clients().values():
                camera = client.camera
                if not walks and np.linalg.norm(camera.look_at - camera.position) > 2.0 * _NEAR:
                    continue  # it did not walk: a new page, which has not found its own camera yet
                with client.atomic():  # the point that a camera turns about is right before the eye, or far from it
                    camera.max_orbit_distance = _FAR
                    camera.look_at = camera.position + (_NEAR if walks else self._distance) * _axes(camera)[:, 2]
                    camera.max_orbit_distance = _NEAR if walks else _FAR

        self._accept(self._movement, MOVEMENTS.__contains__)
        self._movement.on_update(chosen)
        self._accept(steps, tuple(_WAYS).__contains__)
        self._on_click(steps, lambda client: _move(client, *_WAYS[steps.value]))

    def _add_button(self, label: str, act: Callable[[ClientHandle], None]) -> None:
        button = self._server.gui.add_button(label)
        self._accept(button, lambda value: value is True)
        self._on_click(button, act)

    def _on_click(self, button: Any, act: Callable[[ClientHandle], None]) -> None:
        """`act` is told whose page it was pressed on."""

        @button.on_click
        def _(event: GuiEvent) -> None:
            if event.client is not None:
                act(event.client)

    def _slider(self, field: str, label: str, least: float, most: float, step: float) -> None:
        kind = type(least)
        now = kind(getattr(self.session.wanted.settings, field))
        least, most = min(least, now), max(most, now)
        slider = self._server.gui.add_slider(label, least, most, step, now)
        self._on_update(slider, lambda one: type(one) in (int, float) and least <= one <= most, field, kind)

    def _choice(self, field: str, label: str, names: Sequence[str], kind: type = str) -> None:
        now = str(getattr(self.session.wanted.settings, field))
        self._on_update(self._server.gui.add_dropdown(label, names, initial_value=now), names.__contains__, field, kind)

    def _on_update(self, control: Any, can_have: Callable[[Any], bool], field: str, read: Callable[[Any], Any]) -> None:
        """Hand a control's values to the session."""

        async def changed(event: GuiEvent) -> None:
            self.session.want(**{field: read(event.target.value)})

        self._accept(control, can_have)
        control.on_update(changed)

    def _accept(self, control: Any, can_have: Callable[[Any], bool]) -> None:
        """Let messages in that give a control a value it can have; viser has no public name for its identifier."""
        self._can_have[control._impl.uuid] = can_have


def _is_colour(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(type(one) is int and 0 <= one <= 255 for one in value)


def _axes(camera: CameraHandle) -> NDArray[np.float64]:
    """(3, 3): columns right, down, forward, as viser's axes are those of OpenCV, as ours."""
    from viser.transforms import SO3

    return np.asarray(SO3(np.asarray(camera.wxyz)).as_matrix(), np.float64)


def _move(client: ClientHandle, right: float, ahead: float) -> None:
    """Move a page's camera by a step; ahead means level, wherever the eye looks."""
    camera = client.camera
    across = _axes(camera)[:, 0]
    level = np.cross(np.asarray(camera.up_direction, np.float64), across)
    length = float(np.linalg.norm(level))
    if length > 0.0:
        with client.atomic():
            camera.position = camera.position + _STEP * (right * across + ahead / length * level)


def pose_of(camera: CameraHandle, unit: float) -> Pose:
    """Where a page looks from. unit: of the page, in units of the scene."""
    axes = _axes(camera)
    eye = unit * np.asarray(camera.position, np.float64)
    x, y, z = eye.tolist()
    target, up = (eye + axes[:, 2]).tolist(), (-axes[:, 1]).tolist()
    return Pose((x, y, z), tuple(target), tuple(up), degrees(camera.fov), camera.aspect)


def say_numbers(frame: Frame) -> str:
    """What the panel says of a frame, in Markdown."""
    picture, camera = frame.picture, frame.request.camera
    if not picture.stage_s:
        return picture.note
    lines = [f"**{frame.samples} of {frame.request.settings.enough} samples**, {camera.width} x {camera.height}"]
    lines += [picture.note] if picture.note else []
    lines.append("ms: " + ", ".join(f"{name.replace('_', ' ')} {1e3 * s:.1f}" for name, s in picture.stage_s.items()))
    return "\n\n".join(lines)
