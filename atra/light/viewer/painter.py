"""A painter: draws requests with the renderers and tracers of `atra`, and colours what they see."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError
from atra.files.saving import PREVIEWS
from atra.hits import Hits
from atra.judge.compare import compare
from atra.judge.marks import mark_verdicts
from atra.light import HybridRenderer, PathRenderer, Scene, Sun
from atra.light.pictures.files import srgb_of
from atra.light.pictures.finish.tone import toned
from atra.light.pictures.renderer import Renderer
from atra.light.viewer.request import OF_HITS, Request, Settings
from atra.light.viewer.session import Picture
from atra.methods import METHODS
from atra.packets.pixel import PixelTracer
from atra.raster.tracer import RasterTracer

BACKGROUND = (236, 238, 241)
"""RGB of a miss."""

_OPTIONS = {
    "hybrid": ("jitter", "shadow_rays", "shadow_length", "occlusion_rays", "occlusion_length", "occlusion"),
    "path": ("jitter", "bounces"),
}
"""Settings that are options of a renderer."""

_PREVIEW_OF = {"normal": "preview_normals", "depth": "preview", "prim_id": "preview_ids"}
"""Planes of `atra render` by the shades of hits."""


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
        if self._sketcher is None:
            primary = partial(RasterTracer, threads=self._threads, ties="any")
            self._sketcher = HybridRenderer(
                scene, request.camera, primary, threads=self._threads, shadow_rays=0, jitter="off"
            )
        rays = int(settings.shade == "occlusion")
        self._sketcher.update(scene, occlusion_length=settings.occlusion_length, occlusion_rays=rays)
        self._sketcher.look(request.camera)
        if settings.shade in OF_HITS:
            shade = "depth" if settings.shade == "wrong" else settings.shade
            return Picture(_coloured(self._sketcher.tracer.trace(), shade), {})
        self._sketcher.add(1)
        return Picture(_light(self._sketcher, settings), {})

    def add(self, request: Request, stop: Callable[[], bool]) -> int:
        """One more sample, unless stopped; returns their number."""
        renderer = self._renderer(request)
        self._denoised = None
        renderer.add(1, stop)
        return renderer.samples

    def show(self, request: Request) -> Picture:
        """What has been added, or what its primary rays hit."""
        renderer, settings, shade = self._renderer(request), request.settings, request.settings.shade
        if shade == "material" and settings.denoise and renderer.samples >= settings.enough:
            return self._without_noise(renderer, request)
        if shade not in OF_HITS:
            return Picture(_light(renderer, settings), renderer.stage_s)
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

    def _renderer(self, request: Request) -> Renderer:
        """The renderer of the request; what an earlier request added stays where it may."""
        settings, scene, camera = request.settings, self._scene_of(request.settings), request.camera
        options = {name: getattr(settings, name) for name in _OPTIONS[settings.renderer]}
        made_for = settings.renderer, settings.method, settings.split_x
        if self._made is not None and self._made[0] == made_for:
            self._made[1].update(scene, **options)
            self._made[1].look(camera)
            return self._made[1]
        if self._made is not None:
            self._made[1].close()
            self._made = None
        split = {"split": (settings.split_x, 1)} if settings.method in ("aligned", "visible_first") else {}
        primary = partial(METHODS[settings.method], threads=self._threads, **split)
        kind = HybridRenderer if settings.renderer == "hybrid" else PathRenderer
        self._made = made_for, kind(scene, camera, primary, threads=self._threads, **options)
        return self._made[1]

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


def _light(renderer: Renderer, settings: Settings) -> NDArray[np.uint8]:
    if settings.shade == "occlusion":
        return srgb_of(np.broadcast_to(renderer.openness[..., None], (*renderer.openness.shape, 3)))
    return srgb_of(toned(renderer.image, settings.exposure, settings.tone))


def _coloured(hits: Hits, shade: str) -> NDArray[np.uint8]:
    """(H, W, 3) uint8: normals as colours, near depths light and far ones dark, or a colour for each triangle."""
    plane, preview = PREVIEWS[_PREVIEW_OF[shade]]
    shown = preview(getattr(hits, plane))
    colours = np.array(np.broadcast_to(shown.reshape(*hits.depth.shape, -1), (*hits.depth.shape, 3)))
    colours[~hits.hit] = BACKGROUND
    return colours
