"""Hybrid rendering: primary visibility by any method, and rays for soft shadows and ambient occlusion."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.kernels.shading.gbuffer import COLOUR, SKY, WAVE_ROWS, Wave, find_surfaces
from atra.kernels.shading.lighting import (
    LIGHT_PLANES,
    SKY_PLANES,
    Sample,
    add_light,
    aim_at_light,
    aim_into_sky,
    occlude_kernel,
)
from atra.kernels.shading.paths import ROW_PADDING, Pixels
from atra.kernels.shading.surface import Surfaces
from atra.rays.scene import Query
from atra.render.lights import light_row
from atra.render.materials import Dielectric, Emissive, Lambertian, Material
from atra.render.options import HybridOptions
from atra.render.renderer import Laps, Renderer, unlike_but_for
from atra.render.scene import RenderScene
from atra.render.tables import surfaces_of

_SKY_STEPS, _LIGHT_STEPS = (tuple(int(sqrt(prime) % 1.0 * 2**32) for prime in pair) for pair in ((2, 3), (5, 7)))
"""What the points of rays move by from one to the next, in units of 2^-32 of the unit square: no rational multiples of
each other, nor of the steps of `sub_pixel_offsets`, so that all of them together are spread evenly."""

_SKY_DIMENSION, _LIGHT_DIMENSION = 0, 2


class HybridRenderer(Renderer):
    """Pictures from what is seen, lit by the scene's lights and its sky.

        with atra.render.HybridRenderer(scene, camera, occlusion_length=2.0) as renderer:
            renderer.add(64)
            renderer.save("picture.png")

    A surface returns colour x (light x cosine x its share that is not in shadow + sky where its normal points x the
    share that is not occluded), of every light. Each material is its colour alone: glass is white, and a lamp is as
    bright as its colour, at most white. Arguments: see `Renderer`; options: of `HybridOptions`.
    Stages: primary, surfaces, generate, shadow, occlusion, accumulate.
    """

    options_type = HybridOptions
    options: HybridOptions

    @property
    def _planes(self) -> int:
        return SKY_PLANES + LIGHT_PLANES * len(self.scene.lights)

    def _tables(self) -> Surfaces:
        self._lights = [light_row(light) for light in self.scene.lights]
        plain = tuple(map(_as_colour, self.scene.materials))
        return surfaces_of(replace(self.scene, materials=plain), 1.0, self.options.start_off)

    def _start_film(self) -> None:
        super()._start_film()
        self._waves: list[Wave | None] = [None] * self.rays.threads

    def _same_sums(self, scene: RenderScene) -> bool:
        old = self.scene
        for name in ("face_materials", "normals", "uv"):
            if not np.array_equal(getattr(scene, name), getattr(old, name)):
                return False
        if scene.materials != old.materials or len(scene.lights) != len(old.lights):
            return False
        if unlike_but_for(scene.sky, old.sky, "power"):
            return False
        pairs = zip(scene.lights, old.lights, strict=True)
        return not any(unlike_but_for(new, light, "colour", "power") for new, light in pairs)

    def _mean(self) -> NDArray[np.float64]:
        image = self.scene.sky.power * self._film.mean(slice(3))
        for number, light in enumerate(self.scene.lights):
            first = SKY_PLANES + number * LIGHT_PLANES
            image += light.power * np.array(light.colour)[:, None] * self._film.mean(slice(first, first + 3))
        return image

    @property
    def openness(self) -> NDArray[np.float32]:
        """(H, W) float32, the share of rays into the sky that nothing stopped, 1 where nothing is seen."""
        return self._share(3)

    def lit(self, light: int = 0) -> NDArray[np.float32]:
        """(H, W) float32, the share of rays to a light of the scene that nothing stopped; 0 on surfaces turned away
        from it, and where nothing is seen. Raises InputError for a light that is not there."""
        if not 0 <= light < len(self.scene.lights):
            raise InputError(f"light is {light!r}, but the scene has {len(self.scene.lights)}, counted from 0")
        return self._share(SKY_PLANES + light * LIGHT_PLANES + 3)

    def _share(self, plane: int) -> NDArray[np.float32]:
        with self._lock:
            return self._film.as_image(self._film.mean(slice(plane, plane + 1)))[..., 0]

    def _add_wave(self, first: int, count: int, pixels: Pixels, query: Query, stages: dict[str, float]) -> int | None:
        options = self.options
        wave = self._waves[query.worker]
        if wave is None:
            wave = self._waves[query.worker] = _new_wave(options.wave_rays)
        occlude = partial(occlude_kernel(self.rays.packet_width), wave, count, query.scene, query.packet, query.flags)
        lap = Laps(stages)
        find_surfaces(wave, first, count, pixels, self._surfaces)
        lap("surfaces")
        is_finite, rays = True, 0
        length = np.float32(options.shadow_length)
        for number, light in enumerate(self._lights):
            plane = SKY_PLANES + number * LIGHT_PLANES
            for sample in self._points(options.shadow_rays, _LIGHT_STEPS, _LIGHT_DIMENSION, options.shadow_directions):
                aim_at_light(wave, first, count, light, length, sample)
                lap("generate")
                if options.shadow_rays:
                    rays += occlude(True)
                    lap("shadow")
                sums = self._film.sums[plane : plane + LIGHT_PLANES]
                is_finite &= add_light(wave, first, count, COLOUR, _share_of(options.shadow_rays), sums)
                lap("accumulate")
        length = np.float32(options.occlusion_length if options.occlusion_rays else 0.0)
        for sample in self._points(options.occlusion_rays, _SKY_STEPS, _SKY_DIMENSION, options.occlusion_directions):
            aim_into_sky(wave, first, count, length, options.occlusion == "cosine", sample)
            lap("generate")
            if options.occlusion_rays:
                rays += occlude(options.occlusion_directions == "shared")
                lap("occlusion")
            share = _share_of(options.occlusion_rays)
            is_finite &= add_light(wave, first, count, SKY, share, self._film.sums[:SKY_PLANES])
            lap("accumulate")
        return rays if is_finite else None

    def _points(self, rays: int, steps: tuple[int, ...], dimension: int, directions: str) -> list[Sample]:
        """Of the rays of this sample; of one, the light's middle or any, where none is traced."""
        if not rays:
            return [Sample(0, 0, 0, False)]
        numbers = range(self.samples * rays, (self.samples + 1) * rays)
        places = [[number * step + (1 << 31) & 0xFFFFFFFF for step in steps] for number in numbers]
        return [Sample(u, v, dimension, directions == "shifted") for u, v in places]


def _share_of(rays: int) -> np.float32:
    """Of one ray; where none is traced, one stands for all."""
    return np.float32(1.0 / max(1, rays))


def _as_colour(material: Material) -> Lambertian:
    if isinstance(material, Dielectric):
        return Lambertian((1.0, 1.0, 1.0))
    if isinstance(material, Emissive):
        red, green, blue = material.colour
        return Lambertian((min(red, 1.0), min(green, 1.0), min(blue, 1.0)))
    return Lambertian(material.colour)


def _new_wave(rays: int) -> Wave:
    return Wave(
        np.zeros((WAVE_ROWS, rays + ROW_PADDING), np.float32),
        np.zeros(rays + ROW_PADDING, np.uint32),
        np.zeros(rays + ROW_PADDING, np.int32),
        np.zeros(rays + ROW_PADDING, np.float32),
        np.zeros(rays + ROW_PADDING, np.float32),
    )
