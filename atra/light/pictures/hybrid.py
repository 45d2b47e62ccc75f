"""Hybrid rendering: primary visibility by any tracer, and rays for soft shadows and ambient occlusion."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from math import inf, sqrt
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from atra.geometry.view import View
from atra.light.emitters.panels import Panel, panels_of
from atra.light.lights import Light, light_row
from atra.light.lights_kernels import LIGHT_WORDS
from atra.light.materials import shown_of
from atra.light.pictures.aiming_kernels import Aim
from atra.light.pictures.film import Film
from atra.light.pictures.gbuffer_kernels import new_chunk
from atra.light.pictures.lighting_kernels import LIGHT_PLANES, SKY_PLANES, STAGES, lighting_kernel
from atra.light.pictures.options import HybridOptions, unlike_but_for
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.pictures.renderer import Primary, Renderer
from atra.light.scene import Scene
from atra.light.tables import surfaces_of
from atra.rays.kernel_scene import KernelScene, Query


def _steps(*primes: int) -> tuple[int, int]:
    x, y = (int(sqrt(prime) % 1.0 * 2**32) for prime in primes)
    return x, y


_SKY, _LIGHT = _steps(2, 3), _steps(5, 7)
"""Steps between consecutive sample points, in units of 2^-32 of the unit square.

No step is a rational multiple of another or of a step of `sub_pixel_offsets`, so all points together are evenly
spread.
"""


class Hybrid:
    """The integrator of `HybridRenderer`."""

    name, sets_sums, wave_pixels = "HybridRenderer", True, 512 * BLOCK

    def __init__(self) -> None:
        self._panels_of: tuple[Scene | None, list[Panel]] = None, []

    def take(self, scene: Scene, options: HybridOptions, camera: View) -> None:
        """See `Integrator.take`."""
        self._scene, self._options = scene, options

    @property
    def planes(self) -> int:
        """Sums per pixel."""
        return SKY_PLANES + LIGHT_PLANES * (len(self._lit_by) + bool(self._panels))

    @property
    def shares(self) -> dict[str, int]:
        """Planes of what is open and of each light."""
        of_lights = {f"light {k}": SKY_PLANES + k * LIGHT_PLANES + 3 for k in range(len(self._scene.lights))}
        return {"openness": 3, **of_lights}

    @property
    def _panels(self) -> list[Panel]:
        """Lights that stand for the scene's shining surfaces."""
        if self._panels_of[0] is not self._scene:
            self._panels_of = self._scene, panels_of(self._scene)
        return self._panels_of[1]

    @property
    def _lit_by(self) -> list[Light | Panel]:
        return [*self._scene.local.lights, *self._panels]

    def build(self, rays: KernelScene) -> None:
        """See `Integrator.build`."""
        rows = [light.row if isinstance(light, Panel) else light_row(light) for light in self._lit_by]
        self._lights = np.array(rows, np.float32).reshape(-1, LIGHT_WORDS)
        shown = tuple(shown_of(material) for material in self._scene.materials)
        self._surfaces = surfaces_of(replace(self._scene, materials=shown), 1.0)
        self._kernel, self._chunks = lighting_kernel(rays.packet_width), [new_chunk() for _ in range(rays.threads)]

    def same_sums(self, scene: Scene) -> bool:
        """See `Integrator.same_sums`."""
        old = self._scene
        for name in ("face_materials", "normals", "uv", "second_uv", "colours"):
            if not np.array_equal(getattr(scene, name), getattr(old, name)):
                return False
        if scene.materials != old.materials or len(scene.lights) != len(old.lights):
            return False
        if unlike_but_for(scene.sky, old.sky, "power"):
            return False
        pairs = zip(scene.lights, old.lights, strict=True)
        return not any(unlike_but_for(new, light, "colour", "power") for new, light in pairs)

    def parts(self, film: Film) -> Iterator[NDArray[np.float64]]:
        """The sky's light, each light's, and, if there are any, that of all surfaces that shine."""
        yield self._scene.sky.power * film.mean(slice(3))
        first, shining = SKY_PLANES, []
        for light in self._lit_by:
            part = light.power * np.array(light.colour)[:, None] * film.mean(slice(first, first + 3))
            if isinstance(light, Panel):
                shining.append(part)
            else:
                yield part
            first += LIGHT_PLANES
        if shining:
            yield reduce(np.add, shining, film.mean(slice(first, first + 3)))

    def add(
        self, query: Query, first: int, count: int, pixels: Pixels, film: Film, stages: dict[str, float]
    ) -> int | None:
        """See `Integrator.add`."""
        options, chunk, start = self._options, self._chunks[query.worker], perf_counter()
        to_lights = _aim(film.samples, options.shadow_rays, options.shadow_length, _LIGHT)
        into_sky = _aim(film.samples, options.occlusion_rays, options.occlusion_length, _SKY)
        times = np.zeros(len(STAGES), np.int64)
        rays = self._kernel(
            first, count, pixels, self._surfaces, self._lights, to_lights, into_sky, options.occlusion == "cosine",
            query, chunk, film.sums, film.is_first, times,
        )  # fmt: skip
        taken_s = (perf_counter() - start) / times.sum()
        for stage, ticks in zip(STAGES, times.tolist(), strict=True):
            if ticks:
                stages[stage] = stages.get(stage, 0.0) + ticks * taken_s
        return None if rays < 0 else rays


def _aim(sample: int, rays: int, length: float, steps: tuple[int, int]) -> Aim:
    """A sample's rays; if there are none, one point that is not traced for occlusion."""
    numbers = range(sample * rays, (sample + 1) * rays)
    places = [[number * step + (1 << 31) & 0xFFFFFFFF for step in steps] for number in numbers]
    return Aim(np.array(places or [[0, 0]], np.uint32), rays > 0, np.float32(length))


def HybridRenderer(
    scene: Scene, camera: View, primary: Primary | None = None, *,
    threads: int | None = None, packet_width: int | None = None, build_quality: str = "medium", robust: bool = True,
    jitter: str = "shared", most_samples: int | None = 512, shadow_rays: int = 1, shadow_length: float = inf,
    occlusion_rays: int = 1, occlusion_length: float = 10.0, occlusion: str = "uniform",
) -> Renderer:  # fmt: skip
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

    Returns
    -------
    Renderer

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
    options = HybridOptions(
        threads, build_quality, robust, jitter, most_samples, packet_width, shadow_rays,
        shadow_length, occlusion_rays, occlusion_length, occlusion,
    )  # fmt: skip
    return Renderer(scene, camera, primary, options, Hybrid())
