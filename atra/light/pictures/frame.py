"""A frame: the samples of one camera, and the integrator that finds their light."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.batches import Laps, in_batches
from atra.light.pictures.film import Film
from atra.light.pictures.options import RenderOptions
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.pictures.pixels import LensPixels, pixels_of
from atra.light.scene import Scene
from atra.rays.kernel_scene import KernelScene, Query
from atra.tracing.tracer import Tracer
from atra.views.sampling import sub_pixel_offsets

Offset = tuple[float, float]

CENTRE = (0.5, 0.5)

_WAVES_A_THREAD = 4
"""Least waves per thread; more balance the threads and ask `stop` more often."""


class Integrator(Protocol):
    """What gathers light for a `Renderer`; several threads call `add` at once, everything else one at a time.

    name: what makes renderers with it. sets_sums: `is_set` of `Film`. wave_pixels: pixels that a thread takes at a
    time, at most. planes: sums per pixel. shares: planes of the film that hold shares of a pixel, by name.
    """

    name: str
    sets_sums: bool
    wave_pixels: int

    @property
    def planes(self) -> int: ...

    @property
    def shares(self) -> dict[str, int]: ...

    def take(self, scene: Scene, options: Any, camera: View) -> None:
        """Go on with a scene, options and a camera of the renderer."""

    def build(self, rays: KernelScene) -> None:
        """Make the tables of the scene that kernels read. rays: the scene that is asked."""

    def add(
        self, query: Query, first: int, count: int, pixels: Pixels, film: Film, stages: dict[str, float]
    ) -> int | None:
        """Add the next sample of `count` pixels, and the seconds of stages. Returns the number of rays traced, None if
        light was not finite."""

    def parts(self, film: Film) -> Iterator[NDArray[np.float64]]:
        """Parts of the picture that add up to it, each (3, pixels), over all samples."""

    def same_sums(self, scene: Scene) -> bool:
        """Whether samples of `scene` would have the sums of the current one's."""


class Frame:
    """Samples of a mesh through a camera, none at first. rays: scene for all rays but those of the tracer."""

    film: Film

    def __init__(self, mesh: Mesh, camera: View, tracer: Tracer, rays: KernelScene, integrator: Integrator) -> None:
        self._tracer, self._rays, self._integrator = tracer, rays, integrator
        self.start(mesh, camera, Film((integrator.planes, camera.width, camera.height), integrator.sets_sums))

    def start(self, mesh: Mesh, camera: View, film: Film | None = None) -> None:
        """Begin with no samples, of another mesh or camera; in the same memory where that fits."""
        self._mesh, self._camera = mesh, camera
        shape = self._integrator.planes, camera.width, camera.height
        self.film = film or (self.film if self.film.shape == shape else Film(shape, self._integrator.sets_sums))
        self.film.restart()
        self._hits: Hits | None = None
        self.lens = LensPixels()

    def add(
        self, options: RenderOptions, stages: dict[str, float], stop: Callable[[], bool] | None
    ) -> tuple[bool, int]:
        """Add a sample, and the seconds of its stages; returns whether it finished, and the rays traced."""
        samples, threads = self.film.samples, self._rays.threads
        offset = CENTRE if options.jitter == "off" else tuple(sub_pixel_offsets(1, samples)[0].tolist())
        own = options.is_jittered and self._camera.lens is None
        lap = Laps(stages)
        if not own and (self._hits is None or options.jitter != "off"):
            self._hits = self._tracer.trace(offset, out=self._hits)
        lap("primary")
        pixels = self.pixels(offset, None if own else self._hits)
        times: list[dict[str, float]] = [{} for _ in range(threads)]

        def add(query: Query, first: int, count: int) -> int:
            traced = self._integrator.add(query, first, count, pixels, self.film, times[query.worker])
            if traced is None:
                raise self._not_finite(first, count)
            return traced

        every = self._camera.width * self._camera.height
        waves = 1 if threads == 1 and stop is None else _WAVES_A_THREAD * threads
        share = -(-every // (waves * BLOCK)) * BLOCK
        done = in_batches(self._rays, every, min(self._integrator.wave_pixels, share), add, stop)
        for of_worker in times:
            for stage, seconds in of_worker.items():
                stages[stage] = stages.get(stage, 0.0) + seconds / threads
        return done

    def pixels(self, offset: Offset, hits: Hits | None) -> Pixels:
        """All pixels at a sub-pixel offset, for kernels; hits: what they see there, None = unknown."""
        directions = self.lens.directions(self._camera, offset, self._rays.threads)
        _, own_camera = own_space(self._mesh, self._camera)
        return pixels_of(own_camera, self.film, offset, hits, directions)

    def seen_at(self, offset: Offset) -> Pixels:
        """All pixels at a sub-pixel offset, with what they see there."""
        return self.pixels(offset, self._tracer.trace(offset))

    def _not_finite(self, first: int, count: int) -> AtraError:
        sums = self.film.sums[:, first : first + count]
        plane, pixel = np.argwhere(~np.isfinite(sums))[0].tolist()
        return AtraError(
            f"sample {self.film.samples} of pixel {self.film.place_of(first + pixel)} is {sums[plane, pixel]}, "
            "expected a finite number; look for texels beyond 1e30 in the sky, and report this if there are none"
        )
