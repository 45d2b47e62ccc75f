"""The page: a thin shell of viser around a `Session`; what people set goes in, frames and times come out."""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from time import monotonic
from typing import TYPE_CHECKING, Any

from atra.errors import InputError
from atra.files.saving import encode_png
from atra.light.pictures.finish.tone import TONES
from atra.light.viewer.camera_page import CameraPage, uuid_of
from atra.light.viewer.request import FRAMES, SHADES, SPLITS, Pose, Request
from atra.light.viewer.session import WAKE_S, Artist, Frame, Session
from atra.methods import METHODS

if TYPE_CHECKING:
    from viser import ClientHandle, GuiEvent

_TOLD_S = 0.2
"""Seconds between two updates of the numbers while the camera moves."""


class Page(CameraPage):
    """The screen of a `Session`: of several open pages, all show what one asked for last.

    size: of the scene, for its lengths. title, port: of `CameraPage`, which says what is raised. settings: whether
    those of pictures can be changed.
    """

    def __init__(
        self, artist: Artist, first: Request, port: int, title: str, size: float, *, settings: bool = True
    ) -> None:
        super().__init__(port, title, size)
        self.session = Session(artist, self, first)
        self._told_s = 0.0
        self._frame: Frame | None = None
        self._moved_s: float | None = None
        self._is_seen = threading.Event()
        self._folders: dict[str, Any] = {}
        self._numbers = self._server.gui.add_markdown("preparing; a first start compiles kernels")
        if settings:
            self._add_controls(size)
        else:
            self.add_camera_controls()
        self.follow(first.pose)

    def prepare(self) -> None:
        """Draw the first picture, so that it is there when a page is."""
        self.session.step()

    def run(self) -> None:
        """Until Ctrl-C, or until the last page has been closed for a while; samples wait for a page that looks."""
        while not self._is_seen.wait(WAKE_S) and not self.session.is_closed:
            pass
        self.session.run()

    def show(self, frame: Frame) -> None:
        """Send a picture: a JPEG while the camera moves, a PNG when it rests."""
        is_still = frame.samples > 0
        self.send(frame.picture.image, is_still)
        self._frame = frame
        now_s, before_s = monotonic(), self._moved_s
        self._moved_s = None if is_still else now_s
        if is_still or now_s - self._told_s >= _TOLD_S:
            self._told_s = now_s
            self._numbers.content = say_numbers(frame, None if before_s is None else now_s - before_s)

    def tell(self, problem: str) -> None:
        """Show a message in place of the numbers."""
        self._numbers.content = f"**{problem}**"

    def moved(self, pose: Pose) -> None:
        """A page looks from there."""
        self.session.want(pose)
        self._is_seen.set()

    def left(self) -> None:
        """The last page is closed."""
        self.session.close()

    def _add_controls(self, size: float) -> None:
        gui, now = self._server.gui, self.session.wanted.settings
        labels = {name.replace("_", " "): name for name in METHODS}
        with gui.add_folder("Picture"):
            self._choice("frame", "frame", FRAMES)
            self._choice("shade", "shade", SHADES)
            self._slider("samples", "samples", 1, 512, 1)
            self._slider("side", "side, pixels", 64, 2048, 64)
            self._slider("exposure", "exposure", -10.0, 10.0, 0.1)
            self._choice("tone", "tone map", TONES)
            self._box("denoise", "denoise at rest")
            self.add_button("save picture", self._save_picture)
        with gui.add_folder("Camera"):
            self.add_camera_controls()
            self.add_button("save camera", self._save_camera)
        with gui.add_folder("Primary visibility", expand_by_default=False):
            method = gui.add_dropdown("method", tuple(labels), initial_value=now.method.replace("_", " "))
            self._on_update(method, "method", labels.__getitem__)
            self._choice("split_x", "columns", tuple(map(str, SPLITS)), int)
            self._box("jitter", "jitter")
        with self._folder("hybrid", "Hybrid"):
            self._slider("shadow_rays", "shadow rays", 0, 8, 1)
            self._slider("shadow_length", "shadow length", 0.01 * size, 2.0 * size, 0.01 * size)
        with gui.add_folder("Sun"):
            self._slider("sun_cone", "cone, degrees", 0.0, 10.0, 0.05)
            self._slider("sun_heading", "heading", -180.0, 180.0, 1.0)
            self._slider("sun_height", "height", -90.0, 90.0, 1.0)
            self._slider("sun_power", "power", 0.0, 10.0, 0.05)
            self._on_update(gui.add_rgb("colour", now.sun_colour), "sun_colour", tuple)
        with self._folder("hybrid", "Ambient occlusion"):
            self._slider("occlusion_rays", "rays", 0, 8, 1)
            self._slider("occlusion_length", "length", 0.01 * size, size, 0.01 * size)
            self._box("cosine", "cosine")
        with self._folder("path", "Paths"):
            self._slider("bounces", "bounces", 0, 31, 1)
        with gui.add_folder("Sky", expand_by_default=False):
            self._slider("sky_power", "power", 0.0, 10.0, 0.05)
        self._show_folders()

    def _save_picture(self, client: ClientHandle) -> None:
        """What is shown, as the page sees it."""
        if self._frame is not None:
            client.send_file_download("picture.png", encode_png(self._frame.picture.image), save_immediately=True)

    def _save_camera(self, client: ClientHandle) -> None:
        """As `atra render --camera` reads it."""
        content = camera_file(self.session.wanted).encode()
        client.send_file_download("camera.json", content, save_immediately=True)

    @contextlib.contextmanager
    def _folder(self, renderer: str, title: str) -> Iterator[None]:
        """A folder of controls that one renderer has alone."""
        with self._server.gui.add_folder(title, expand_by_default=False) as folder:
            yield
        self._folders[title] = renderer, folder

    def _show_folders(self) -> None:
        for renderer, folder in self._folders.values():
            folder.visible = renderer == self.session.wanted.settings.renderer

    def _slider(self, field: str, label: str, least: float, most: float, step: float) -> None:
        now = type(least)(getattr(self.session.wanted.settings, field))
        slider = self._server.gui.add_slider(label, min(least, now), max(most, now), step, now)
        self._on_update(slider, field, type(least), lambda value: slider.min <= value <= slider.max)

    def _choice(self, field: str, label: str, names: tuple[str, ...], kind: type = str) -> None:
        now = str(getattr(self.session.wanted.settings, field))
        self._on_update(self._server.gui.add_dropdown(label, names, initial_value=now), field, kind)

    def _box(self, field: str, label: str) -> None:
        now = getattr(self.session.wanted.settings, field)
        self._on_update(self._server.gui.add_checkbox(label, now), field, bool)

    def _on_update(
        self, control: Any, field: str, read: Callable[[Any], Any], is_inside: Callable[[Any], bool] = lambda _: True
    ) -> None:
        """Hand a control's values to the session; messages with values that `Settings` refuses are ignored."""

        def can_have(value: Any) -> bool:
            try:
                replace(self.session.wanted.settings, **{field: read(value)})
                return is_inside(value)
            except (InputError, TypeError, ValueError, LookupError, OverflowError):
                return False

        async def changed(event: GuiEvent) -> None:
            self.session.want(**{field: read(event.target.value)})
            self._show_folders()

        self._messages.controls[uuid_of(control)] = can_have
        control.on_update(changed)


