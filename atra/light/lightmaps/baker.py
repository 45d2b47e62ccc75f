"""The baker: Monte Carlo samples of the light that reaches a lightmap's texels."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.errors import AtraError, InputError
from atra.geometry.view import View
from atra.light.checks import check_whole
from atra.light.lightmaps.batches import Job, Stages, Work, in_batches, needed_bytes, new_batch, stage_seconds
from atra.light.lightmaps.charts.atlas import Atlas
from atra.light.lightmaps.charts.texels import Texels
from atra.light.lightmaps.gather.adaptive import is_enough, is_looked_at, until_next_look
from atra.light.lightmaps.gather.probes import BLOCK, LightProbes, ProbeSums
from atra.light.lightmaps.gather.tables import tables_of
from atra.light.lightmaps.gather.tables_kernels import SUMS, Batch, Tables
from atra.light.lightmaps.maps import Lightmap
from atra.light.lightmaps.options import BakeOptions
from atra.light.lightmaps.paint_kernels import Paint
from atra.light.lightmaps.paths.stages import AT_ONCE, Paths, PathsOfThread
from atra.light.lightmaps.priority import on_least_converged_map, ordered, visible_texels
from atra.light.lightmaps.shadows import ShadowScenes
from atra.light.lightmaps.surface import BakeScene
from atra.light.scene import Scene
from atra.raster.tracer import RasterTracer
from atra.rays.kernel_scene import Query, scene_for_kernels
from atra.tracing.budgets import check_needed_bytes
from atra.tracing.lifetime import Lifetime, check_same_faces
from atra.tracing.tracer import Tracer


class Baker(Lifetime):
    """Bakes a lightmap, sample by sample.

        with Baker(Scene(mesh, lights=[...]), size=512) as baker:
            baker.add(64)

    The paths of a `Scene` are those of `PathRenderer`, through all that materials do. Those of a `BakeScene`, whose
    surfaces reflect equally to all sides, pass stages in batches; with single rays the number of threads, batch_rays,
    expansion and compaction do not change a bit of the map.

    Parameters
    ----------
    scene, atlas :
        What is lit, and where its triangles lie on the map (default: charts by xatlas on a map of `size` texels).
    threads, packet_width, build_quality, robust :
        Of the scene for rays, as for `atra.PixelTracer`.
    bounces, roulette_from : int
        Most reflections of light before it reaches a texel, 0 = direct light alone; bounces after which Russian
        roulette by albedo ends paths, None = never.
    open_length : float
        Distance below which a thing counts as occluding, scene units.
    environment : {"mis", "light", "bsdf"}
        Of a `BakeScene`: what finds a panorama's light: both kinds of rays by the balance heuristic, rays aimed at
        bright parts, or scattered rays; for other skies always scattered rays.
    lights : {"uniform", "grid"}
        Of a `BakeScene`: light that a ray after a bounce is aimed at: any; or by what each may give in a grid's cell.
    adaptive : bool
        Stop texels whose mean is within 1 % with a confidence of 99 %, after 64, 128, ... samples: a little biased.
    batch_rays, expansion, seed : int
        Of a `BakeScene`: rays in flight of all threads, which determine the memory. Samples of a texel side by side; of
        random numbers.
    compaction : {"none", "texels", "bounces"}
        Of a `BakeScene`: lanes packed together: all of the map, lit texels, or also paths that go on after a bounce.

    Attributes
    ----------
    texels, samples, visible :
        The texels to light; samples of each, (N,) int32; those that the view shows, (N,) bool, None without a view.
    stage_s, rays, lanes :
        Seconds by stage since the last restart, averaged over threads; rays traced, and lanes of their batches.

    Raises
    ------
    InputError
        As `Texels.of` and `Atlas` do, and for an option's value.
    MemoryBudgetError
        Before anything large is allocated.
    """

    def __init__(
        self, scene: BakeScene | Scene, atlas: Atlas | None = None, size: int = 512, *,
        threads: int | None = None, packet_width: int | None = 1, build_quality: str = "medium", robust: bool = True,
        bounces: int = 4, roulette_from: int | None = 2, open_length: float = 1.0, environment: str = "mis",
        lights: str = "uniform", adaptive: bool = False, batch_rays: int = 1 << 19, expansion: int = 16,
        compaction: str = "bounces", seed: int = 0,
    ) -> None:  # fmt: skip
        super().__init__()
        self.options = BakeOptions(
            threads, packet_width, build_quality, robust, bounces, roulette_from, open_length, environment, lights,
            adaptive, batch_rays, expansion, compaction, seed,
        )  # fmt: skip
        self._take(scene)
        self._given, self._size = atlas, size
        self.visible: NDArray[np.bool_] | None = None
        self._texels: Texels | None = None
        self._restart()

    def _take(self, scene: BakeScene | Scene) -> None:
        is_waves = isinstance(scene, BakeScene)
        rays_scene = scene_for_kernels(scene.mesh, self.options if is_waves else self.options.for_paths())
        self.shadow_scenes = ShadowScenes(scene, self.options)
        self.rays_scene, self.scene = rays_scene, scene

    def _build(self) -> tuple[float, float]:
        start = perf_counter()
        self._given = atlas = self._given or Atlas.unwrap(self.scene.mesh, self._size)
        needed = needed_bytes(atlas.width * atlas.height, self.options.batch_rays)
        what = f"sums of a map of {atlas.width} x {atlas.height} texels and rays in flight"
        check_needed_bytes(needed, None, what, "use a smaller map, or fewer batch_rays")
        self._texels = Texels.of(self.scene.mesh, atlas)
        self._tables = self._tables_of(self.scene)
        self._restart()
        plan_time_s = perf_counter() - start
        self.rays_scene.build()
        return plan_time_s, self.rays_scene.build_time_s + self.shadow_scenes.build()

    def _tables_of(self, scene: BakeScene | Scene) -> Paths | tuple[Tables, Paint | None]:
        if isinstance(scene, Scene):
            return Paths(scene, self.texels, self.options)
        return tables_of(scene, self.texels, self.options), scene.paint

    def _restart(self) -> None:
        count = 0 if self._texels is None else len(self._texels)
        self.samples = np.zeros(count, np.int32)
        self._sums = np.zeros((count, SUMS))
        self._enough = np.zeros(count, np.bool_)
        self._batches: list[Batch | None] = [None] * self.rays_scene.threads
        self.stage_s: dict[str, float] = {}
        self.rays = self.lanes = 0

    @property
    def texels(self) -> Texels:
        """The texels to light; builds where that was not done."""
        if self._texels is None:
            self.build()
        assert self._texels is not None
        return self._texels

    @property
    def buffer_bytes(self) -> int:
        """Memory of the rays in flight."""
        return sum(array.nbytes for batch in self._batches if batch is not None for array in batch)

    def update(self, scene: BakeScene | Scene) -> None:
        """Take other lights, surfaces or sky, or other vertices of the same faces; the map starts anew.

        The charts stay on the map. Raises InputError for a mesh of other faces, ClosedError after `close`."""
        with self._lock:
            self._check_open()
            if type(scene) is not type(self.scene):
                raise InputError(f"scene is a {type(scene).__name__}, expected a {type(self.scene).__name__} as before")
            if scene.mesh is not self.scene.mesh:
                check_same_faces(self.scene.mesh, scene.mesh)
                before = self.rays_scene, self.shadow_scenes
                self._take(scene)
                for one in before:
                    one.close()
                self.visible = None
                if self._is_built:
                    self.build()
                return
            tables = self._tables_of(scene)
            if not self.shadow_scenes.serve(scene):
                shadow_scenes = ShadowScenes(scene, self.options)
                self.shadow_scenes.close()
                self.shadow_scenes = shadow_scenes
            self.scene, self._tables = scene, tables
            self._restart()

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
                count = min(samples, self.options.expansion)
                done = self._pass(every, count, stop)
                samples -= count
            return done

    def advance(self, target: int, stop: Callable[[], bool] | None = None) -> bool:
        """One pass towards `target` samples of every texel; returns whether there was anything left to do.

        Texels that the view shows come first; of several maps shown, the one with the fewest samples. With `adaptive`,
        texels that have enough are skipped. Other arguments and errors as for `add`.
        """
        check_whole("target", target, 1)
        with self._in_use():
            wanted = (self.samples < target) & ~self._enough
            if self.visible is not None and (wanted & self.visible).any():
                wanted &= self.visible
                wanted &= on_least_converged_map(self.texels, self.samples, wanted)
            if not wanted.any():
                return False
            count = min(target - int(self.samples[wanted].max()), self.options.expansion)
            if not self.options.adaptive:
                self._pass(wanted, count, stop)
                return True
            self._pass(wanted, min(count, until_next_look(self.samples[wanted])), stop)
            looked_at = wanted & is_looked_at(self.samples)
            if looked_at.any():
                self._enough |= looked_at & is_enough(self.maps)
            return True

    def share_done(self, target: int) -> float:
        """The fraction done of the work until every texel has `target` samples or, with `adaptive`, enough."""
        enough, samples = self._enough, self.samples  # no lock: asking must not wait for the bake
        left = np.where(enough, 0, np.maximum(target - samples, 0))
        return 1.0 - float(left.mean()) / target if len(left) else 0.0

    def _pass(self, wanted: NDArray[np.bool_], count: int, stop: Callable[[], bool] | None) -> bool:
        """Add `count` samples to the wanted texels; returns whether it finished."""
        with self._in_use():
            start = perf_counter()
            order = ordered(self.texels, wanted, whole_rows=self.options.compaction == "none")
            ordered_s = perf_counter() - start
            job = Job(self.texels, order, count, self.samples, self._sums)

            def add(first: int, texels: int, stages: Stages | PathsOfThread) -> None:
                bad = stages.add(job, first, texels)
                if bad >= 0:
                    row, column = divmod(int(self.texels.number[bad]), self.texels.atlas.width)
                    texel = f"texel ({column}, {row}) is not finite at sample {self.samples[bad]}"
                    raise AtraError(f"the light of {texel}; make lights or materials darker")

            done, works = self._in_batches(len(order), count, add, stop)
            self.rays += sum(one.rays for one in works)
            self.lanes += sum(one.lanes for one in works)
            for stage, seconds in stage_seconds(works, ordered_s, perf_counter() - start).items():
                self.stage_s[stage] = self.stage_s.get(stage, 0.0) + seconds
            return done

    def _in_batches(
        self, starts: int, of_each: int, add: Callable[[int, int, Stages | PathsOfThread], None],
        stop: Callable[[], bool] | None = None,
    ) -> tuple[bool, list[Work]]:  # fmt: skip
        """As `in_batches`; of_each: rays per entry."""
        rays = max(self.options.batch_rays // self.rays_scene.threads, of_each)
        per_batch = max(1, (AT_ONCE if isinstance(self._tables, Paths) else rays) // of_each)
        return in_batches(
            self.rays_scene, starts, per_batch, lambda query, work: self._stages(query, work, rays), add, stop
        )

    def probes(self, points: ArrayLike, samples: int = 1024) -> LightProbes:
        """Light probes: the light that arrives at points from all around, by `samples` paths each. The map stays as it
        is.

        points: (P, 3), in the world. Raises as `add` does, and InputError naming a point that is not finite.
        """
        check_whole("samples", samples, 1)
        sums = ProbeSums(points, samples, self.scene.mesh.origin)
        with self._in_use():
            self._in_batches(
                len(sums.points), BLOCK, lambda first, count, stages: stages.add_probes(sums, first, count)
            )
        return sums.probes()

    def _batch(self, worker: int, rays: int) -> Batch:
        batch = self._batches[worker]
        if batch is None or len(batch.key) < rays:
            batch = self._batches[worker] = new_batch(rays)
        return batch

    def _stages(self, query: Query, work: Work, rays: int) -> Stages | PathsOfThread:
        if isinstance(self._tables, Paths):
            return self._tables.of_thread(query, work)
        kind = self.rays_scene.packet_width, self.shadow_scenes.addresses(query.scene)
        return Stages(self._tables, self.options, kind, query, work, self._batch(query.worker, rays))

    @property
    def maps(self) -> Lightmap:
        """The means of all samples so far; a copy."""
        with self._lock:
            return Lightmap.of(self.texels, self.samples.copy(), self._sums)

    def _release(self) -> None:
        self.rays_scene.close()
        self.shadow_scenes.close()
