"""A mesh that rays are shot at in batches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, Literal, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.compiled.threads import resolve_threads
from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.scene import EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace, check_widths
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import padded_vertices
from atra.prim_ids import MISS
from atra.rays.all_hits.scene import AllHitsScene
from atra.rays.enlarged import enlarged
from atra.rays.enlarged_kernels import DOUBT, NOWHERE, Doubts, doubt_filter
from atra.rays.order import Numbers, RayOrder
from atra.rays.plan import plan_of
from atra.rays.rays import RayHits, Rays, rays_of
from atra.rays.rays_kernels import UNDECIDED, closest_hit_kernel, occlusion_kernel
from atra.tracing.options import PacketKeywords, RayOptions, lists_options

ORDERED = 1 << 20
"""Rays that are put in an order at a time, which bounds the memory that takes; more gain nothing."""

_NO_DOUBTS = Doubts(0, *(np.float32(0.0),) * 4)


class Query(NamedTuple):
    """What a thread's kernels need to ask Embree.

    worker: number of the thread, from 0. counter: address of an int64 that all threads share, 0 at first.
    scene: the RTCScene. packet: this thread's own. flags: of its queries.
    """

    worker: int
    counter: int
    scene: int
    packet: Any
    flags: Any


class RayScene(AllHitsScene):
    """Rays that come from no camera: closest hits, occlusion, all hits, and whether points are inside.

        scene = atra.RayScene(mesh)
        hits = scene.intersect(origins, directions)
        in_shadow = scene.occluded(points, to_light, tnear=1e-3, tfar=1.0)
        lists = scene.all_hits(origins, directions)
        is_inside = scene.contains(points)

    The first batch builds; `with` builds on entry and closes on exit, and `build` and `close` do so by hand. Several
    threads may use one scene; their batches wait for each other.

    mesh: one, or a list of several. transforms: (G, 3, 4) or (G, 4, 4), affine maps of the meshes into the
    world; None: as they are. One mesh may be in the list many times; each copy takes memory of its own. `geometry_id`
    counts the meshes.
    options: see `atra.RayOptions`. faces: (F,) bool, those of all meshes together that rays meet; None: all.
    exact: `intersect` and `occluded` lose no ray at a corner either, unless it lies all but in the plane of a triangle:
    Embree is given triangles a little larger, and hits near edges are decided without rounding. The first batch also
    builds the tree of `all_hits`, and `robust` has no effect.
    A ray that meets an outline in an edge or corner alone then does as a ray near by does, as in `all_hits`; with
    exact="touches" it hits there, as Embree has it.
    Triangles are the mesh's `traced_faces`, as for the tracers, and `prim_id` counts them as the mesh does. Where
    several are equally far, `intersect` stores whichever Embree finds: there is no rule for ties. `all_hits`, `count`,
    `gather` and `contains` decide without rounding, by a tree of their own.
    Raises InputError for options as `RayOptions` does, for another `exact`, for faces of another shape or
    type, and for a mesh smaller than 1e-9 or farther than 1e11 from the world's origin, where float32 would lose
    triangles.

    Source: `rtcIntersect1/4/8/16` and `rtcOccluded1/4/8/16` of Embree's API, with its RTC_RAY_QUERY_FLAG_COHERENT for
    `coherent` and RTC_SCENE_FLAG_ROBUST for `robust`.
    """

    @lists_options(RayOptions)
    def __init__(
        self,
        mesh: Mesh | Sequence[Mesh],
        *,
        transforms: ArrayLike | None = None,
        faces: NDArray[np.bool_] | None = None,
        exact: bool | Literal["touches"] = False,
        **options: Unpack[PacketKeywords],
    ) -> None:
        self.options = RayOptions.of(type(self).__name__, options)
        if exact not in (False, True, "touches"):
            raise InputError(f'exact is {exact!r}, expected False, True or "touches"')
        self.exact, self._touches = bool(exact), exact == "touches"
        super().__init__(mesh, transforms, faces, resolve_threads(self.options.threads))
        self.packet_width = resolve_packet_width(self.options.packet_width)
        self._order = RayOrder(self._pool)
        self._width_unlike = 1 if self.options.packet_width is None else self.packet_width
        self._workspaces = {
            width: [Workspace(width, coherent=False) for _ in range(self.threads)]
            for width in {self.packet_width, self._width_unlike}
        }
        self._scene: EmbreeScene | None = None
        self._rims, self._doubts = np.empty(0, np.float32), _NO_DOUBTS

    def _plan(self) -> float:
        return 0.0

    def _build(self) -> float:
        monitor_address, faces = memory_monitor(), self.mesh.traced_faces  # made before the clock starts
        start = perf_counter()
        if self.exact:
            vertices, faces, self._rims, self._doubts = enlarged(self.mesh, self._faces)
        else:
            if self._faces is not None:
                faces = np.where(self._faces[:, None], faces, NOWHERE)
            vertices = padded_vertices(len(self.mesh.vertices))
            vertices[:] = self.mesh.vertices
        scene = EmbreeScene(
            vertices,
            faces,
            build_quality=self.options.build_quality,
            threads=self.threads,
            monitor_address=monitor_address,
            robust=self.options.robust and not self.exact,
            filter_in_arguments=self.exact,
        )
        taken_s = perf_counter() - start
        if self._scene is not None:
            self._scene.close()
        self._scene = scene
        return taken_s

    def intersect(
        self,
        origins: Rays | ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tnear: ArrayLike | None = None,
        tfar: ArrayLike | None = None,
        coherent: bool | None = None,
        out: RayHits | None = None,
    ) -> RayHits:
        """The closest hit of every ray between its `tnear` and `tfar`.

        origins, directions: (..., 3) each, (3,) being one for all, with tnear (None: 0) and tfar (None: inf), numbers
        or of the leading shape, which results keep; or one array (..., 6) of both; or `atra.Rays` in their place, which
        are not checked and copied anew at every call.
        coherent: whether neighbours in the batch start and head alike, as camera rays and those to the sun do, and are
        taken through the tree together: packets are then traced up to twice as fast, but others take two to three times
        as long. None: a sample of the batch tells. Where most are alike, each packet is looked at. Where they are not,
        rays are traced one by one, unless `packet_width` is given; and many at a large mesh are put in an order in
        which rays near by follow each other. The hits are as right either way.
        out: an earlier result of as many rays whose arrays are to be overwritten, which saves allocating them; it must
        not be read any more.
        Raises InputError for rays that `atra.Rays` refuses and an `out` that does not fit, ClosedError after `close`.
        """
        rays, shape = rays_of(origins, directions, tnear, tfar)
        t, prim_id = (None, None) if out is None else (getattr(out, "t", None), getattr(out, "prim_id", None))
        t = np.empty(shape, np.float32) if out is None else _checked_out("out.t", t, np.float32, shape)
        prim_id = np.empty(shape, np.uint32) if out is None else _checked_out("out.prim_id", prim_id, np.uint32, shape)
        if np.may_share_memory(t, prim_id):
            raise InputError("out has one memory for t and prim_id: pass a result of `intersect`")
        with self._in_use():
            flat = t.reshape(-1), prim_id.reshape(-1)
            self._run(closest_hit_kernel, coherent, rays, *flat)
            if self.exact:
                self._decide(flat[1] == DOUBT, rays, *flat)
            if self.geometries.count == 1:
                return RayHits(t, prim_id, rays, self.mesh)
            traced_id = prim_id.copy()
            prim_id[...] = self.geometries.own_ids(traced_id, self.geometries.geometry_ids(traced_id))
            return RayHits(t, prim_id, rays, self.mesh, self.geometries, traced_id)

    def occluded(
        self,
        origins: Rays | ArrayLike,
        directions: ArrayLike | None = None,
        *,
        tnear: ArrayLike | None = None,
        tfar: ArrayLike | None = None,
        coherent: bool | None = None,
        out: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.bool_]:
        """(N,) bool: whether a ray hits anything between its `tnear` and `tfar`; faster than finding what.

        Arguments, shapes and errors as for `intersect`. out: a bool array of that shape, overwritten and returned.
        """
        rays, shape = rays_of(origins, directions, tnear, tfar)
        found = np.empty(shape, np.bool_) if out is None else _checked_out("out", out, np.bool_, shape)
        answers = found.reshape(-1).view(np.uint8)
        with self._in_use():
            self._run(occlusion_kernel, coherent, rays, answers, filters=self.exact)
            if self.exact:
                triangles = np.empty(len(rays), np.uint32)
                numbers = self._decide(answers == UNDECIDED, rays, np.empty(0, np.float32), triangles)
                answers[numbers] = triangles[numbers] != MISS
        return found

    def _decide(
        self, is_doubtful: NDArray[np.bool_], rays: Rays, t: NDArray[np.float32], prim_id: NDArray[np.uint32]
    ) -> NDArray[np.int64]:
        """Write what rays in doubt hit, as `Crossings.nearest`; returns their numbers."""
        numbers = np.flatnonzero(is_doubtful)
        if len(numbers):
            self.crossings.nearest(rays, numbers, self._touches, t, prim_id)
        return numbers

    def _run(
        self,
        kernel_of: Callable[[int, bool], Callable[..., None]],
        coherent: bool | None,
        rays: Rays,
        *outputs: NDArray[Any],
        filters: bool = False,
    ) -> None:
        with self._in_use():
            numbers = rays.origins, rays.directions, rays.tnear, rays.tfar
            plan = plan_of(numbers, self.mesh, coherent, self.packet_width, self._width_unlike)
            kernel = kernel_of(plan.width, self.exact)

            def trace(given: Numbers, *answers: NDArray[Any]) -> None:
                placed = plan.placed(given)

                def work(query: Query) -> None:
                    kernel(query.counter, query.scene, query.packet, query.flags, placed, self._doubts, *answers)

                self._shoot(work, plan.width, bool(coherent), filters)

            if not plan.in_order:
                trace(numbers, *outputs)
                return
            for start in range(0, len(rays), ORDERED):
                some = slice(start, start + ORDERED)
                ordered, places, room = self._order.ordered(*(array[some] for array in numbers))
                answers = [room[k].view(output.dtype)[: len(places)] for k, output in enumerate(outputs)]
                trace(ordered, *answers)
                for answer, output in zip(answers, outputs, strict=True):
                    self._order.put_back(places, answer, output[some])

    def run(self, work: Callable[[Query], None], *, coherent: bool = False) -> None:
        """Call `work` once per thread, side by side, for kernels of the caller's own; nothing else is traced meanwhile.

        coherent: as for `intersect`. Raises InputError for a scene with exact=True, whose triangles are others, and
        ClosedError after `close`.
        """
        _ = self.address
        self._shoot(work, self.packet_width, coherent)

    def _shoot(self, work: Callable[[Query], None], width: int, coherent: bool, filters: bool = False) -> None:
        """As `run`, in packets of `width`. filters: whether hits in doubt are rejected."""
        with self._in_use():
            scene, workspaces = self._scene.address, self._workspaces[width]  # type: ignore[union-attr]
            for workspace in workspaces:
                workspace.set_coherent(coherent)
                if self.exact:
                    workspace.gather_with(doubt_filter(width) if filters else 0, self._doubts.rims)
            own = [(workspace.packet, workspace.flags) for workspace in workspaces]
            self._pool.run(lambda worker, counter: work(Query(worker, counter, scene, *own[worker])))
            check_widths(workspaces)

    @property
    def address(self) -> int:
        """The RTCScene, for kernels that ask more than one. Raises as `run`."""
        if self.exact:
            raise InputError(f"this {type(self).__name__} has exact=True, kernels of one's own need exact=False")
        with self._in_use():
            return self._scene.address  # type: ignore[union-attr]

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for the scene by its own account; 0 before `build`."""
        return 0 if self._scene is None else self._scene.embree_bytes

    def _release(self) -> None:
        super()._release()  # first, so that none of its threads is in a scene that goes
        self._order.forget()
        if self._scene is not None:
            self._scene.close()


def _checked_out(name: str, array: Any, kind: type, shape: tuple[int, ...]) -> NDArray[Any]:
    expected = f"expected {np.dtype(kind)} of {shape}, contiguous and writable: pass an earlier result"
    if not isinstance(array, np.ndarray):
        raise InputError(f"{name} is {array!r:.100}, {expected}")
    if (array.dtype, array.shape) != (kind, shape) or not array.flags.c_contiguous or not array.flags.writeable:
        raise InputError(
            f"{name} is {array.dtype} of {array.shape}{'' if array.flags.c_contiguous else ', not contiguous'}"
            f"{'' if array.flags.writeable else ', read-only'}, {expected}"
        )
    return array
