"""Hybrid rendering: primary visibility by any tracer, and rays for soft shadows and ambient occlusion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from math import inf, sqrt
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.geometry.view import View
from atra.light.emitters.panels import Panel, panels_of
from atra.light.lights import Light, light_row
from atra.light.lights_kernels import LIGHT_WORDS
from atra.light.pictures.aiming_kernels import Aim
from atra.light.pictures.gbuffer_kernels import Chunk, new_chunk
from atra.light.pictures.lighting_kernels import LIGHT_PLANES, SKY_PLANES, STAGES, lighting_kernel
from atra.light.pictures.options import HybridOptions
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.pictures.renderer import Primary, Renderer, unlike_but_for
from atra.light.scattering.diffuse import shown_of
from atra.light.scene import Scene
from atra.light.surface_kernels import Surfaces
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import Query


def _steps(*primes: int) -> tuple[int, int]:
    x, y = (int(sqrt(prime) % 1.0 * 2**32) for prime in primes)
    return x, y


_SKY, _LIGHT = _steps(2, 3), _steps(5, 7)
"""Steps between consecutive sample points, in units of 2^-32 of the unit square.

No step is a rational multiple of another or of a step of `sub_pixel_offsets`, so all points together are evenly
spread.
"""


class HybridRenderer(Renderer):
    """Pictures of what is seen, lit by the scene's lights and sky.

        with atra.light.HybridRenderer(scene, camera, occlusion_length=2.0) as renderer:
            renderer.add(64)
            renderer.save("picture.png")

    A surface reflects colour x (light x cosine x its unshadowed share, summed over lights, + sky x the unoccluded
    share), and shows what it emits. Sky: of a gradient in its normal's direction; of a panorama all light that arrives
    there. Materials show their plain colour; clear glass lets the eye and light straight on, uncoloured.
    Shining surfaces light others as rectangles or spheres of their area, the eight most powerful. Points on lights are
    the same for all pixels, which Embree traces faster; directions into the sky are shifted per pixel: noise, no bands.
    Stages: primary, surfaces, generate, shadow, occlusion, accumulate.

    Parameters
    ----------
    scene, camera, primary :
        As for `Renderer`.
    threads, packet_width, build_quality, robust :
        Of the scene for all rays but the primary ones, as for `atra.PixelTracer`.
    jitter : {"shared", "off"}
        Sub-pixel offset of rays: one for all pixels, new for each sample; or the centre.
    most_samples : int, optional
        Most samples of a picture; None: any number.
    shadow_rays, occlusion_rays : int
        Rays to each light, and into the sky, per sample: 0 to 64. With 0 there is no shadow, or no occlusion.
    shadow_length, occlusion_length : float
        Largest distance at which a thing casts a shadow, or occludes; scene units.
    occlusion : {"uniform", "cosine"}
        Weight of directions in the hemisphere.

    Raises
    ------
    InputError
        For an option's value.

    Examples
    --------
    >>> import atra
    >>> from atra import light
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> camera = atra.Camera.framing(mesh, width=64, height=48)
    >>> scene = light.Scene.plain(mesh, 0.7, lights=[light.Sun((0, 0, -1))])
    >>> with light.HybridRenderer(scene, camera) as renderer:
    ...     done = renderer.add(4)
    ...     image = renderer.image
    >>> image.shape
    (48, 64, 3)
    """

    options: HybridOptions

    _sets_sums = True
    _wave_rays = 512 * BLOCK

    def __init__(
        self, scene: Scene, camera: View, primary: Primary | None = None, *,
        threads: int | None = None, packet_width: int | None = None, build_quality: str = "medium", robust: bool = True,
        jitter: str = "shared", most_samples: int | None = 512, shadow_rays: int = 1, shadow_length: float = inf,
        occlusion_rays: int = 1, occlusion_length: float = 10.0, occlusion: str = "uniform",
    ) -> None:  # fmt: skip
        options = HybridOptions(
            threads, build_quality, robust, jitter, most_samples, packet_width, shadow_rays,
            shadow_length, occlusion_rays, occlusion_length, occlusion,
        )  # fmt: skip
        self._panels_of: tuple[Scene | None, list[Panel]] = None, []
        super().__init__(scene, camera, primary, options)

    @property
    def _planes(self) -> int:
        return SKY_PLANES + LIGHT_PLANES * (len(self._lit_by) + bool(self._panels))

    @property
    def _panels(self) -> list[Panel]:
        """Lights that stand for the scene's shining surfaces."""
        if self._panels_of[0] is not self.scene:
            self._panels_of = self.scene, panels_of(self.scene)
        return self._panels_of[1]

    @property
    def _lit_by(self) -> list[Light | Panel]:
        return [*self.scene.local.lights, *self._panels]

    def _tables(self) -> Surfaces:
        rows = [light.row if isinstance(light, Panel) else light_row(light) for light in self._lit_by]
        self._lights = np.array(rows, np.float32).reshape(-1, LIGHT_WORDS)
        shown = tuple(shown_of(material) for material in self.scene.materials)
        return surfaces_of(replace(self.scene, materials=shown), 1.0)

    def _start_film(self) -> None:
        super()._start_film()
        self._chunks: list[Chunk | None] = [None] * self.rays.threads

    def _same_sums(self, scene: Scene) -> bool:
        old = self.scene
        for name in ("face_materials", "normals", "uv", "second_uv", "colours"):
            if not np.array_equal(getattr(scene, name), getattr(old, name)):
                return False
        if scene.materials != old.materials or len(scene.lights) != len(old.lights):
            return False
        if unlike_but_for(scene.sky, old.sky, "power"):
            return False
        pairs = zip(scene.lights, old.lights, strict=True)
        return not any(unlike_but_for(new, light, "colour", "power") for new, light in pairs)

    def _parts(self) -> Iterator[NDArray[np.float64]]:
        yield self.scene.sky.power * self._film.mean(slice(3))
        first, shining = SKY_PLANES, []
        for light in self._lit_by:
            part = light.power * np.array(light.colour)[:, None] * self._film.mean(slice(first, first + 3))
            if isinstance(light, Panel):
                shining.append(part)
            else:
                yield part
            first += LIGHT_PLANES
        if shining:
            yield reduce(np.add, shining, self._film.mean(slice(first, first + 3)))

    def _mean(self) -> NDArray[np.float64]:
        return reduce(np.add, self._parts())

    @property
    def parts(self) -> NDArray[np.float32]:
        """(N, H, W, 3) float32: the image split into the sky's light, each light's, and, if there are any, that of all
        surfaces that shine."""
        with self._lock:
            return self._lens_pixels.blackened(np.stack([self._film.as_image(part) for part in self._parts()]))

    @property
    def openness(self) -> NDArray[np.float32]:
        """(H, W) float32, share of rays into the sky that nothing blocked; 1 for a miss."""
        return self._share(3)

    def lit(self, light: int = 0) -> NDArray[np.float32]:
        """(H, W) float32, share of rays to a light that nothing blocked; 0 on surfaces facing away and for a miss.
        Raises InputError for an unknown light."""
        with self._lock:
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
        to_lights = self._aim(options.shadow_rays, options.shadow_length, _LIGHT)
        into_sky = self._aim(options.occlusion_rays, options.occlusion_length, _SKY)
        times = np.zeros(len(STAGES), np.int64)
        rays = lighting_kernel(self.rays.packet_width)(
            first, count, pixels, self._surfaces, self._lights, to_lights, into_sky, options.occlusion == "cosine",
            query, chunk, self._film.sums, self._film.is_first, times,
        )  # fmt: skip
        taken_s = (perf_counter() - start) / times.sum()
        for stage, ticks in zip(STAGES, times.tolist(), strict=True):
            if ticks:
                stages[stage] = stages.get(stage, 0.0) + ticks * taken_s
        return None if rays < 0 else rays

    def _aim(self, rays: int, length: float, steps: tuple[int, int]) -> Aim:
        """This sample's rays; if there are none, one point that is not traced for occlusion."""
        numbers = range(self.samples * rays, (self.samples + 1) * rays)
        places = [[number * step + (1 << 31) & 0xFFFFFFFF for step in steps] for number in numbers]
        return Aim(np.array(places or [[0, 0]], np.uint32), rays > 0, np.float32(length))
