"""A renderer: samples of a scene seen by a camera, added up to a picture."""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar, Unpack

import numpy as np
from numpy.typing import NDArray

from atra.errors import AtraError, InputError
from atra.geometry.mesh import Mesh
from atra.geometry.sampling import sub_pixel_offsets
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.laps import Laps
from atra.light.pictures.files import save_picture
from atra.light.pictures.film import Film
from atra.light.pictures.options import RenderKeywords, RenderOptions
from atra.light.pictures.path_kernels import BLOCK, Pixels
from atra.light.pictures.pixels import pixels_of
from atra.light.scene import RenderScene
from atra.light.surface_kernels import Surfaces
from atra.raster.tracer import RasterTracer
from atra.rays.scene import Query, RayScene
from atra.tracing.lifetime import Lifetime
from atra.tracing.options import RayOptions, lists_options
from atra.tracing.tracer import Tracer
from atra.whole_numbers import is_whole_number

Primary = Callable[[Mesh, View], Tracer[Hits]]
"""What makes the tracer of primary visibility: `atra.PixelTracer`, or `partial(atra.AlignedTracer, split=(128, 1))`."""

CENTRE = (0.5, 0.5)

_WAVES_A_THREAD = 4
"""At least, so that none waits long for another, and who wants to stop is soon asked."""


