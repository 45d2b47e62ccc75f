"""`python run.py view`: a scene, ready to be walked through on a page of the browser."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from math import atan2, degrees, hypot
from pathlib import Path
from typing import Any

import numpy as np

from atra.command.picture import load_lit
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.light import PanoramaSky, Scene, Sun
from experiments.harness.configuration import Configuration
from experiments.harness.method import Tracing
from experiments.harness.points import camera_fields_of
from experiments.viewer.page import Page
from experiments.viewer.painter import Painter
from experiments.viewer.request import COLUMNS, SPLITS, Pose, Request, Settings
from scenes.lit.lighting import WITH_MATERIALS, lit, why_grey
from scenes.loading import SceneSource, load_scene
from scenes.scene import Scene as LoadedScene


def run_view(configuration: Configuration) -> None:
    """Show the configured scene until Ctrl-C, or until its page is closed; says where on stdout.

    Raises InputError for what `load_scene`, `Camera` and `PanoramaSky.load` refuse, for a split that pages have no
    width for, and as `Page` does.
    """
    given = configuration.scene
    scene = load_scene(given.source, given.name, given.path, given.subdivided, given.copies)
    camera = Camera(**camera_fields_of(given, scene))
    size = _rounded(float(np.linalg.norm(np.ptp(scene.mesh.bounds, axis=0))))
    chosen = configuration.method
    split_x = getattr(chosen.options, "split_x", None) or COLUMNS
    if split_x not in SPLITS:
        raise InputError(f"method.split_x is {split_x}, expected one of {', '.join(map(str, SPLITS))} in the viewer")
    pose = Pose(camera.eye, camera.target, camera.up, camera.fov_y_degrees)
    shown = _lit(given, scene, camera)
    if configuration.view.sky is not None:
        shown = replace(shown, sky=PanoramaSky.load(Path(configuration.view.sky).expanduser()))
    settings = Settings(
        method=chosen.name,
        split_x=split_x,
        frame="path" if _has_own_light(given, scene) else "hybrid",
        shadow_length=_rounded(2.0 * size),
        occlusion_length=_rounded(0.1 * size),
        tone=configuration.view.tone,
        denoise=configuration.view.denoise,
        **light_settings(shown),
    )
    first = Request(pose, settings)
    tracing = Tracing(configuration.threads, configuration.build_quality, configuration.ties)
    painter = Painter(shown, chosen, tracing)
    with (
        contextlib.suppress(KeyboardInterrupt),
        contextlib.closing(painter),
        contextlib.closing(Page(painter, first, configuration.view.port, scene.name, size)) as page,
    ):
        print("viewer: preparing; a first start compiles kernels, which takes about a minute", flush=True)
        page.prepare()
        print(f"viewer: {page.address} shows {scene.name}; Ctrl-C ends it", flush=True)
        page.run()
    print("viewer: ended")


def _has_own_light(given: Any, scene: LoadedScene) -> bool:
    """Whether paths show it as it is meant: grey scenes may be closed rooms, black inside."""
    return given.source is SceneSource.file or (scene.name in WITH_MATERIALS and not why_grey(scene.name, scene.mesh))


def _lit(given: Any, scene: LoadedScene, camera: Camera) -> Scene:
    """The scene in light: a file's own materials and lights, as `atra render` lights them, unless it is enlarged."""
    if given.source is SceneSource.file and given.subdivided == 0 and given.copies == 1:
        return load_lit(Path(given.path).expanduser())
    if (grey := why_grey(scene.name, scene.mesh)) is not None:
        print(f"viewer: {grey}", flush=True)
    return lit(scene.name, scene.mesh, camera)


def light_settings(scene: Scene) -> dict[str, Any]:
    """Fields of `Settings`: the scene's own first sun, to a degree, or none, and its sky."""
    found: dict[str, Any] = {"sky_power": scene.sky.power, "sun_power": 0.0}
    for sun in [one for one in scene.lights if isinstance(one, Sun)][:1]:
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
