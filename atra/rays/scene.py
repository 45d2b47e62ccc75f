"""A mesh that rays are shot at in batches."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.scene import EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range, padded_vertices
from atra.rays.order import box_of, has_order_already, is_large, near_by_of
from atra.rays.rays import RayHits, Rays, rays_of
from atra.rays.rays_kernels import (
    ALWAYS,
    BUCKETS,
    CELLS,
    NEVER,
    RECORD,
    SORTED_CHUNK,
    WHERE_ALIKE,
    RaysInMemory,
    closest_hit_kernel,
    number_rays,
    occlusion_kernel,
    order_rays,
    put_back,
)
from atra.tracing.lifetime import MeshLifetime
from atra.tracing.options import PacketKeywords, RayOptions, lists_options

ORDERED = 1 << 20
"""Rays that are put in an order at a time, which bounds the memory that takes; more gain nothing."""

_NOWHERE = np.uint32(0xFFFFFFFF)
"""A corner that no mesh has: Embree leaves out the triangles that name it, and the others keep their numbers."""


Numbers = tuple[NDArray[np.float32], ...]
"""Of rays: origins, directions, tnear, tfar."""


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


class RayScene(MeshLifetime):
    """Closest hits and occlusion for rays that come from no camera: shadows, ambient occlusion, line of sight.

        scene = atra.RayScene(mesh)
        hits = scene.intersect(origins, directions)
        in_shadow = scene.occluded(points, to_light, tnear=1e-3, tfar=1.0)

    The first batch builds; `with` builds on entry and closes on exit, and `build` and `close` do so by hand. Several
    threads may use one scene; their batches wait for each other.

    options: see `atra.RayOptions`. faces: (F,) bool, those that rays meet; None: all.
    Triangles are the mesh's `traced_faces`, as for the tracers, and `prim_id` counts them as the mesh does. Where
    several are equally far, whichever Embree finds is stored: there is no rule for ties.
    Raises InputError for options as `RayOptions` does, for faces of another shape or type, and for a mesh smaller than
    1e-9 or farther than 1e11 from the world's origin, where float32 would lose triangles.

    Source: `rtcIntersect1/4/8/16` and `rtcOccluded1/4/8/16` of Embree's API, with its RTC_RAY_QUERY_FLAG_COHERENT for
    `coherent` and RTC_SCENE_FLAG_ROBUST for `robust`.
    """

    @lists_options(RayOptions)
    def __init__(
        self, mesh: Mesh, *, faces: NDArray[np.bool_] | None = None, **options: Unpack[PacketKeywords]
    ) -> None:
        super().__init__()
        self._take(mesh)
        if faces is not None and (np.shape(faces), np.asarray(faces).dtype) != ((mesh.triangle_count,), np.bool_):
            raise InputError(f"faces are {faces!r:.100}, expected ({mesh.triangle_count},) bool, those that rays meet")
        self._faces = None if faces is None else np.array(faces)
        self.options = RayOptions.of(type(self).__name__, options)
        self.packet_width = resolve_packet_width(self.options.packet_width)
        self.threads = resolve_threads(self.options.threads)
        self._pool = WorkerPool(self.threads)
        self._workspaces = [Workspace(self.packet_width, coherent=False) for _ in range(self.threads)]
        self._scene: EmbreeScene | None = None
        self._memory: tuple[NDArray[np.float32], NDArray[np.uint32]] | None = None

    def _take(self, mesh: Mesh) -> None:
        check_world_range(mesh)
        self.mesh = mesh

    def _plan(self) -> float:
        return 0.0

    def _build(self) -> float:
        monitor_address, faces = memory_monitor(), self.mesh.traced_faces  # made before the clock starts
        start = perf_counter()
        if self._faces is not None:
            faces = np.where(self._faces[:, None], faces, _NOWHERE)
        vertices = padded_vertices(len(self.mesh.vertices))
        vertices[:] = self.mesh.vertices
        scene = EmbreeScene(
            vertices,
            faces,
            build_quality=self.options.build_quality,
            threads=self.threads,
            monitor_address=monitor_address,
            robust=self.options.robust,
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

        origins, directions: (N, 3) each, with tnear (None: 0) and tfar (None: inf) as for `atra.Rays`; or `atra.Rays`
        in their place, which are not checked and copied anew at every call.
        coherent: whether neighbours in the batch start and head alike, as camera rays and those to the sun do, and are
        taken through the tree together: packets are then traced up to twice as fast, but others take two to three times
        as long. None: where they are found to, packet by packet; and many rays at a large mesh, unless they have an
        order, are put in one in which rays near by follow each other. The hits are as right either way.
        out: an earlier result of as many rays whose arrays are to be overwritten, which saves allocating them; it must
        not be read any more.
        Raises InputError for rays that `atra.Rays` refuses and an `out` that does not fit, ClosedError after `close`.
        """
        rays = rays_of(origins, directions, tnear, tfar)
        count = len(rays)
        t, prim_id = (None, None) if out is None else (getattr(out, "t", None), getattr(out, "prim_id", None))
        t = np.empty(count, np.float32) if out is None else _checked_out("out.t", t, np.float32, count)
        prim_id = np.empty(count, np.uint32) if out is None else _checked_out("out.prim_id", prim_id, np.uint32, count)
        if np.may_share_memory(t, prim_id):
            raise InputError("out has one memory for t and prim_id: pass a result of `intersect`")
        with self._in_use():
            self._run(closest_hit_kernel(self.packet_width), coherent, rays, t, prim_id)
            return RayHits(t, prim_id, rays, self.mesh)

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

        Arguments and errors as for `intersect`. out: an (N,) bool array to be overwritten and returned.
        """
        rays = rays_of(origins, directions, tnear, tfar)
        count = len(rays)
        found = np.empty(count, np.bool_) if out is None else _checked_out("out", out, np.bool_, count)
        self._run(occlusion_kernel(self.packet_width), coherent, rays, found)
        return found

    def _run(self, kernel: Callable[..., None], coherent: bool | None, rays: Rays, *outputs: NDArray[Any]) -> None:
        with self._in_use():
            together = WHERE_ALIKE if coherent is None else ALWAYS if coherent else NEVER
            near_by = near_by_of(self.mesh)
            has_order = coherent is not None or not is_large(rays, self.mesh) or has_order_already(rays, near_by)

            def trace(given: Numbers, *answers: NDArray[Any]) -> None:
                origins, directions, tnear, tfar = given
                starts = origins.ctypes.data, directions.ctypes.data, origins.strides[0]
                ends = tnear.ctypes.data, tfar.ctypes.data, tnear.strides[0]
                placed = RaysInMemory(*starts, *ends, together, near_by)

                def work(query: Query) -> None:
                    kernel(query.counter, query.scene, query.packet, query.flags, placed, *answers)

                self.run(work, coherent=bool(coherent))

            numbers = rays.origins, rays.directions, rays.tnear, rays.tfar
            if has_order:
                trace(numbers, *outputs)
                return
            for start in range(0, len(rays), ORDERED):
                some = slice(start, start + ORDERED)
                ordered, places, room = self._ordered(*(array[some] for array in numbers))
                answers = [room[k].view(output.dtype)[: len(places)] for k, output in enumerate(outputs)]
                trace(ordered, *answers)
                for answer, output in zip(answers, outputs, strict=True):
                    self._put_back(places, answer, output[some])

    def run(self, work: Callable[[Query], None], *, coherent: bool = False) -> None:
        """Call `work` once per thread, side by side, for kernels of the caller's own; nothing else is traced meanwhile.

        coherent: as for `intersect`. Raises ClosedError after `close`.
        """
        with self._in_use():
            scene = self.address
            for workspace in self._workspaces:
                workspace.set_coherent(coherent)
            own = [(workspace.packet, workspace.flags) for workspace in self._workspaces]
            self._pool.run(lambda worker, counter: work(Query(worker, counter, scene, *own[worker])))

    def _ordered(
        self, origins: NDArray[np.float32], directions: NDArray[np.float32], *ends: NDArray[np.float32]
    ) -> tuple[Numbers, NDArray[np.uint32], NDArray[np.uint32]]:
        """The same rays in an order in which those that start near each other and head the same way follow each other;
        the place of each in it; and room for two answers of each, (2, >= N). All of it until the next are ordered."""
        count = len(origins)
        low, high = box_of(origins)
        with np.errstate(divide="ignore", over="ignore"):
            inverse = np.where(high > low, CELLS / (high - low), 0.0).astype(np.float32)
        keys, counts = np.empty(count, np.uint16), np.zeros((-(-count // SORTED_CHUNK), BUCKETS), np.int32)
        self._pool.run(lambda _, counter: number_rays(counter, origins, directions, low, inverse, keys, counts))
        bounds = np.cumsum(counts.T).reshape(BUCKETS, -1).T  # bucket by bucket, in each chunk by chunk
        starts = np.ascontiguousarray(bounds - counts, np.int32)
        if self._memory is None or len(self._memory[0]) < count:  # kept: fresh pages cost more than to write to them
            self._memory = aligned_empty((count, RECORD), np.float32), np.empty((3, count), np.uint32)
        records, places, room = self._memory[0][:count], self._memory[1][0, :count], self._memory[1][1:]
        given = keys, starts, origins, directions, *ends
        self._pool.run(lambda _, counter: order_rays(counter, *given, records, places))
        return (records[:, :3], records[:, 4:7], records[:, 3], records[:, 7]), places, room

    def _put_back(self, places: NDArray[np.uint32], answers: NDArray[Any], output: NDArray[Any]) -> None:
        """output = answers[places], (N,) each."""
        bits = np.dtype(f"u{output.itemsize}")  # one kernel for all that have as many
        given = places, answers.view(bits), output.view(bits)
        self._pool.run(lambda _, counter: put_back(counter, *given))

    @property
    def address(self) -> int:
        """The RTCScene, for kernels that ask more than one. Raises ClosedError after `close`."""
        with self._in_use():
            return self._scene.address  # type: ignore[union-attr]

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for the scene by its own account; 0 before `build`."""
        return 0 if self._scene is None else self._scene.embree_bytes

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        self._memory = None
        if self._scene is not None:
            self._scene.close()


def _checked_out(name: str, array: Any, kind: type, count: int) -> NDArray[Any]:
    expected = f"expected {np.dtype(kind)} of ({count},), contiguous and writable: pass an earlier result"
    if not isinstance(array, np.ndarray):
        raise InputError(f"{name} is {array!r:.100}, {expected}")
    if (array.dtype, array.shape) != (kind, (count,)) or not array.flags.c_contiguous or not array.flags.writeable:
        raise InputError(
            f"{name} is {array.dtype} of {array.shape}{'' if array.flags.c_contiguous else ', not contiguous'}"
            f"{'' if array.flags.writeable else ', read-only'}, {expected}"
        )
    return array
