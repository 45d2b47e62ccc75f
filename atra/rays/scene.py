"""A mesh that rays are shot at in batches."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.embree.scene import EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range, padded_vertices
from atra.kernels.callbacks import memory_monitor
from atra.kernels.rays import RayArrays, closest_hit_kernel, occlusion_kernel
from atra.lifetime import Lifetime
from atra.options import RayOptions
from atra.parallel import WorkerPool, resolve_threads
from atra.rays.rays import RayHits, Rays


class Query(NamedTuple):
    """What a thread's kernels need to ask Embree.

    worker: number of the thread, from 0. counter: address of an int64 that all threads share, 0 at first.
    scene: the RTCScene. packet: this thread's own.
    """

    worker: int
    counter: int
    scene: int
    packet: Any


class RayScene(Lifetime):
    """Closest hits and occlusion for rays that come from no camera: shadows, ambient occlusion, line of sight.

        rays = atra.Rays(origins, directions, tnear=1e-3)
        with atra.RayScene(mesh) as scene:
            hits = scene.intersect(rays)
            in_shadow = scene.occluded(atra.Rays(points, to_light, tnear=1e-3, tfar=1.0))

    `with` builds on entry and closes on exit; `build` and `close` do so by hand. Several threads may use one scene;
    their batches wait for each other. Rays are traced in packets in the order they have in the batch: neighbours that
    are alike make it faster.

    options: see `atra.RayOptions`; changes: fields of it by name.

    Triangles are the mesh's `traced_faces`, as for the tracers, and `prim_id` counts them as the mesh does. Where
    several are equally far, whichever Embree finds is stored: there is no rule for ties.
    Raises InputError for options as `RayOptions` does, and for a mesh smaller than 1e-9 or farther than 1e11 from the
    world's origin, where float32 would lose triangles.

    Source: `rtcIntersect1/4/8/16` and `rtcOccluded1/4/8/16` of Embree's API, with its RTC_RAY_QUERY_FLAG_COHERENT for
    `coherent` and RTC_SCENE_FLAG_ROBUST for `robust`.
    """

    def __init__(self, mesh: Mesh, options: RayOptions | None = None, **changes: Any) -> None:
        super().__init__()
        check_world_range(mesh)
        self.mesh = mesh
        self.options = RayOptions.of(type(self).__name__, options, changes)
        self.packet_width = resolve_packet_width(self.options.packet_width)
        self.threads = resolve_threads(self.options.threads)
        self._pool = WorkerPool(self.threads)
        self._workspaces = [Workspace(self.packet_width, coherent=False) for _ in range(self.threads)]
        self._scene: EmbreeScene | None = None

    def _plan(self) -> float:
        return 0.0

    def _build(self) -> float:
        monitor_address, faces = memory_monitor(), self.mesh.traced_faces  # made before the clock starts
        start = perf_counter()
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

    def intersect(self, rays: Rays, *, coherent: bool = False, out: RayHits | None = None) -> RayHits:
        """The closest hit of every ray between its `tnear` and `tfar`.

        coherent: neighbours in the batch start and head alike, as camera rays and those to the sun do; they are then
        traced 1.5 to 2.3 times as fast in packets, but others take two to three times as long. The hits are as right
        either way.
        out: an earlier result of as many rays whose arrays are to be overwritten, which saves allocating them; it must
        not be read any more.
        Raises InputError for what is no `Rays` and an `out` that does not fit, EmbreeError when the scene is not built
        or already closed.
        """
        count = _checked_count(rays)
        t, prim_id = (None, None) if out is None else (getattr(out, "t", None), getattr(out, "prim_id", None))
        t = np.empty(count, np.float32) if out is None else _checked_out("out.t", t, np.float32, count)
        prim_id = np.empty(count, np.uint32) if out is None else _checked_out("out.prim_id", prim_id, np.uint32, count)
        if np.may_share_memory(t, prim_id):
            raise InputError("out has one memory for t and prim_id: pass a result of `intersect`")
        self._run(closest_hit_kernel(self.packet_width), coherent, rays, t, prim_id)
        return RayHits(t, prim_id, rays, self.mesh)

    def occluded(
        self, rays: Rays, *, coherent: bool = False, out: NDArray[np.bool_] | None = None
    ) -> NDArray[np.bool_]:
        """(N,) bool: whether a ray hits anything between its `tnear` and `tfar`; faster than finding what.

        coherent, errors: as for `intersect`. out: an (N,) bool array to be overwritten and returned.
        """
        count = _checked_count(rays)
        found = np.empty(count, np.bool_) if out is None else _checked_out("out", out, np.bool_, count)
        self._run(occlusion_kernel(self.packet_width), coherent, rays, found)
        return found

    def _run(self, kernel: Callable[..., None], coherent: bool, rays: Rays, *outputs: NDArray[Any]) -> None:
        arrays = RayArrays(rays.origins, rays.directions, rays.tnear, rays.tfar)
        self.run(lambda query: kernel(query.counter, query.scene, query.packet, arrays, *outputs), coherent=coherent)

    def run(self, work: Callable[[Query], None], *, coherent: bool = False) -> None:
        """Call `work` once per thread, side by side, for kernels of the caller's own; nothing else is traced meanwhile.

        coherent: as for `intersect`. Raises EmbreeError when the scene is not built or already closed.
        """
        with self._tracing():
            assert self._scene is not None
            scene = self._scene.address
            for workspace in self._workspaces:
                workspace.set_coherent(coherent)
            packets = [workspace.packet for workspace in self._workspaces]
            self._pool.run(lambda worker, counter: work(Query(worker, counter, scene, packets[worker])))

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for the scene by its own account; 0 before `build`."""
        return 0 if self._scene is None else self._scene.embree_bytes

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        if self._scene is not None:
            self._scene.close()


def _checked_count(rays: Rays) -> int:
    if not isinstance(rays, Rays):
        raise InputError(f"rays is {rays!r:.100}, expected atra.Rays")
    return len(rays)


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