class Renderer(Lifetime):
    """What both renderers share: primary visibility, a scene for all other rays, samples, and the time of stages.

    scene: see `RenderScene`. camera: of either kind. primary: makes the tracer of primary visibility from mesh and
    camera; None: the rasteriser. options: fields of `options_type` by name.

    stage_s: seconds by stage of the last `add`; they sum to its duration. Of stages that run in several threads it is
    the mean, and "other" is what is left: waiting, Python. ray_count: how many rays the last `add` traced beside those
    of primary visibility.
    """

    options_type: ClassVar[type[RenderOptions]]
    options: RenderOptions

    _ray_bytes: ClassVar[int] = 80  # in a wave, at most
    _sets_sums: ClassVar[bool] = False  # as `Film` asks

    def __init__(self, scene: RenderScene, camera: View, primary: Primary | None, options: Mapping[str, Any]) -> None:
        super().__init__()
        self.options = self.options_type.of(type(self).__name__, options)
        self.rays = RayScene(scene.mesh, **self._ray_options().keywords())
        make_tracer = primary or partial(RasterTracer, threads=self.options.threads)
        self.scene, self.camera = scene, camera
        self._tracer = make_tracer(scene.mesh, camera)
        self._surfaces: Surfaces | None = None
        self._film = self._new_film()
        self._start_film()

    def _ray_options(self) -> RayOptions:
        return RayOptions.part_of(self.options)

    @property
    @abstractmethod
    def _planes(self) -> int:
        """Sums of a pixel."""

    @abstractmethod
    def _tables(self) -> Surfaces: ...

    @abstractmethod
    def _add_wave(self, first: int, count: int, pixels: Pixels, query: Query, stages: dict[str, float]) -> int | None:
        """Add sample number `samples` of so many pixels; adds the seconds of stages. How many rays were traced; None:
        light was not finite."""

    @abstractmethod
    def _mean(self) -> NDArray[np.float64]:
        """(3, pixels), of all samples."""

    @abstractmethod
    def _same_sums(self, scene: RenderScene) -> bool:
        """Whether samples of `scene` have the sums of those of the present one."""

    def _new_film(self) -> Film:
        camera, waves_bytes = self.camera, self.rays.threads * self.options.wave_rays * self._ray_bytes
        return Film((self._planes, camera.width, camera.height), waves_bytes, self._sets_sums)

    def _start_film(self) -> None:
        if self._film.shape != (self._planes, self.camera.width, self.camera.height):
            self._film = self._new_film()
        self._film.restart()
        self._hits: Hits | None = None
        self.stage_s: dict[str, float] = {}
        self.ray_count = 0

    def _plan(self) -> float:
        self._tracer.build()
        return self._tracer.plan_time_s

    def _build(self) -> float:
        self.rays.build()
        start = perf_counter()
        self._surfaces = self._tables()
        return self._tracer.build_time_s + self.rays.build_time_s + perf_counter() - start

    @property
    def samples(self) -> int:
        """How many have been added since the last restart."""
        return self._film.samples

    @property
    def tracer(self) -> Tracer[Hits]:
        """Of primary visibility; its hits may be looked at, and it stays the renderer's."""
        return self._tracer

    def add(self, samples: int = 1, stop: Callable[[], bool] | None = None) -> None:
        """Add so many samples to every pixel.

        No more are added than `most_samples` of the options allows. stop: asked before every wave, by several threads;
        once it says True, or when interrupted, the picture starts anew with none. Of this renderer it may read
        `samples` alone.
        Raises InputError for a number below 1, ClosedError after `close`, AtraError naming pixel and sample for light
        that is no finite number.
        """
        if not is_whole_number(samples) or samples < 1:
            raise InputError(f"{samples!r} samples are to be added, expected a whole number of at least 1")
        with self._in_use():
            start = perf_counter()
            stages: dict[str, float] = {}
            self.ray_count = 0
            if self.options.most_samples is not None:
                samples = min(samples, self.options.most_samples - self.samples)
            try:
                for _ in range(samples):
                    if not self._add_sample(stages, stop or _never):
                        self._start_film()
                        return
                    self._film.end_sample()
            except BaseException:
                self._start_film()  # a part of a sample may be in the sums
                raise
            stages["other"] = perf_counter() - start - sum(stages.values())
            self.stage_s = stages

    def _add_sample(self, stages: dict[str, float], stop: Callable[[], bool]) -> bool:
        """Whether it came to its end."""
        camera = self.camera
        offset = CENTRE if self.options.jitter == "off" else tuple(sub_pixel_offsets(1, self.samples)[0].tolist())
        own = self.options.jitter == "pixel"
        lap = Laps(stages)
        if not own and (self._hits is None or self.options.jitter != "off"):
            self._hits = self._tracer.trace(offset, out=self._hits)
        lap("primary")
        pixels = pixels_of(camera, self._film, offset, None if own else self._hits)
        every = camera.width * camera.height
        waves = 1 if self.rays.threads == 1 and stop is _never else _WAVES_A_THREAD * self.rays.threads
        share = -(-every // (waves * BLOCK)) * BLOCK
        wave_rays = min(self.options.wave_rays, share)
        starts = deque(range(0, every, wave_rays))  # its `popleft` is safe between threads
        times: list[dict[str, float]] = [{} for _ in range(self.rays.threads)]
        rays = [0] * self.rays.threads

        def work(query: Query) -> None:
            while not stop():
                try:
                    first = starts.popleft()
                except IndexError:
                    return
                count = min(wave_rays, every - first)
                traced = self._add_wave(first, count, pixels, query, times[query.worker])
                if traced is None:
                    raise self._not_finite(first, count)
                rays[query.worker] += traced

        self.rays.run(work)
        self.ray_count += sum(rays)
        for of_worker in times:
            for stage, seconds in of_worker.items():
                stages[stage] = stages.get(stage, 0.0) + seconds / self.rays.threads
        return not starts

    def _not_finite(self, first: int, count: int) -> AtraError:
        sums = self._film.sums[:, first : first + count]
        plane, pixel = np.argwhere(~np.isfinite(sums))[0].tolist()
        return AtraError(
            f"sample {self.samples} of pixel {self._film.place_of(first + pixel)} is {sums[plane, pixel]}, expected a "
            "finite number; "
            "look for texels beyond 1e30 in the sky, and report this if there are none"
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
        self._tracer.look(camera)
        self.camera = camera
        self._start_film()

    @lists_options(RenderOptions, as_changes=True)
    def update(self, scene: RenderScene | None = None, **changes: Unpack[RenderKeywords]) -> None:
        """Go on with another scene, or with other options.

        scene: its mesh may have other vertices, but the same faces. Samples stay where their sums would be the same
        (`HybridRenderer`: powers and colours of lights, power of the sky); otherwise it starts anew with none.
        Raises InputError for a mesh of other faces, and for options that the scene was built with; ClosedError after
        `close`.
        """
        self._update(scene, changes)

    def _update(self, scene: RenderScene | None, changes: Mapping[str, Any]) -> None:
        with self._lock:
            self._check_open()
            fixed = sorted(self.options.built_with & changes.keys())
            if fixed:
                raise InputError(f"{fixed[0]} is what the scene was built with; make a new {type(self).__name__}")
            options = self.options.changed(type(self).__name__, changes)
            moves = scene is not None and scene.mesh is not self.scene.mesh
            has_other_sums = moves or (scene is not None and not self._same_sums(scene))
            if scene is not None and moves:
                self.rays.update(scene.mesh)
                self._tracer.update(scene.mesh)
            restarts = has_other_sums or unlike_but_for(options, self.options, "most_samples")
            self.options = options
            self.scene = scene or self.scene
            if has_other_sums and self._is_built:
                self._surfaces = self._tables()
            if restarts:
                self._start_film()

    def restart(self) -> None:
        """Forget all samples; the next one traces primary visibility, whatever `jitter` is. Raises ClosedError after
        `close`."""
        with self._lock:
            self._check_open()
            self._start_film()

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, linear RGB, the mean of the samples. Raises InputError where there is none yet."""
        with self._lock:
            return self._film.as_image(self._mean())

    def save(self, path: Path | str) -> None:
        """Write the picture: `.png` in sRGB, 8 bits, or `.exr` in linear RGB with depth Z, normal N and prim_id of the
        pixels' centres, 32 bits. Raises InputError for another suffix and where there is no sample yet; StorageError.
        """
        with self._lock:
            image = self.image
            with self._in_use():
                save_picture(Path(path), image, lambda: self._tracer.trace(CENTRE))

    def _release(self) -> None:
        self._tracer.close()
        self.rays.close()


def _never() -> bool:
    return False


def unlike_but_for(one: object, other: object, *names: str) -> bool:
    """Whether two frozen values differ in more than these of their fields."""
    if type(one) is not type(other):
        return True
    kept = [field.name for field in fields(one) if field.name not in names]  # type: ignore[arg-type]
    return not all(_is_same(getattr(one, name), getattr(other, name)) for name in kept)


def _is_same(one: object, other: object) -> bool:
    if isinstance(one, np.ndarray):  # texels, which are mostly the very same
        return one is other or np.array_equal(one, other)  # type: ignore[arg-type]
    return bool(one == other)