def camera_file(request: Request) -> str:
    """A JSON file of the camera."""
    camera = request.camera
    fields = ("eye", "target", "up", "fov_y_degrees", "width", "height")
    return json.dumps({"view": {name: getattr(camera, name) for name in fields}}, indent=2)


def say_numbers(frame: Frame, since_s: float | None) -> str:
    """What the panel says of a frame, in Markdown. since_s: after the frame before it, if that was moving, too."""
    request, picture = frame.request, frame.picture
    camera, stage_s = request.camera, picture.stage_s
    if not stage_s:
        return picture.note
    size = f"{camera.width} x {camera.height}"
    if frame.samples:
        lines = [f"**{frame.samples} of {request.settings.enough} samples**, {size}"]
    else:
        rate = f", {1.0 / since_s:.0f} frames/s" if since_s else ""
        lines = [f"**moving**{rate}, {size}"]
    lines += [picture.note] if picture.note else []
    lines.append("ms: " + ", ".join(f"{name.replace('_', ' ')} {1e3 * s:.1f}" for name, s in stage_s.items()))
    pixels, primary_s, whole_s = camera.width * camera.height, stage_s.get("primary", 0.0), sum(stage_s.values())
    if primary_s > 1e-5:  # or its hits are kept
        lines.append(f"primary: {1e-6 * pixels / primary_s:.1f} million rays/s")
    if whole_s > 0.0:
        lines.append(f"whole: {1e-6 * pixels / whole_s:.2f} million pixel samples/s")
    return "\n\n".join(lines)
