"""The tracer: images of a mesh through a camera, by one of several methods."""

from __future__ import annotations

from collections.abc import Mapping
from time import perf_counter
from typing import final

import numpy as np
from numpy.typing import NDArray

from atra.all_hits.reductions import Gathered, Reduction, check_reduction
from atra.choices import check_choice
from atra.compiled.instruction_sets import chosen_instruction_set
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.exact.ties import TieTiles, coplanar_overlaps, lowest_of_ties, tie_tiles
from atra.geometry.lenses.lens_view import LensView
from atra.geometry.mesh import Mesh
from atra.geometry.view import View, check_offset
from atra.hits import Hits
from atra.tracing.budgets import check_image_memory
from atra.tracing.gathering import keep_memory, target_images
from atra.tracing.images import images_of, outputs
from atra.tracing.lens_rays import lens_directions
from atra.tracing.lifetime import Lifetime, check_same_faces, synchronized
from atra.tracing.method import Gathering, Method, Prepared

TIES = ("lowest", "any")
"""Rules for triangles of one plane that overlap: the lowest prim_id is stored, or whichever float32 rounding puts in
front."""


@final
class Tracer(Lifetime):
    """Images of a mesh through a camera, by a method such as the rasteriser.

    The first `trace` builds; `with` and `build` do so earlier. `look` changes the camera, `update` takes other vertices
    of the same faces. Several threads may call in any order: each call waits for the one in progress.

    Parameters
    ----------
    mesh, camera :
        What is traced, and by which rays.
    method :
        A value of the protocol `atra.Method`, such as `atra.RasterTracer` and the like make, or one of your own.
    threads : int, optional
        Threads of a frame; None takes every core that the process may use.
    ties : {"lowest", "any"}
        What is stored where triangles of one plane overlap: the lowest `prim_id`, or whichever float32 rounding puts
        in front.

    Attributes
    ----------
    prepared :
        What the method made for mesh and camera; None before `build`.
    plan_time_s, build_time_s : float
        Seconds that planning (culling, shearing, finding ties) and building took, 0 before.

    Raises
    ------
    InputError
        For a mesh, a camera or an option that the method cannot take.
    MemoryBudgetError
        For an image, copies or overlaps that the free memory cannot hold.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> cameras = atra.orbit(mesh, views=3, width=64, height=48)
    >>> with atra.RasterTracer(mesh, cameras[0]) as tracer:
    ...     for camera in cameras:
    ...         tracer.look(camera)
    ...         print(tracer.trace().hit.any())
    False
    True
    True
    """

    def __init__(
        self, mesh: Mesh, camera: View, method: Method, *, threads: int | None = None, ties: str = "lowest"
    ) -> None:
        super().__init__()
        check_choice("ties", ties, TIES)
        self.threads = resolve_threads(threads)
        chosen_instruction_set()  # refuses a wrong ATRA_ISA, also where there is no Embree to do so
        self.method, self.ties = method, ties
        self.prepared: Prepared | None = None
        self._tie_tiles: TieTiles | None = None
        self._pixels_checked = 0
        self._show(mesh, camera)
        self._pool = WorkerPool(self.threads)

    def _show(self, mesh: Mesh, camera: View) -> None:
        """Take mesh and camera; changes nothing where they are refused."""
        pixels = camera.width * camera.height if isinstance(camera, View) else 0  # the method refuses anything else
        if pixels > self._pixels_checked:  # asking how much memory is free takes a tenth of a small frame
            check_image_memory(camera.height, camera.width)
        self.method.check(mesh, camera)
        self._pixels_checked = max(pixels, self._pixels_checked)
        self.mesh, self.camera = mesh, camera
        self._tie_tiles = None  # where to look for ties; found when first needed

    def _build(self) -> tuple[float, float]:
        self._forget()  # before anything is built: both together may not fit
        ties_time_s = 0.0
        prepared = self.prepared = self.method.prepare(self.mesh, self.camera, self._pool)
        if self.ties == "lowest":
            coplanar_overlaps(self.mesh)  # found once per mesh, like reading it, and so outside the clock of a plan
            start = perf_counter()
            self._find_ties()
            ties_time_s = perf_counter() - start
        return prepared.plan_time_s + ties_time_s, prepared.build_time_s

    def _find_ties(self) -> TieTiles:
        if self._tie_tiles is None:
            self._tie_tiles = tie_tiles(self.mesh, self.camera)
        return self._tie_tiles

    def trace(self, offset: tuple[float, float] = (0.5, 0.5), out: Hits | None = None) -> Hits:
        """Find the nearest hit of every pixel's ray; builds first where that was not done.

        Parameters
        ----------
        offset : (float, float)
            All rays go through this sub-pixel position of their pixels, in [0, 1) x [0, 1).
        out : Hits, optional
            An earlier result of this tracer whose arrays are overwritten, which saves allocating an image. It must not
            be read any more.

        Returns
        -------
        Hits
            Depth (H, W) float32 and `prim_id` (H, W) uint32.

        Raises
        ------
        InputError
            For an offset outside the pixel, or an `out` that does not fit.
        ClosedError
            After `close`.
        """
        check_offset(offset)
        with self._in_use():
            camera, prepared = self.camera, self.prepared
            assert prepared is not None
            depth, prim_id = outputs((camera.height, camera.width), prepared.row_stride or camera.width, images_of(out))
            prepared.draw(offset, depth, prim_id)
            if self.ties == "lowest":
                settle_ties(self.mesh, camera, self._find_ties(), offset, prim_id, self._pool)
            return Hits(depth, prim_id, offset, self.mesh, camera, self.threads)

    def gather(
        self, what: Reduction[Gathered], offset: tuple[float, float] = (0.5, 0.5), out: Gathered | None = None
    ) -> Gathered:
        """Reduce all hits along the ray of every pixel, each exactly once, to a number or a few.

        Parameters
        ----------
        what :
            `atra.Count()`, `atra.Thickness()`, `atra.Transmittance(factors)` or `atra.Layers(k)`. Which triangles a ray
            crosses at edges and corners: `atra.all_hits.reductions`.
        offset : (float, float)
            As for `trace`.
        out : optional
            An earlier result of this tracer for as much of the same, whose arrays are overwritten. It must not be read
            any more.

        Returns
        -------
        The result of the reduction, such as `ThicknessResult`, with arrays of (H, W) or (k, H, W).

        Raises
        ------
        InputError
            For an offset outside the pixel, an `out` that does not fit, a mesh that `what` is not for, a method that
            cannot gather, and build quality "high", with which Embree finds some triangles twice.
        MemoryBudgetError
            For a result that the free memory does not hold.
        ClosedError
            After `close`.
        """
        check_reduction(what)
        check_offset(offset)
        with self._lock:
            self.method.check_gathering(self.camera)
            with self._in_use():
                prepared = self.prepared
                assert isinstance(prepared, Gathering)
                weights = what.weights(self.mesh)
                height, width = self.camera.height, self.camera.width
                images, is_known = target_images(what, height, width, prepared.gathering_stride, out)
                prepared.gather(what, offset, images, weights, is_known)
                arrays = {name: image[..., :height, :width] for name, image in images.items()}
                for array in arrays.values():
                    array.setflags(write=False)
                result = what.result(**arrays, offset=offset, mesh=self.mesh, camera=self.camera)
                keep_memory(result, images)
                return result

    @synchronized
    def look(self, camera: View) -> None:
        """Trace what another camera sees from the next frame on.

        What depends on the camera is rebuilt at once if it was built, and the times say what that took. A camera that
        is refused changes nothing; where building fails, the next use builds again.

        Parameters
        ----------
        camera : View
            It may be of another size or kind.

        Raises
        ------
        InputError, MemoryBudgetError, EmbreeError
            As making and building a new tracer would.
        ClosedError
            After `close`.
        """
        self._check_open()
        self._show(self.mesh, camera)
        if self._is_built and not (self.prepared and self.prepared.still_serves(camera)):
            self.build()

    @synchronized
    def update(self, mesh: Mesh) -> None:
        """Go on with other vertices, such as another pose, of the same faces.

        What was built is rebuilt at once; where that fails, the next use builds again.

        Parameters
        ----------
        mesh : Mesh
            With the faces of the mesh before.

        Raises
        ------
        InputError, MemoryBudgetError, EmbreeError
            For other faces, and as making and building a new tracer would.
        ClosedError
            After `close`.
        """
        self._check_open()
        check_same_faces(self.mesh, mesh)
        self._show(mesh, self.camera)
        if self._is_built:
            self.build()

    @property
    def packet_width(self) -> int:
        """Rays of a packet; 1 for single rays and where there are none, 0 where the method does not tell."""
        return self.method.rays_per_packet

    @property
    def views(self) -> tuple[tuple[Mesh, View], ...]:
        """What the image shows, and its camera."""
        return ((self.mesh, self.camera),)

    @property
    @synchronized
    def triangle_count(self) -> int:
        """Triangles that are traced or drawn, copies included; 0 before `build`."""
        return 0 if self.prepared is None else self.prepared.triangle_count

    @property
    @synchronized
    def embree_bytes(self) -> int:
        """Bytes that Embree holds for this tracer by its own account; 0 before `build` and without Embree."""
        return 0 if self.prepared is None else self.prepared.embree_bytes

    @property
    @synchronized
    def counters(self) -> Mapping[str, float]:
        """What the method counts, plain numbers by name, of what was built and of the last frame.

        triangles_traced: `triangle_count`; embree_bytes: as above, where there is Embree. Methods may tell more:
        triangles_left_out: over all images, traced pixel by pixel because float32 cannot show sheared copies of them
        exactly enough. packets_verified: that the second pass of the last frame had to trace. probe_time_s: seconds of
        plan_time_s that the probe took. scratch_bytes: memory that the frames of the rasteriser share.
        """
        own = {} if self.prepared is None else self.prepared.counters
        return {"triangles_traced": self.triangle_count, **own}

    def _forget(self) -> None:
        if self.prepared is not None:
            self.prepared.close()
            self.prepared = None

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        self._forget()


def settle_ties(
    mesh: Mesh,
    camera: View,
    tiles: TieTiles,
    offset: tuple[float, float],
    prim_id: NDArray[np.uint32],
    pool: WorkerPool,
) -> None:
    """Store the lowest prim_id wherever triangles of one plane overlap in an image; prim_id: (H, W), changed."""
    if tiles.any:
        directions = lens_directions(camera, offset, pool) if isinstance(camera, LensView) else None
        lowest_of_ties(mesh, camera, tiles, offset, prim_id, pool, directions)
