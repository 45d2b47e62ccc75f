"""`atra view MESH`: a scene with its materials and lights, ready to be walked through on a page of the browser."""

from __future__ import annotations

import contextlib
from argparse import ArgumentParser, Namespace
from math import atan2, degrees, hypot
from typing import TYPE_CHECKING, Any

import numpy as np

from atra.command.cameras import one_camera
from atra.command.picture import add_limits, add_scene, add_shown, load_lit
from atra.errors import printable

if TYPE_CHECKING:
    from atra.light import Scene

PORT = 8080
METHODS = ("raster", "pixel", "aligned", "visible_first")
"""Names of `atra.METHODS`, which takes time to import."""


def add_page(parser: ArgumentParser) -> None:
    """Add the option of a page."""
    parser.add_argument("--port", type=int, default=PORT, help=f"port of the page, 0 = any (default: {PORT})")


def add_view(parser: ArgumentParser) -> None:
    """Add the arguments of `run_view`."""
    parser.usage = "atra view MESH [--option value ...], as in: atra view model.glb --port 0"
    add_scene(parser)
    add_page(parser)
    parser.add_argument(
        "--method", choices=METHODS, default=METHODS[0], help=f"primary visibility at rest (default: {METHODS[0]})"
    )
    add_shown(parser)
    add_limits(parser)


def run_view(given: Namespace) -> int:
    """Show the scene until Ctrl-C, or until its page is closed; prints where. Returns 0.

    Raises InputError for files that cannot be used, and as `Page` does.
    """
    from atra.light.checks import check_whole
    from atra.light.viewer.page import Page
    from atra.light.viewer.painter import Painter
    from atra.light.viewer.request import Pose, Request, Settings

    check_whole("port", given.port, 0, 65535)
    scene = load_lit(given.mesh, given.sky, given.memory_per_byte, given.sky_rotation)
    camera = one_camera(given, scene.mesh, dict(scene.cameras))
    size = float(np.linalg.norm(np.ptp(scene.mesh.bounds, axis=0)))
    settings = Settings(
        method=given.method,
        frame="path",
        shadow_length=_rounded(2.0 * size),
        occlusion_length=_rounded(0.1 * size),
        tone=given.tone,
        denoise=given.denoise,
        **light_settings(scene),
    )
    first = Request(Pose(camera.eye, camera.target, camera.up, camera.fov_y_degrees), settings)
    name = printable(given.mesh.name)
    with (
        contextlib.suppress(KeyboardInterrupt),
        contextlib.closing(Painter(scene, given.threads)) as painter,
        contextlib.closing(Page(painter, first, given.port, name, size)) as page,
    ):
        print("viewer: preparing; a first start compiles kernels, which takes about a minute", flush=True)
        page.session.step()  # so that a picture is there when a page is
        print(f"viewer: {page.address} shows {name}; Ctrl-C ends it", flush=True)
        page.session.run()
    print("viewer: ended")
    return 0


def light_settings(scene: Scene) -> dict[str, Any]:
    """Fields of `Settings`: the scene's own first sun, to a degree, or none, and its sky."""
    from atra.light import Sun

    found: dict[str, Any] = {"sky_power": scene.sky.power, "sun_power": 0.0}
    for sun in [light for light in scene.lights if isinstance(light, Sun)][:1]:
        x, y, z = -np.array(sun.direction) / np.linalg.norm(sun.direction)
        red, green, blue = (round(255 * min(channel, 1.0)) for channel in sun.colour)
        found |= {
            "sun_heading": float(round(degrees(atan2(x, z)))),
            "sun_height": float(round(degrees(atan2(y, hypot(x, z))))),
            "sun_cone": sun.angle_degrees,
            "sun_colour": (red, green, blue),
            "sun_power": sun.power,
        }
    return found


def _rounded(length: float) -> float:
    """To two digits, for people who see it beside a slider."""
    return float(f"{length:.2g}")
