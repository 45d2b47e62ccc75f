"""Renderers: samples of a scene seen by a camera, averaged to a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.errors import InputError
from atra.files.paths import write_atomically
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, own_space
from atra.geometry.view import View
from atra.hits import Hits
from atra.light.batches import Laps
from atra.light.checks import check_whole
from atra.light.oidn import denoiser
from atra.light.pictures.files import check_picture_path, exr_of, shown_png
from atra.light.pictures.film import Film, LensPixels, pixels_of
from atra.light.pictures.finish.layers import Layers, Offset, layers_of
from atra.light.pictures.finish.states import fingerprint
from atra.light.pictures.integrator import Integrator, unlike_but_for
from atra.light.pictures.path_kernels import Pixels
from atra.light.scene import Scene
from atra.raster.tracer import RasterTracer
from atra.rays.kernel_scene import scene_for_kernels
from atra.tracing.lifetime import Lifetime, synchronized
from atra.tracing.tracer import Tracer
from atra.views.sampling import sub_pixel_offsets

_CENTRE = (0.5, 0.5)

Primary = Callable[[Mesh, View], Tracer]
"""Makes the tracer of primary visibility: `atra.PixelTracer`, or `partial(atra.AlignedTracer, split=(128, 1))`."""


class Renderer(Lifetime):
    """Samples of a scene seen by a camera; `HybridRenderer` and `PathRenderer` make one.

    Parameters
    ----------
    scene :
        What is lit, see `Scene`.
    camera :
        Of any kind. Through a lens all pixels of a sample have one offset, whatever `jitter` is, and those without a
        ray are black.
    primary :
        Makes the tracer of primary visibility from mesh and camera; None: the rasteriser.
    integrator :
        Its options, and how light is gathered.

    Attributes
    ----------
    tracer : Tracer
        The tracer of primary visibility; it belongs to the renderer.
    stage_s : dict
        Seconds by stage of the last `add`, which sum to its duration. Stages in several threads count their mean;
        "other" is the rest: waiting, Python.
    ray_count : int
        Rays of the last `add` beside those of primary visibility.

    Raises
    ------
    InputError
        For a camera that cannot see the mesh.
    MemoryBudgetError
        For sums that the free memory cannot hold.
    """

    def __init__(self, scene: Scene, camera: View, primary: Primary | None, integrator: Integrator) -> None:
        super().__init__()
        check_range(scene.mesh, camera, takes_lenses=True)
        integrator.check_camera(camera)
        self.scene, self.camera, self.integrator = scene, camera, integrator
        self.rays = scene_for_kernels(scene.mesh.local, integrator)
        make_tracer = primary or partial(RasterTracer, threads=integrator.threads)
        self.tracer = make_tracer(scene.mesh, camera)
        self._lamps = integrator.lamps(scene)
        self._start()

    def _start(self) -> None:
        """Begin with no samples; in the same memory where that fits."""
        shape = self.integrator.planes(self._lamps), self.camera.width, self.camera.height
        film: Film | None = getattr(self, "_film", None)
        self._film: Film = film if film and film.shape == shape else Film(shape, self.integrator.sets_sums)
        self._film.restart()
        self._hits: Hits | None = None
        self._lens = LensPixels()
        self.stage_s: dict[str, float] = {}
        self.ray_count = 0

    def _build(self) -> tuple[float, float]:
        self.tracer.build()
        self.rays.build()
        start = perf_counter()
        self._tables = self.integrator.tables(self.scene, self._lamps, self.rays)
        tables_time_s = perf_counter() - start
        return self.tracer.plan_time_s, self.tracer.build_time_s + self.rays.build_time_s + tables_time_s

    def _release(self) -> None:
        self.tracer.close()
        self.rays.close()

    @property
    def samples(self) -> int:
        """Samples since the last restart."""
        return self._film.samples

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
            if self.integrator.most_samples is not None:
                samples = min(samples, self.integrator.most_samples - self.samples)
            try:
                for _ in range(samples):
                    if stop is not None:
                        self._film.begin_sample()
                    is_finished, rays = self._add_sample(stages, stop)
                    self.ray_count += rays
                    if not is_finished:
                        self._film.drop_sample()
                        return False
                    self._film.end_sample()
            except BaseException:
                self._start()  # the sums may hold part of a sample
                raise
            stages["other"] = perf_counter() - start - sum(stages.values())
            self.stage_s = stages
            return True

    def _add_sample(self, stages: dict[str, float], stop: Callable[[], bool] | None) -> tuple[bool, int]:
        """Add to the sums, and the seconds of stages; returns whether it finished, and the rays traced."""
        integrator, film, camera = self.integrator, self._film, self.camera
        is_still, own = integrator.jitter == "off", integrator.is_jittered and camera.lens is None
        offset = _CENTRE if is_still else tuple(sub_pixel_offsets(1, film.samples)[0].tolist())
        lap = Laps(stages)
        if not own and (self._hits is None or not is_still):
            self._hits = self.tracer.trace(offset, out=self._hits)
        lap("primary")
        pixels = self._pixels(offset, None if own else self._hits)
        return integrator.add_all(self._tables, camera, self.rays, pixels, film, stages, stop)

    def _pixels(self, offset: Offset, hits: Hits | None) -> Pixels:
        """All pixels at a sub-pixel offset, for kernels; hits: what they see there, None = unknown."""
        directions = self._lens.directions(self.camera, offset, self.rays.threads)
        _, own_camera = own_space(self.scene.mesh, self.camera)
        return pixels_of(own_camera, self._film, offset, hits, directions)

    @synchronized
    def look(self, camera: View) -> None:
        """Take pictures through another camera, of any size; one that is unlike the last starts with no samples.

        Raises as the tracer of primary visibility does; ClosedError after `close`.
        """
        self._check_open()
        if camera != self.camera:
            check_range(self.scene.mesh, camera, takes_lenses=True)
            self.integrator.check_camera(camera)
            self.tracer.look(camera)
            self.camera = camera
            self._start()

    @synchronized
    def update(self, scene: Scene | None = None, **changes: Any) -> None:
        """Go on with another scene, or with other options.

        scene: its mesh may have other vertices, but the same faces. changes: options by name; others stay as they are.
        Samples stay where their sums would be the same (`HybridRenderer`: powers and colours of lights, power of the
        sky); otherwise it starts again with none.
        Raises InputError for a mesh of other faces, and for options that the scene was built with; TypeError for
        options that there are not; ClosedError after `close`.
        """
        self._check_open()
        fixed = sorted(self.integrator.built_with & changes.keys())
        if fixed:
            raise InputError(f"{fixed[0]} is what the scene was built with; make a new {self.integrator.renderer}")
        integrator, scene = replace(self.integrator, **changes), scene or self.scene
        integrator.check_camera(self.camera)
        moves = scene.mesh is not self.scene.mesh
        has_other_sums = moves or (scene is not self.scene and not integrator.same_sums(scene, self.scene))
        if moves:
            self.rays.update(scene.mesh.local)
            self.tracer.update(scene.mesh)
        restarts = has_other_sums or unlike_but_for(integrator, self.integrator, "most_samples")
        if scene is not self.scene:
            self._lamps = integrator.lamps(scene)
        self.integrator, self.scene = integrator, scene
        if has_other_sums and self._is_built:
            self._tables = integrator.tables(scene, self._lamps, self.rays)
        if restarts:
            self._start()

    @synchronized
    def restart(self) -> None:
        """Drop all samples; the next one traces primary visibility, too. Raises ClosedError after `close`."""
        self._check_open()
        self._start()

    @property
    def image(self) -> NDArray[np.float32]:
        """(H, W, 3) float32, linear RGB, the mean of the samples. Raises InputError if there is none yet."""
        with self._lock:
            mean = self.integrator.mean(self.scene, self._lamps, self._film)
            return self._lens.blackened(self._film.as_image(mean))

    @property
    def alpha(self) -> NDArray[np.float32] | None:
        """(H, W), the share of each pixel that is not sky; None without `transparent`. Raises InputError without
        samples."""
        return self._share("alpha") if "alpha" in self.integrator.shares(self.scene) else None

    @property
    def openness(self) -> NDArray[np.float32]:
        """(H, W) float32, share of rays into the sky that nothing blocked; 1 for a miss. Raises InputError by paths."""
        return self._share("openness")

    @synchronized
    def lit(self, light: int = 0) -> NDArray[np.float32]:
        """(H, W) float32, share of rays to a light that nothing blocked; 0 on surfaces facing away and for a miss.
        Raises InputError for an unknown light, and by paths."""
        if not 0 <= light < len(self.scene.lights):
            raise InputError(f"light is {light!r}, but the scene has {len(self.scene.lights)}, counted from 0")
        return self._share(f"light {light}")

    @synchronized
    def _share(self, name: str) -> NDArray[np.float32]:
        plane = self.integrator.shares(self.scene).get(name)
        if plane is None:
            raise InputError(f"a {self.integrator.renderer} counts no {name}, which a HybridRenderer does")
        return self._film.as_image(self._film.mean(slice(plane, plane + 1)))[..., 0]

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """Copies of the arrays that `restore` needs to go on with these samples, in this process or another."""
        with self._lock:
            return {"fingerprint": self._fingerprint(), **self._film.state}

    @synchronized
    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the `state` of a renderer of the same scene, camera and options; what follows is equal to the bit.

        Raises InputError for a state of another one, ClosedError after `close`.
        """
        self._check_open()
        if not np.array_equal(state["fingerprint"], self._fingerprint()):
            raise InputError("it is of another scene, camera, option or version of atra")
        self._start()
        self._film.restore(state)

    def _fingerprint(self) -> NDArray[np.uint8]:
        return fingerprint(self.integrator.renderer, self.scene, self.camera, options=self.integrator)

    def layers(self) -> Layers:
        """What the pixels see first. Raises ClosedError after `close`."""
        with self._in_use():
            size = self.camera.width, self.camera.height
            return layers_of(self.scene, size, self.rays, lambda at: self._pixels(at, self.tracer.trace(at)))

    def denoised(self, layers: Layers | None = None) -> NDArray[np.float32]:
        """The image without its noise, by Open Image Denoise. layers: of this camera; None: they are made.

        Raises InputError without samples, and without the package pyoidn.
        """
        with self._lock, denoiser(self.integrator.threads) as filtered:
            image, seen = self.image, layers or self.layers()
            return filtered(color=image, albedo=seen.albedo, normal=seen.normals)

    def save(
        self, path: Path | str, *, exposure: float | str = 0.0, tone: str = "none", denoise: bool = False
    ) -> float | None:
        """Write the picture: `.png` in 8-bit sRGB, or `.exr` in 32-bit linear RGB with layers (`files.exr_of`); returns
        the exposure of a PNG in stops.

        exposure: stops, or "auto". tone: see `tone.TONES`. An EXR has neither. denoise: see `denoised`. Raises
        InputError for another suffix or value, without samples, and without the packages it needs; StorageError.
        """
        path = Path(path)
        is_exr, stops = check_picture_path(path) == ".exr", None
        with self._in_use():
            raw, alpha = self.image, self.alpha
            layers = self.layers() if is_exr or denoise else None
            image = self.denoised(layers) if denoise else raw
            if layers is not None and is_exr:
                hits = self.tracer.trace(_CENTRE)
                content = exr_of(image, hits, layers.albedo, self.samples, raw if denoise else None, alpha)
            else:
                content, stops = shown_png(image, alpha, exposure, tone)
            write_atomically(path, content)
        return stops
