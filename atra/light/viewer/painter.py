"""A painter: draws requests with the renderers and tracers of `atra`, and colours what they see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.hits import Hits
from atra.judge.compare import compare
from atra.judge.marks import mark_verdicts
from atra.light import HybridRenderer, PathRenderer, Scene, Sun
from atra.light.pictures.files import srgb_of
from atra.light.pictures.finish.tone import toned
from atra.light.pictures.renderer import Renderer
from atra.light.viewer.request import OF_HITS, WITH_CELLS, Request, Settings
from atra.light.viewer.session import Picture
from atra.methods import METHODS
from atra.packets.pixel import PixelTracer
from atra.raster.tracer import RasterTracer

BACKGROUND = (236, 238, 241)
"""RGB of a miss."""

_COLOUR_STEPS = np.array([0x9E3779B1, 0x85EBCA77, 0xC2B2AE3D], np.uint32)
"""Odd numbers without a pattern: neighbours in the mesh get colours that are far apart."""


class Painter:
    """The artist of a `Session`: sketches by the rasteriser, pictures by the renderer and the method asked for.

    scene: its first sun is the request's, its sky has the request's power; its other lights stay. threads: of all
    tracers and renderers, None = every core.
    """

    def __init__(self, scene: Scene, threads: int | None = None) -> None:
        self._scene, self._threads = scene, threads
        self._lit: tuple[object, Scene] = (None, scene)
        self._sketcher: Renderer | None = None
        self._made: tuple[object, Renderer] | None = None
        self._denoised: tuple[Request, NDArray[np.float32]] | None = None

    def sketch(self, request: Request) -> Picture:
        """One hybrid frame of the rasteriser, without shadows."""
        settings, scene = request.settings, self._scene_of(request.settings)
        sketcher = self._sketcher
        if sketcher is None:
            primary = partial(RasterTracer, threads=self._threads, ties="any")
            sketcher = HybridRenderer(
                scene, request.camera, primary, threads=self._threads, shadow_rays=0, jitter="off"
            )
            self._sketcher = sketcher.__enter__()
        start = perf_counter()
        rays = {"shadow_rays": 0, "occlusion_rays": int(settings.shade == "occlusion")}
        sketcher.update(scene, occlusion_length=settings.occlusion_length, **rays)
        sketcher.look(request.camera)
        if settings.shade in OF_HITS:
            hits = sketcher.tracer.trace()
            traced = perf_counter()
            image = _coloured(hits, "depth" if settings.shade == "wrong" else settings.shade)
            return Picture(image, {"primary": traced - start, "shade": perf_counter() - traced})
        sketcher.add(1)
        image = _light(sketcher, settings)
        stages = {name: seconds for name, seconds in sketcher.stage_s.items() if name != "other"}
        return Picture(image, stages | {"other": perf_counter() - start - sum(stages.values())})

    def add(self, request: Request, stop: Callable[[], bool]) -> int:
        """One more sample, unless stopped; returns their number."""
        renderer = self._renderer(request)
        self._denoised = None
        renderer.add(1, stop)
        return renderer.samples

    def show(self, request: Request) -> Picture:
        """What has been added, or what its primary rays hit."""
        renderer, shade = self._renderer(request), request.settings.shade
        if shade == "material" and request.settings.denoise and renderer.samples >= request.settings.enough:
            return self._without_noise(renderer, request)
        if shade not in OF_HITS:
            return Picture(_light(renderer, request.settings), renderer.stage_s)
        hits = renderer.tracer.trace()
        if shade != "wrong":
            return Picture(_coloured(hits, shade), renderer.stage_s)
        with PixelTracer(hits.mesh, request.camera, packet_width=1, threads=self._threads) as single:
            agreement = compare(hits, single.trace())
        return Picture(mark_verdicts(agreement.verdict), renderer.stage_s, f"against `rtcIntersect1`: {agreement}")

    def _without_noise(self, renderer: Renderer, request: Request) -> Picture:
        """The picture denoised, once for all exposures and tone maps; where that cannot be done, with its noise and a
        note of why."""
        settings, start = request.settings, perf_counter()
        light = replace(request, settings=replace(settings, exposure=0.0, tone="none"))
        if self._denoised is None or self._denoised[0] != light:
            try:
                self._denoised = light, renderer.denoised()
            except AtraError as error:
                return Picture(_light(renderer, settings), renderer.stage_s, str(error))
        image = srgb_of(toned(self._denoised[1], settings.exposure, settings.tone))
        return Picture(image, renderer.stage_s | {"denoise": perf_counter() - start})

    def close(self) -> None:
        """Let go of all that was built."""
        for renderer in (self._sketcher, self._made and self._made[1]):
            if renderer is not None:
                renderer.close()
        self._sketcher = self._made = None

    def _renderer(self, request: Request) -> Renderer:
        """The renderer of the request; what an earlier request added stays where it may."""
        settings, scene, camera = request.settings, self._scene_of(request.settings), request.camera
        made_for = settings.renderer, settings.method, settings.split_x
        options = _options(settings)
        if self._made is not None and self._made[0] == made_for:
            self._made[1].update(scene, **options)
            self._made[1].look(camera)
            return self._made[1]
        if self._made is not None:
            self._made[1].close()
            self._made = None
        primary = partial(self._primary, settings)
        kind = HybridRenderer if settings.renderer == "hybrid" else PathRenderer
        renderer = kind(scene, camera, primary, threads=self._threads, **options).__enter__()
        self._made = made_for, renderer
        return renderer

    def _primary(self, settings: Settings, mesh: Mesh, view: View) -> Any:
        options: dict[str, Any] = {"split": (settings.split_x, 1)} if settings.method in WITH_CELLS else {}
        return METHODS[settings.method](mesh, view, threads=self._threads, **options)

    def _scene_of(self, settings: Settings) -> Scene:
        """The scene in this light; the same value for the same light, which renderers take for no change."""
        red, green, blue = (channel / 255.0 for channel in settings.sun_colour)
        sun = Sun(settings.sun_direction, settings.sun_cone, (red, green, blue), settings.sun_power)
        light = sun, settings.sky_power
        if self._lit[0] != light:
            sky = replace(self._scene.sky, power=settings.sky_power)
            own = next((one for one in self._scene.lights if isinstance(one, Sun)), None)
            others = [one for one in self._scene.lights if one is not own]
            suns = [sun] if sun.power > 0.0 else []
            self._lit = light, replace(self._scene, lights=[*suns, *others], sky=sky)
        return self._lit[1]


def _options(settings: Settings) -> dict[str, Any]:
    options: dict[str, Any] = {"jitter": "shared" if settings.jitter else "off"}
    if settings.renderer == "path":
        return options | {"bounces": settings.bounces}
    names = ("shadow_rays", "shadow_length", "occlusion_rays", "occlusion_length")
    chosen: dict[str, Any] = {"occlusion": "cosine" if settings.cosine else "uniform"}
    return options | chosen | {name: getattr(settings, name) for name in names}


def _light(renderer: Renderer, settings: Settings) -> NDArray[np.uint8]:
    if settings.shade == "occlusion":
        return srgb_of(np.broadcast_to(renderer.openness[..., None], (*renderer.openness.shape, 3)))
    return srgb_of(toned(renderer.image, settings.exposure, settings.tone))


def _coloured(hits: Hits, shade: str) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: normals as colours, near depths light and far ones dark, or a colour for each triangle."""
    if shade == "normal":
        with np.errstate(invalid="ignore"):  # of misses, which have none
            colours = (127.5 * (hits.normals + np.float32(1.0))).astype(np.uint8)
    elif shade == "depth":
        near = 0.2 * float(np.linalg.norm(np.ptp(hits.mesh.bounds, axis=0)))
        grey = 255.0 / (1.0 + hits.depth / np.float32(near))
        colours = np.repeat(grey.astype(np.uint8)[..., None], 3, axis=2)
    else:
        colours = ((hits.prim_id[..., None] + np.uint32(1)) * _COLOUR_STEPS >> 24).astype(np.uint8)
    colours[~hits.hit] = BACKGROUND
    return colours
