"""The baker: Monte Carlo samples of the light that reaches a lightmap's texels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import AtraError, InputError
from atra.geometry.view import View
from atra.light.batches import in_batches
from atra.light.checks import check_whole
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels import Texels, atlas_of
from atra.light.lightmaps.maps import Lightmap
from atra.light.lightmaps.paths import AT_ONCE, BakeOptions, Paths
from atra.light.lightmaps.paths_kernels import SUMS, light_texels
from atra.light.lightmaps.priority import on_least_converged_map, visible_texels
from atra.light.lightmaps.probes import LightProbes, probed
from atra.light.pictures.finish.states import fingerprint
from atra.light.scene import Scene
from atra.raster.tracer import RasterTracer
from atra.rays.kernel_scene import Query, scene_for_kernels
from atra.tracing.budgets import check_needed_bytes
from atra.tracing.lifetime import Lifetime, check_same_faces
from atra.tracing.tracer import Tracer

IN_A_PASS = 16
"""Most samples that a texel gets in one pass over the map."""

_FEWEST = 4
"""Least samples that tell a map's error: two doublings."""

_TEXEL_BYTES = 2 * 8 * SUMS + 144
"""Peak memory of a texel: its sums and their means, and the arrays of `Texels` and `Lightmap`."""


class Baker(Lifetime):
    """Bakes a lightmap, sample by sample.

        with Baker(Scene(mesh, lights=[...]), size=512) as baker:
            baker.add(64)

    Paths are those of `PathRenderer`, through all that materials do. Threads, order and view do not change a bit of the
    map.

    Parameters
    ----------
    scene, atlas :
        What is lit, and where its triangles lie on the map (default: `atlas_of(scene, size)`).
    threads, build_quality, robust :
        Of the scene for rays, as for `atra.PixelTracer`.
    bounces, roulette_from : int
        Most reflections of light before it reaches a texel, 0 = direct light alone; bounces after which Russian
        roulette by albedo ends paths, None = never.
    open_length : float
        Distance below which a thing counts as occluding, scene units.
    lights : {"aimed", "grid"}
        How lamps are chosen that a ray is aimed at: by their power; or by what each may give in a grid's cell, with
        less noise for hundreds of lamps.
    seed : int
        Of random numbers.
    clamp : float, optional
        Most radiance that an emitter may add to a sample at once by more than one reflection. It takes away bright
        specks and, with them, light: the mean is biased. None: no limit, unbiased.

    Attributes
    ----------
    texels, samples, visible :
        The texels to light; samples of each, (N,) int32; those that the view shows, (N,) bool, None without a view.
    rays : int
        Rays traced since the map began.

    Raises
    ------
    InputError
        As `Texels.of` and `Atlas` do, and for an option's value.
    MemoryBudgetError
        Before anything large is allocated.

    Examples
    --------
    >>> import atra
    >>> from atra import light
    >>> import numpy as np
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> atlas = light.Atlas.of_uv(np.array([[(0, 0), (1, 0), (0, 1)]]), 8, 8)
    >>> scene = light.Scene.plain(mesh, 0.7, sky=light.constant_sky(1.0))
    >>> with light.Baker(scene, atlas) as baker:
    ...     done = baker.add(16)
    ...     combined = baker.maps.combined
    >>> combined.shape, round(float(combined.max()), 2)
    ((36, 3), 1.0)
    """

    def __init__(
        self, scene: Scene, atlas: Atlas | None = None, size: int = 512, *, threads: int | None = None,
        build_quality: str = "medium", robust: bool = True, bounces: int = 4, roulette_from: int | None = 2,
        open_length: float = 1.0, lights: str = "aimed", seed: int = 0, clamp: float | None = None,
    ) -> None:  # fmt: skip
        super().__init__()
        self.options = BakeOptions(
            threads, build_quality, robust, bounces, roulette_from, open_length, lights, seed, clamp
        )  # fmt: skip
        self._take(scene)
        self._given, self._size = atlas, size
        self.visible: NDArray[np.bool_] | None = None
        self._texels: Texels | None = None
        self._restart()

    def _take(self, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise InputError(f"scene is {scene!r:.100}, expected a Scene; of a mesh, Scene.plain(mesh)")
        self.rays_scene, self.scene = scene_for_kernels(scene.mesh, self.options), scene

    def _build(self) -> tuple[float, float]:
        start = perf_counter()
        self._given = atlas = self._given or atlas_of(self.scene, self._size)
        what = f"sums of a map of {atlas.width} x {atlas.height} texels"
        check_needed_bytes(_TEXEL_BYTES * atlas.width * atlas.height, None, what, "use a smaller map")
        self._texels = Texels.of(self.scene.mesh, atlas)
        self._paths = Paths(self.scene, self._texels, self.options)
        self._restart()
        plan_time_s = perf_counter() - start
        self.rays_scene.build()
        return plan_time_s, self.rays_scene.build_time_s

    def _restart(self) -> None:
        count = 0 if self._texels is None else len(self._texels)
        self.samples = np.zeros(count, np.int32)
        self._sums = np.zeros((count, SUMS))
        self.rays = 0

    @property
    def texels(self) -> Texels:
        """The texels to light; builds where that was not done."""
        if self._texels is None:
            self.build()
        assert self._texels is not None
        return self._texels

    def update(self, scene: Scene) -> None:
        """Take other lights, materials or sky, or other vertices of the same faces; the map starts again.

        The charts stay on the map. Raises InputError for a mesh of other faces, ClosedError after `close`."""
        with self._lock:
            self._check_open()
            if isinstance(scene, Scene) and scene.mesh is self.scene.mesh:
                if self._is_built:
                    self._paths = Paths(scene, self.texels, self.options)
                self.scene = scene
                self._restart()
                return
            before = self.rays_scene
            if isinstance(scene, Scene):
                check_same_faces(self.scene.mesh, scene.mesh)
            self._take(scene)
            before.close()
            self.visible = None
            if self._is_built:
                self.build()

    def look(self, camera: View | None, tracer: Tracer | None = None) -> None:
        """Light first what the camera sees; None: nothing comes first. No sample is lost.

        tracer: finds what the camera sees, of this mesh; it is told to look there. None: the rasteriser.
        """
        with self._in_use():
            self.visible = None if camera is None else self._seen_by(camera, tracer)

    def _seen_by(self, camera: View, tracer: Tracer | None) -> NDArray[np.bool_]:
        if tracer is None:
            with RasterTracer(self.scene.mesh, camera, threads=self.rays_scene.threads) as own:
                return visible_texels(self.texels, own.trace(), self.rays_scene)
        tracer.look(camera)
        return visible_texels(self.texels, tracer.trace(), self.rays_scene)

    def add(self, samples: int = 1, stop: Callable[[], bool] | None = None) -> bool:
        """Add this many samples to every texel; returns whether it finished. stop: asked before every batch; finished
        batches stay.

        Raises InputError for a number below 1, ClosedError after `close`, AtraError naming a texel whose light is not
        finite.
        """
        check_whole("samples", samples, 1)
        with self._in_use():
            done = True
            every = np.ones(len(self.texels), np.bool_)
            while samples > 0 and done:
                count = min(samples, IN_A_PASS)
                done = self._pass(every, count, stop)
                samples -= count
            return done

    def advance(self, target: int, stop: Callable[[], bool] | None = None) -> bool:
        """One pass towards `target` samples of every texel; returns whether there was anything left to do.

        Texels that the view shows come first; of several maps shown, the one with the fewest samples. Other arguments
        and errors as for `add`.
        """
        check_whole("target", target, 1)
        with self._in_use():
            wanted = self.samples < target
            if self.visible is not None and (wanted & self.visible).any():
                wanted &= self.visible
                wanted &= on_least_converged_map(self.texels, self.samples, wanted)
            if not wanted.any():
                return False
            self._pass(wanted, min(target - int(self.samples[wanted].max()), IN_A_PASS), stop)
            return True

    def share_done(self, target: int) -> float:
        """The fraction done of the work until every texel has `target` samples."""
        samples = self.samples  # no lock: asking must not wait for the bake
        return 1.0 - float(np.maximum(target - samples, 0).mean()) / target if len(samples) else 0.0

    def _pass(self, wanted: NDArray[np.bool_], count: int, stop: Callable[[], bool] | None) -> bool:
        """Add `count` samples to the wanted texels; returns whether it finished."""
        with self._in_use():
            order = self.texels.along_curve[wanted[self.texels.along_curve]]

            def add(query: Query, first: int, texels: int) -> int:
                told, tables = np.array([0, -1]), self._paths.tables(query)
                light_texels(order, first, texels, count, self.samples, *tables, self._sums, told)
                if told[1] >= 0:
                    row, column = divmod(int(self.texels.number[told[1]]), self.texels.atlas.width)
                    texel = f"texel ({column}, {row}) is not finite at sample {self.samples[told[1]]}"
                    raise AtraError(f"the light of {texel}; make lights or materials darker")
                return int(told[0])

            done, rays = in_batches(self.rays_scene, len(order), AT_ONCE // count, add, stop)
            self.rays += rays
            return done

    def probes(self, points: ArrayLike, samples: int = 1024) -> LightProbes:
        """Light probes: the light that arrives at points from all around, by `samples` paths each. The map stays as it
        is.

        points: (P, 3), in the world. Raises as `add` does, and InputError naming a point that is not finite.
        """
        check_whole("samples", samples, 1)
        with self._in_use():
            return probed(points, samples, self.scene.mesh.origin, self.rays_scene, self._paths)

    @property
    def maps(self) -> Lightmap:
        """The means of all samples so far; a copy."""
        with self._lock:
            return Lightmap.of(self.texels, self.samples.copy(), self._sums)

    @property
    def error(self) -> float | None:
        """Estimated root mean square error of the luminance over its mean, of valid texels; None before the fourth
        sample. Told by how the map changes while samples double, which knows nothing of light that no sample found."""
        lightmap = self.maps
        known = np.flatnonzero(lightmap.valid)
        if not len(known) or lightmap.samples[known].min() < _FEWEST:
            return None
        mean = float(lightmap.luminance[known].mean())
        return float(np.sqrt(lightmap.squared_error(known) / len(known))) / mean if mean > 0.0 else 0.0

    @property
    def state(self) -> dict[str, NDArray[Any]]:
        """All that `restore` needs to go on, to the bit as if nothing had interrupted; copies."""
        with self._lock:
            return {"fingerprint": self._fingerprint(), "samples": self.samples.copy(), "sums": self._sums.copy()}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on from the `state` of a baker of the same scene, atlas and options; threads may differ. Raises InputError
        for another, ClosedError after `close`."""
        with self._in_use():
            if not np.array_equal(state["fingerprint"], self._fingerprint()):
                raise InputError("it is of another scene, atlas, option or version of atra")
            self.samples[:], self._sums[:] = state["samples"], state["sums"]

    def _fingerprint(self) -> NDArray[np.uint8]:
        return fingerprint(self.scene, self.texels.atlas, options=self.options)

    def _release(self) -> None:
        self.rays_scene.close()
