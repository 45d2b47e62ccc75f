"""The base of renderers: samples of a scene seen by a camera, averaged to a picture."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError, InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.checks import check_whole
from atra.light.laps import Laps
from atra.light.pictures.film import Film
from atra.light.pictures.finish.finisher import CENTRE, Finisher, Offset, Wave
from atra.light.pictures.options import RenderOptions
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.pictures.pixels import LensPixels, pixels_of
from atra.light.scene import Scene
from atra.light.surface_kernels import Surfaces
from atra.raster.tracer import RasterTracer
from atra.rays.kernel_scene import KernelScene, Query, scene_for_kernels
from atra.tracing.tracer import Tracer
from atra.views.sampling import sub_pixel_offsets

Primary = Callable[[Mesh, View], Tracer]
"""Makes the tracer of primary visibility: `atra.PixelTracer`, or `partial(atra.AlignedTracer, split=(128, 1))`."""

_WAVES_A_THREAD = 4
"""Least waves per thread; more balance the threads and ask `stop` more often."""


def _never() -> bool:
    return False


class Renderer(Finisher):
    """What renderers share: primary visibility, a scene for all other rays, samples, and times of stages.

    scene: see `Scene`. camera: of any kind; through a lens all pixels of a sample have one offset, whatever
    `jitter` is, and those without a ray are black. primary: makes the tracer of primary visibility from mesh
    and camera; None: the rasteriser. options: of the renderer.

    stage_s: seconds by stage of the last `add`, which sum to its duration. Stages in several threads count their mean;
    "other" is the rest: waiting, Python. ray_count: rays of the last `add` beside those of primary visibility.
    """

    _sets_sums: ClassVar[bool] = False  # `is_set` of `Film`
    _wave_rays: ClassVar[int] = 8 * BLOCK  # pixels that a thread takes at a time, at most

    def __init__(self, scene: Scene, camera: View, primary: Primary | None, options: RenderOptions) -> None:
        super().__init__()
        self.options = options
        check_range(scene.mesh, camera, takes_lenses=True)
        self.rays = self._new_rays(scene.mesh.local)
        make_tracer = primary or partial(RasterTracer, threads=self.options.threads)
        self.scene, self.camera = scene, camera
        self._tracer = make_tracer(scene.mesh, camera)
        self._surfaces: Surfaces | None = None
        self._film = self._new_film()
        self._start_film()

    def _new_rays(self, mesh: Mesh) -> KernelScene:
        """The scene for all rays but those of primary visibility."""
        return scene_for_kernels(mesh, self.options)

    @property
    @abstractmethod
    def _planes(self) -> int:
        """Sums per pixel."""

    @abstractmethod
    def _tables(self) -> Surfaces: ...

    @abstractmethod
    def _add_wave(self, first: int, count: int, pixels: Pixels, query: Query, stages: dict[str, float]) -> int | None:
        """Add the next sample of `count` pixels, and the seconds of stages. Returns the number of rays traced, None if
        light was not finite."""

    @abstractmethod
    def _mean(self) -> NDArray[np.float64]:
        """(3, pixels), over all samples."""

    @abstractmethod
    def _same_sums(self, scene: Scene) -> bool:
        """Whether samples of `scene` would have the sums of the current one's."""

    def _new_film(self) -> Film:
        return Film((self._planes, self.camera.width, self.camera.height), self._sets_sums)

    def _start_film(self) -> None:
        if self._film.shape != (self._planes, self.camera.width, self.camera.height):
            self._film = self._new_film()
        self._film.restart()
        self._hits: Hits | None = None
        self._lens_pixels = LensPixels()
        self.stage_s: dict[str, float] = {}
        self.ray_count = 0

    def _build(self) -> tuple[float, float]:
        self._tracer.build()
        self.rays.build()
        start = perf_counter()
        self._surfaces = self._tables()
        tables_time_s = perf_counter() - start
        return self._tracer.plan_time_s, self._tracer.build_time_s + self.rays.build_time_s + tables_time_s

    @property
    def samples(self) -> int:
        """Samples since the last restart."""
        return self._film.samples

    @property
    def tracer(self) -> Tracer:
        """The tracer of primary visibility; it belongs to the renderer."""
        return self._tracer

    def add(self, samples: int = 1, stop: Callable[[], bool] | None = None) -> bool:
        """Add this many samples to every pixel, up to the option `most_samples`; returns whether it finished.

        stop: asked before every wave, by several threads; it may read only `samples` of this renderer. If it returns
        True, finished samples stay. On an interrupt or an error the picture starts over. Raises InputError for a number
        below 1, ClosedError after `close`, AtraError naming pixel and sample for light that is not finite.
        """
        check_whole("samples", samples, 1)
        with self._in_use():
            start = perf_counter()
            stages: dict[str, float] = {}
            self.ray_count = 0
            if self.options.most_samples is not None:
                samples = min(samples, self.options.most_samples - self.samples)
            try:
                for _ in range(samples):
                    if stop is not None:
                        self._film.begin_sample()
                    if not self._add_sample(stages, stop or _never):
                        self._film.drop_sample()
                        return False
                    self._film.end_sample()
            except BaseException:
                self._start_film()  # the sums may hold part of a sample
                raise
            stages["other"] = perf_counter() - start - sum(stages.values())
            self.stage_s = stages
            return True

    def _add_sample(self, stages: dict[str, float], stop: Callable[[], bool]) -> bool:
        """Returns whether it finished."""
        offset = CENTRE if self.options.jitter == "off" else tuple(sub_pixel_offsets(1, self.samples)[0].tolist())
        own = self.options.jitter == "pixel" and self.camera.lens is None
        lap = Laps(stages)
        if not own and (self._hits is None or self.options.jitter != "off"):
            self._hits = self._tracer.trace(offset, out=self._hits)
        lap("primary")
        pixels = self._pixels(offset, None if own else self._hits)
        times: list[dict[str, float]] = [{} for _ in range(self.rays.threads)]
        rays = [0] * self.rays.threads

        def add(first: int, count: int, query: Query) -> None:
            traced = self._add_wave(first, count, pixels, query, times[query.worker])
            if traced is None:
                raise self._not_finite(first, count)
            rays[query.worker] += traced

        is_finished = self._in_waves(add, stop)
        self.ray_count += sum(rays)
        for of_worker in times:
            for stage, seconds in of_worker.items():
                stages[stage] = stages.get(stage, 0.0) + seconds / self.rays.threads
        return is_finished

    def _pixels(self, offset: Offset, hits: Hits | None) -> Pixels:
        """All pixels at a sub-pixel offset, for kernels; hits: what they see there, None = unknown."""
        directions = self._lens_pixels.directions(self.camera, offset, self.rays.threads)
        _, own_camera = own_space(self.scene.mesh, self.camera)
        return pixels_of(own_camera, self._film, offset, hits, directions)

    def _in_waves(self, each: Wave, stop: Callable[[], bool] = _never) -> bool:
        """Call `each` for all pixels, wave by wave, in all threads; returns whether it finished."""
        every = self.camera.width * self.camera.height
        waves = 1 if self.rays.threads == 1 and stop is _never else _WAVES_A_THREAD * self.rays.threads
        share = -(-every // (waves * BLOCK)) * BLOCK
        wave_rays = min(self._wave_rays, share)
        starts = deque(range(0, every, wave_rays))  # `popleft` is thread-safe

        def work(query: Query) -> None:
            while not stop():
                try:
                    first = starts.popleft()
                except IndexError:
                    return
                each(first, min(wave_rays, every - first), query)

        self.rays.run(work)
        return not starts

    def _not_finite(self, first: int, count: int) -> AtraError:
        sums = self._film.sums[:, first : first + count]
        plane, pixel = np.argwhere(~np.isfinite(sums))[0].tolist()
        return AtraError(
            f"sample {self.samples} of pixel {self._film.place_of(first + pixel)} is {sums[plane, pixel]}, expected a "
            "finite number; look for texels beyond 1e30 in the sky, and report this if there are none"
        )

    def look(self, camera: View) -> None:
        """Take pictures through another camera, of any size; one that is unlike the last starts with no samples.

        Raises as the tracer of primary visibility does; ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            if camera != self.camera:
                self._look(camera)

    def _look(self, camera: View) -> None:
        check_range(self.scene.mesh, camera, takes_lenses=True)
        self._tracer.look(camera)
        self.camera = camera
        self._start_film()

    def update(self, scene: Scene | None = None, **changes: Any) -> None:
        """Go on with another scene, or with other options.

        scene: its mesh may have other vertices, but the same faces. changes: options by name; others stay as they are.
        Samples stay where their sums would be the same (`HybridRenderer`: powers and colours of lights, power of the
        sky); otherwise it starts again with none.
        Raises InputError for a mesh of other faces, and for options that the scene was built with; TypeError for
        options that there are not; ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            fixed = sorted(self.options.built_with & changes.keys())
            if fixed:
                raise InputError(f"{fixed[0]} is what the scene was built with; make a new {type(self).__name__}")
            options = replace(self.options, **changes)
            moves = scene is not None and scene.mesh is not self.scene.mesh
            has_other_sums = moves or (scene is not None and not self._same_sums(scene))
            if scene is not None and moves:
                self.rays.update(scene.mesh.local)
                self._tracer.update(scene.mesh)
            restarts = has_other_sums or unlike_but_for(options, self.options, "most_samples")
            self.options = options
            self.scene = scene or self.scene
            if has_other_sums and self._is_built:
                self._surfaces = self._tables()
            if restarts:
                self._start_film()

    def restart(self) -> None:
        """Drop all samples; the next one traces primary visibility, whatever `jitter` is. Raises ClosedError after
        `close`."""
        with self._lock:
            self._check_open()
            self._start_film()

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, linear RGB, the mean of the samples. Raises InputError if there is none yet."""
        with self._lock:
            return self._lens_pixels.blackened(self._film.as_image(self._mean()))

    def _release(self) -> None:
        self._tracer.close()
        self.rays.close()


def unlike_but_for(one: object, other: object, *names: str) -> bool:
    """Whether two frozen values differ in fields other than `names`."""
    if type(one) is not type(other):
        return True
    kept = [field.name for field in fields(one) if field.name not in names]  # type: ignore[arg-type]
    return not all(_is_same(getattr(one, name), getattr(other, name)) for name in kept)


def _is_same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray):  # texels, usually the same object
        return one is other or np.array_equal(one, other)  # type: ignore[arg-type]
    return bool(one == other)
