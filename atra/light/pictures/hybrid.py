"""Hybrid rendering: primary visibility by any tracer, and rays for soft shadows and ambient occlusion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import inf, sqrt
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.choices import check_choice
from atra.geometry.view import View
from atra.light.checks import check_whole
from atra.light.emitters.panels import Panel, panels_of
from atra.light.lights import Light, light_row
from atra.light.lights_kernels import LIGHT_WORDS
from atra.light.materials import shown_of
from atra.light.pictures.film import Film
from atra.light.pictures.gbuffer_kernels import Aim, new_chunk
from atra.light.pictures.integrator import Integrator, check_length, unlike_but_for
from atra.light.pictures.lighting_kernels import LIGHT_PLANES, SKY_PLANES, STAGES, lighting_kernel
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


@dataclass(frozen=True)
class Hybrid(Integrator):
    """How a `HybridRenderer` gathers light. With 0 rays of a kind there is no shadow, or no occlusion."""

    renderer, sets_sums, wave_pixels = "HybridRenderer", True, 512 * BLOCK
    built_with: ClassVar = Integrator.built_with | {"packet_width"}

    packet_width: int | None = None
    most_samples: int | None = 512
    shadow_rays: int = 1
    shadow_length: float = inf
    occlusion_rays: int = 1
    occlusion_length: float = 10.0
    occlusion: str = "uniform"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_choice("occlusion", self.occlusion, ("uniform", "cosine"))
        for name in ("shadow_rays", "occlusion_rays"):
            check_whole(name, getattr(self, name), 0, 64)
        for name in ("shadow_length", "occlusion_length"):
            check_length(name, getattr(self, name))

    def lamps(self, scene: Scene) -> Sequence[Light | Panel]:
        """The scene's lights, then those that stand for its shining surfaces."""
        return [*scene.local.lights, *panels_of(scene)]

    def planes(self, lamps: Sequence[Light | Panel]) -> int:
        """Sums per pixel; one more for what surfaces emit, if any do."""
        return SKY_PLANES + LIGHT_PLANES * (len(lamps) + any(isinstance(one, Panel) for one in lamps))

    def shares(self, scene: Scene) -> dict[str, int]:
        """Planes of what is open and of each light."""
        of_lights = {f"light {k}": SKY_PLANES + k * LIGHT_PLANES + 3 for k in range(len(scene.lights))}
        return {"openness": 3, **of_lights}

    def tables(self, scene: Scene, lamps: Sequence[Light | Panel], rays: KernelScene) -> tuple[Any, ...]:
        """See `Integrator.tables`."""
        rows = [one.row if isinstance(one, Panel) else light_row(one) for one in lamps]
        shown = tuple(shown_of(material) for material in scene.materials)
        surfaces, lights = surfaces_of(replace(scene, materials=shown), 1.0), np.array(rows, np.float32)
        chunks = [new_chunk() for _ in range(rays.threads)]
        return lighting_kernel(rays.packet_width), surfaces, lights.reshape(-1, LIGHT_WORDS), chunks

    def same_sums(self, scene: Scene, old: Scene) -> bool:
        """See `Integrator.same_sums`; colours and powers of lights and the power of the sky are not in the sums."""
        for name in ("face_materials", "normals", "uv", "second_uv", "colours"):
            if not np.array_equal(getattr(scene, name), getattr(old, name)):
                return False
        if scene.materials != old.materials or len(scene.lights) != len(old.lights):
            return False
        if unlike_but_for(scene.sky, old.sky, "power"):
            return False
        pairs = zip(scene.lights, old.lights, strict=True)
        return not any(unlike_but_for(new, light, "colour", "power") for new, light in pairs)

    def mean(self, scene: Scene, lamps: Sequence[Light | Panel], film: Film) -> NDArray[np.float64]:
        """The sum of the sky's light, of each lamp's, and of what surfaces emit."""
        starts = range(SKY_PLANES, film.shape[0], LIGHT_PLANES)
        of_lamps = [
            one.power * np.array(one.colour)[:, None] * film.mean(slice(start, start + 3))
            for one, start in zip(lamps, starts, strict=False)
        ]
        lights, last = len(scene.lights), film.shape[0] - LIGHT_PLANES
        total = reduce(np.add, of_lamps[:lights], scene.sky.power * film.mean(slice(3)))
        if len(lamps) == lights:
            return total
        return total + reduce(np.add, of_lamps[lights:], film.mean(slice(last, last + 3)))

    def add(
        self, tables: Any, camera: View, query: Query, first: int, count: int, pixels: Pixels, film: Film,
        stages: dict[str, float],
    ) -> int | None:  # fmt: skip
        """See `Integrator.add`."""
        start = perf_counter()
        to_lights = _aim(film.samples, self.shadow_rays, self.shadow_length, _LIGHT)
        into_sky = _aim(film.samples, self.occlusion_rays, self.occlusion_length, _SKY)
        times = np.zeros(len(STAGES), np.int64)
        kernel, surfaces, lights, chunks = tables
        rays = kernel(
            first, count, pixels, surfaces, lights, to_lights, into_sky, self.occlusion == "cosine",
            query, chunks[query.worker], film.sums, film.is_first, times,
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
    integrator = Hybrid(
        threads, build_quality, robust, jitter, most_samples, packet_width, shadow_rays,
        shadow_length, occlusion_rays, occlusion_length, occlusion,
    )  # fmt: skip
    return Renderer(scene, camera, primary, integrator)
