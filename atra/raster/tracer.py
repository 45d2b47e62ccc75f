"""Rasterisation: what the rays through the pixels see, found without shooting any; no BVH, and no Embree."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Reduction
from atra.compiled.instruction_sets import native_lanes
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.exact.ties import TieTiles, coplanar_overlaps, lowest_of_ties, tie_tiles
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range
from atra.geometry.view import View
from atra.hits import Hits
from atra.raster.all_hits.frames import gather_frame
from atra.raster.frames import Scratch, draw_frame
from atra.raster.lenses.frames import LensDrawing
from atra.tracing.all_hits import Gathering, target_of
from atra.tracing.budgets import check_image_memory
from atra.tracing.images import images_of, outputs
from atra.tracing.lifetime import in_turn
from atra.tracing.options import RasterKeywords, RasterOptions, lists_options


class RasterTracer(Gathering):
    """Every triangle drawn onto the image, exactly where the rays of its pixels meet it, nearest in front.

    options: see `atra.RasterOptions`. What it builds, clusters of triangles, are of the mesh alone, so `look` changes
    the camera at no price.
    Raises InputError as the options do, and for a mesh smaller than 1e-9 or farther than 1e11 from the eye;
    MemoryBudgetError for an image that the free memory cannot hold.
    """

    embree_bytes = 0
    packet_width = 1

    @lists_options(RasterOptions)
    def __init__(self, mesh: Mesh, camera: View, **options: Unpack[RasterKeywords]) -> None:
        super().__init__()
        self.options = RasterOptions.of(type(self).__name__, options)
        self.lanes = self.options.lanes or native_lanes()
        self.threads = resolve_threads(self.options.threads)
        self._pool = WorkerPool(self.threads)
        self._scratch: Scratch | None = None
        self._lens_drawing = LensDrawing()
        self._pixels_checked = 0
        self._show(mesh, camera)

    def _show(self, mesh: Mesh, camera: View) -> None:
        check_range(mesh, camera, takes_lenses=True)
        pixels = camera.width * camera.height
        if pixels > self._pixels_checked:  # asking how much memory is free takes a tenth of a small frame
            check_image_memory(camera.height, camera.width)
            self._pixels_checked = pixels
        self.mesh, self.camera = mesh, camera
        self._tie_tiles: TieTiles | None = None  # where to look for ties; found when first needed

    def _look(self, camera: View) -> bool:
        self._show(self.mesh, camera)
        return True

    @property
    def views(self) -> tuple[tuple[Mesh, View], ...]:
        """What the image shows, and its camera."""
        return ((self.mesh, self.camera),)

    def _plan(self) -> float:
        if self.options.ties == "lowest":  # found once per mesh, like reading it, and so outside the clock of a plan
            coplanar_overlaps(self.mesh)
        start = perf_counter()
        if self.options.ties == "lowest":
            self._find_ties()
        return perf_counter() - start

    def _find_ties(self) -> TieTiles:
        if self._tie_tiles is None:
            self._tie_tiles = tie_tiles(self.mesh, self.camera)
        return self._tie_tiles

    def _build(self) -> float:
        start = perf_counter()
        self._scratch = Scratch.of(self.mesh, self._pool)
        return perf_counter() - start

    def _trace(self, offset: tuple[float, float], out: Hits | None) -> Hits:
        assert self._scratch is not None
        camera = self.camera
        images = outputs((camera.height, camera.width), camera.width, images_of(out))
        directions, rest = None, (offset, self.lanes, self._scratch, self._pool, images)
        if isinstance(camera, LensView):
            self._lens_drawing.draw(self.mesh, camera, *rest)
            directions = self._lens_drawing.rays.directions(camera, offset, self._pool)
        else:
            draw_frame(self.mesh, camera, *rest)
        depth, prim_id = images
        if self.options.ties == "lowest":
            tiles = self._find_ties()
            if tiles.any:
                lowest_of_ties(self.mesh, camera, tiles, offset, prim_id, self._pool, directions)
        return Hits(depth, prim_id, offset, self.mesh, camera, self.threads)

    def _check_gathering(self) -> None:
        check_range(self.mesh, self.camera)  # all hits of a lens are not found

    def _gather(
        self,
        what: Reduction[Any],
        offset: tuple[float, float],
        images: dict[str, NDArray],
        weights: NDArray[np.float32] | None,
        is_known: bool,
    ) -> None:
        assert self._scratch is not None
        target = target_of(images, weights, None, is_known)
        gather_frame(self.mesh, self.camera, offset, self.lanes, self._scratch, self._pool, what.kind, target)

    @property
    def triangle_count(self) -> int:
        """Triangles of the mesh, hidden ones included."""
        return self.mesh.triangle_count

    @property
    @in_turn
    def counters(self) -> Mapping[str, float]:
        """What `atra.Tracer` says of counters; scratch_bytes, the memory that frames share, is known, too."""
        scratch_bytes = 0 if self._scratch is None else self._scratch.bytes + self._lens_drawing.bytes
        return {"triangles_traced": self.triangle_count, "scratch_bytes": scratch_bytes}

    def _release(self) -> None:
        self._pool.close()
        self._scratch = None
