"""Hybrid rendering: primary visibility by any method, and rays for soft shadows and ambient occlusion."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from time import perf_counter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.kernels.shading.aiming import LIGHT_WORDS, Aim
from atra.kernels.shading.gbuffer import Chunk, new_chunk
from atra.kernels.shading.lighting import LIGHT_PLANES, SKY_PLANES, STAGES, lighting_kernel
from atra.kernels.shading.paths import Pixels
from atra.kernels.shading.surface import Surfaces
from atra.rays.scene import Query
from atra.render.lights import light_row
from atra.render.materials import Dielectric, Emissive, Lambertian, Material
from atra.render.options import HybridOptions
from atra.render.renderer import Renderer, unlike_but_for
from atra.render.scene import RenderScene
from atra.render.tables import surfaces_of


class _Sequence(NamedTuple):
    """Points of rays. steps: by what they move from one to the next, in units of 2^-32 of the unit square. dimension:
    of the hash that shifts them."""

    steps: tuple[int, int]
    dimension: int


def _steps(*primes: int) -> tuple[int, int]:
    x, y = (int(sqrt(prime) % 1.0 * 2**32) for prime in primes)
    return x, y


_SKY, _LIGHT = _Sequence(_steps(2, 3), 0), _Sequence(_steps(5, 7), 2)
"""Steps are no rational multiples of each other, nor of the steps of `sub_pixel_offsets`, so that all of them together
are spread evenly."""


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

    _ray_bytes = 0  # a few hundred rays are held at a time

    @property
    def _planes(self) -> int:
        return SKY_PLANES + LIGHT_PLANES * len(self.scene.lights)

    def _tables(self) -> Surfaces:
        rows = [light_row(light) for light in self.scene.lights]
        self._lights = np.array(rows, np.float32).reshape(-1, LIGHT_WORDS)
        plain = tuple(map(_as_colour, self.scene.materials))
        return surfaces_of(replace(self.scene, materials=plain), 1.0, self.options.start_off)

    def _start_film(self) -> None:
        super()._start_film()
        self._chunks: list[Chunk | None] = [None] * self.rays.threads

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
        options, start = self.options, perf_counter()
        chunk = self._chunks[query.worker]
        if chunk is None:
            chunk = self._chunks[query.worker] = new_chunk()
        to_lights = self._aim(options.shadow_rays, options.shadow_length, options.shadow_directions, _LIGHT)
        into_sky = self._aim(options.occlusion_rays, options.occlusion_length, options.occlusion_directions, _SKY)
        times = np.zeros(len(STAGES), np.int64)
        rays = lighting_kernel(self.rays.packet_width)(
            first, count, pixels, self._surfaces, self._lights, to_lights, into_sky, options.occlusion == "cosine",
            query, chunk, self._film.sums, times,
        )  # fmt: skip
        taken_s = (perf_counter() - start) / times.sum()
        for stage, ticks in zip(STAGES, times.tolist(), strict=True):
            if ticks:
                stages[stage] = stages.get(stage, 0.0) + ticks * taken_s
        return None if rays < 0 else rays

    def _aim(self, rays: int, length: float, directions: str, sequence: _Sequence) -> Aim:
        """Of the rays of this sample; of one, to the light's middle or any, where none is traced."""
        numbers = range(self.samples * rays, (self.samples + 1) * rays)
        places = [[number * step + (1 << 31) & 0xFFFFFFFF for step in sequence.steps] for number in numbers]
        is_shifted = directions == "shifted" and rays > 0
        return Aim(
            np.array(places or [[0, 0]], np.uint32), sequence.dimension, is_shifted, rays > 0, np.float32(length)
        )


def _as_colour(material: Material) -> Lambertian:
    if isinstance(material, Dielectric):
        return Lambertian((1.0, 1.0, 1.0))
    if isinstance(material, Emissive):
        red, green, blue = material.colour
        return Lambertian((min(red, 1.0), min(green, 1.0), min(blue, 1.0)))
    return Lambertian(material.colour)
