"""Meshes that rays of no camera are shot at in batches."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.all_hits.reductions import Reduction
from atra.choices import check_choice
from atra.compiled.instruction_sets import chosen_instruction_set
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.scene import BUILD_QUALITIES, resolve_packet_width
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.rays.all_hits.contains import FARTHEST_POINT, METHODS, Interior, check_points
from atra.rays.all_hits.gathered import RayHitLists, RayLayers, gathered
from atra.rays.geometries import Geometries, joined
from atra.rays.kernel_scene import NO_T, KernelScene
from atra.rays.rays import RayHits, Rays, checked_out, hits_memory, rays_of
from atra.rays.tree.finding import MOST, HitFinder, Progress
from atra.tracing.lifetime import Lifetime
from atra.whole_numbers import is_whole_number

PRECISIONS = ("exact", "watertight", "fast")
"""How the hits of rays of one's own are found."""


class RayScene(Lifetime):
    """Rays that come from no camera: closest hits, occlusion, all hits, and whether points are inside.

    The first batch builds; `with` builds on entry and closes on exit, and `build` and `close` do so by hand. Several
    threads may use one scene; their batches wait for each other.

    **The hit of a ray** is that of the ray as given, its numbers as stored, with the vertices as stored, in exact
    arithmetic: the nearest, and of equally near ones that of the lowest `prim_id`. A ray through an edge or corner
    counts as moved by an infinitely small way (`atra.exact.lines_kernels`), so it hits one of the triangles that meet
    there, and a triangle seen edge-on never. `t` is right to a unit of float32; in `all_hits` it is float64, within
    2^-29 of the distance to the mesh's farthest corner. `precision="exact"`, the default, keeps this; "watertight" and
    "fast" ask Embree, in `intersect` and `occluded` alone: rays are rounded to float32, triangles seen all but edge-on
    may be lost or hit beside, t may be off, and of equally near ones any is stored.
    `all_hits`, `count`, `gather` and `contains` are exact with each.

    Parameters
    ----------
    mesh
        One, or a list of several. One mesh may be in the list many times; each copy takes memory of its own.
        `geometry_id` counts the meshes.
    transforms : (G, 3, 4) or (G, 4, 4), optional
        Affine maps of the meshes into the world; None: as they are. One that mirrors turns the winding, so that fronts
        stay outside.
    faces : (F,) bool, optional
        Those of all meshes together that rays meet; None: all.
    touches
        A ray that meets an outline in an edge or corner alone hits it, as in Embree. For "exact" alone.
    threads
        Of a batch; None takes every core that the process may use.
    precision
        "exact" decides hits without rounding; "watertight" takes Embree's robust arithmetic, with which no ray slips
        through between two triangles; "fast" takes Embree's fast arithmetic, with which some do, and more of them past
        meshes that lie many times their size away from the world's origin.
    packet_width, build_quality
        Of Embree, for "watertight" and "fast". Without a packet_width only coherent rays go in packets, and others are
        traced one by one, which is faster.

    Raises
    ------
    InputError
        For an option's value, for faces of another shape or type, and for a mesh smaller than 1e-9 or farther than 1e11
        from the world's origin.

    Source: `rtcIntersect1/4/8/16` and `rtcOccluded1/4/8/16` of Embree's API, with its RTC_RAY_QUERY_FLAG_COHERENT for
    `coherent` and RTC_SCENE_FLAG_ROBUST for "watertight"; Gribble, Wald et al. as in `atra.trees` for our own tree.

    Examples
    --------
    >>> import atra
    >>> mesh = atra.Mesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])
    >>> hits = atra.RayScene(mesh).intersect([(0.2, 0.2, 2)], [(0, 0, -1)])
    >>> hits.t.tolist(), hits.prim_id.tolist()
    ([2.0], [0])
    """

    def __init__(
        self,
        mesh: Mesh | Sequence[Mesh],
        *,
        transforms: ArrayLike | None = None,
        faces: NDArray[np.bool_] | None = None,
        touches: bool = False,
        threads: int | None = None,
        precision: str = "exact",
        packet_width: int | None = None,
        build_quality: str = "medium",
    ) -> None:
        check_choice("precision", precision, PRECISIONS)
        check_choice("build_quality", build_quality, BUILD_QUALITIES)
        chosen_instruction_set()  # refuses a wrong ATRA_ISA
        if touches and precision != "exact":
            raise InputError(f'touches is {touches!r}, expected False with precision="{precision}"')
        super().__init__()
        self.precision, self.build_quality, self._touches = precision, build_quality, bool(touches)
        self.packet_width, self.threads = resolve_packet_width(packet_width), resolve_threads(threads)
        self._take(joined(mesh, transforms, faces))
        self._pool = WorkerPool(self.threads)
        self._embree: KernelScene | None = None
        if precision != "exact":
            own: dict[str, Any] = {"packet_width": packet_width, "build_quality": build_quality, "pool": self._pool}
            self._embree = KernelScene(self.mesh, faces=faces, robust=precision == "watertight", **own)

    def _take(self, geometries: Geometries) -> None:
        self.geometries, self.mesh = geometries, geometries.mesh
        self._finder: HitFinder | None = None
        self._interior: Interior | None = None

    def update(self, mesh: Mesh | Sequence[Mesh], transforms: ArrayLike | None = None) -> None:
        """Go on with other vertices of the same faces, or other transforms; None: those of before.

        What is built is built again at once; where that fails, the next use builds again.
        Raises InputError for other faces, and what making and building a new one would; ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            self._take(self.geometries.moved(mesh, transforms))
            if self._embree is not None:
                self._embree.take(self.mesh)
            if self._is_built:
                self.build()

    def _build(self) -> tuple[float, float]:
        if self._embree is not None:
            self._embree.build()
            return 0.0, self._embree.build_time_s
        start = perf_counter()
        self._current_finder()
        return 0.0, perf_counter() - start

    def _current_finder(self) -> HitFinder:
        """The exact finder of hits; its tree is built on first use. Raises ClosedError after `close`."""
        self._check_open()
        if self._finder is None:
            self._finder = HitFinder(self.mesh.local, self.geometries.faces, self._pool)
        return self._finder

    def intersect(
        self, origins: Rays | ArrayLike, directions: ArrayLike | None = None, *,
        tnear: ArrayLike | None = None, tfar: ArrayLike | None = None, coherent: bool | None = None,
        out: RayHits | None = None,
    ) -> RayHits:  # fmt: skip
        """The closest hit of every ray between its `tnear` and `tfar`.

        Parameters
        ----------
        origins, directions : (..., 3) each
            (3,) is one for all. Or one array (..., 6) of both; or `atra.Rays` in their place, which are not checked and
            copied again at every call.
        tnear, tfar : numbers, or of the rays' leading shape, which results keep
            None: 0 and inf.
        coherent
            Whether neighbours in the batch start near each other and head the same way, as camera rays and those to
            the sun do, and are taken through the tree together: they are then traced up to twice as fast, but others
            take two to three times as long. None: a sample of the batch tells. Where most are not coherent, rays are
            traced one by one, and many at a large mesh in an order in which rays near by follow each other. The hits
            are as right either way.
        out
            An earlier result of as many rays, whose arrays are overwritten; it must not be read any more.

        Raises InputError for rays that `atra.Rays` refuses and an `out` that does not fit, ClosedError after `close`.
        """
        rays, shape = rays_of(origins, directions, tnear, tfar)
        t, prim_id = hits_memory(out, shape)
        with self._in_use():
            self._hit(rays, coherent, t.reshape(-1), prim_id.reshape(-1))
            if self.geometries.count == 1 and not self.geometries.is_mirrored[0]:
                return RayHits(t, prim_id, rays, self.mesh)
            traced_id = prim_id.copy()
            prim_id[...] = self.geometries.own_ids(traced_id)
            return RayHits(t, prim_id, rays, self.mesh, self.geometries, traced_id)

    def occluded(
        self, origins: Rays | ArrayLike, directions: ArrayLike | None = None, *,
        tnear: ArrayLike | None = None, tfar: ArrayLike | None = None, coherent: bool | None = None,
        out: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_]:  # fmt: skip
        """(...) bool: whether a ray hits anything between its `tnear` and `tfar`; faster than finding what.

        Arguments, shapes and errors as for `intersect`. out: a bool array of that shape, overwritten and returned.
        """
        rays, shape = rays_of(origins, directions, tnear, tfar)
        found = np.empty(shape, np.bool_) if out is None else checked_out("out", out, np.bool_, shape)
        with self._in_use():
            self._hit(rays, coherent, NO_T, found.reshape(-1).view(np.uint8))
        return found

    def _hit(self, rays: Rays, coherent: bool | None, t: NDArray[np.float32], answers: NDArray[Any]) -> None:
        own = rays.counted_from(self.mesh.origin)
        if self._embree is not None:
            self._embree.hit(own, coherent, t, answers)
        else:
            self._current_finder().hit(own, coherent, t, answers, self._touches)

    def all_hits(
        self, origins: Rays | ArrayLike, directions: ArrayLike | None = None, *,
        tnear: ArrayLike | None = None, tfar: ArrayLike | None = None, max_hits: int | None = None,
        progress: Progress | None = None,
    ) -> RayHitLists:  # fmt: skip
        """All hits of every ray with tnear <= t < tfar, each triangle that a ray crosses exactly once.

        A closed mesh is left as often as it is entered, and coplanar triangles count each. A triangle seen edge-on is
        not crossed.

        Parameters
        ----------
        origins, directions, tnear, tfar
            As for `intersect`.
        max_hits
            How many to keep of each ray, the nearest; None: all.
        progress
            Called as progress(rays done, all rays) after each batch of 65,536.

        Raises InputError for rays that `atra.Rays` refuses and a max_hits below 1; MemoryBudgetError, before the memory
        is full, for more hits than it holds; ClosedError after `close`.
        """
        if max_hits is not None and not (is_whole_number(max_hits) and 1 <= max_hits <= MOST):
            raise InputError(f"max_hits is {max_hits!r}, expected a whole number from 1 to {MOST}, or None for all")
        rays, shape = rays_of(origins, directions, tnear, tfar)
        with self._lock:
            most, own = MOST if max_hits is None else int(max_hits), rays.counted_from(self.mesh.origin)
            found = self._current_finder().find(own, most, progress)
            u, v = self.geometries.own_weights(found.u, found.v, found.prim_id)
            return RayHitLists(
                found.ray_splits, found.t, found.prim_id, u, v, found.truncated, shape, rays, self.geometries
            )

    def count(
        self, origins: Rays | ArrayLike, directions: ArrayLike | None = None, *,
        tnear: ArrayLike | None = None, tfar: ArrayLike | None = None, progress: Progress | None = None,
    ) -> NDArray[np.int32]:  # fmt: skip
        """(...) int32, the number of hits of every ray; arguments and errors as for `all_hits`."""
        rays, shape = rays_of(origins, directions, tnear, tfar)
        with self._lock:
            return self._current_finder().count(rays.counted_from(self.mesh.origin), progress).reshape(shape)

    def gather(
        self, what: Reduction, origins: Rays | ArrayLike, directions: ArrayLike | None = None, *,
        tnear: ArrayLike | None = None, tfar: ArrayLike | None = None, progress: Progress | None = None,
    ) -> NDArray | RayLayers:  # fmt: skip
        """All hits of each ray reduced to a number or a few.

        what: `atra.Count()`, (...) uint32; `atra.Thickness()`, (...) float32, the length inside closed meshes, in
        lengths of the direction; `atra.Transmittance(factors)`, (...) float32; `atra.Layers(k)`, a `RayLayers`. Factors
        count the triangles of all meshes together.
        Other arguments and errors as for `all_hits`; InputError also for a mesh that `what` is not for.
        """
        rays, shape = rays_of(origins, directions, tnear, tfar)
        with self._lock:
            own = rays.counted_from(self.mesh.origin)
            return gathered(what, own, shape, self._current_finder(), self.geometries, progress)

    def contains(self, points: ArrayLike, *, method: str = "parity") -> NDArray[np.bool_]:
        """(P,) bool: whether points lie inside; a point exactly on the surface may be either.

        Parameters
        ----------
        points : (P, 3)
            Taken as float64 without rounding.
        method
            "parity": the ray from a point crosses an odd number of triangles, decided exactly; it needs closed meshes,
            and where two overlap it is outside. "winding": the generalised winding number is above one half, also for
            meshes with holes, whose triangles must be counterclockwise seen from outside; its time grows with the
            number of open edges.

        Raises InputError for another method, points that are not finite or, with "winding", beyond 1e19 in size, and a
        mesh that parity is not for, with the number of its open edges; ClosedError after `close`.
        """
        if method not in METHODS:
            raise InputError(f"method is {method!r}, expected one of {', '.join(METHODS)}")
        found = check_points(points, FARTHEST_POINT if method == "winding" else np.inf)
        with self._lock:
            return self._current_interior().contains(found - self.mesh.origin, method)

    @property
    def open_edges(self) -> int:
        """The number of edges with an odd number of triangles; 0 where the mesh is closed."""
        with self._lock:
            return self._current_interior().open_edges

    def _current_interior(self) -> Interior:
        if self._interior is None or self._is_closed:
            self._interior = Interior(self._current_finder(), self.geometries.faces, self._pool)
        return self._interior

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for the scene by its own account; 0 before `build`, and with "exact"."""
        return 0 if self._embree is None else self._embree.embree_bytes

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        self._finder = self._interior = None
        if self._embree is not None:
            self._embree.close()
