"""A mesh in an Embree scene that kernels ask, in batches of this room and of rooms that trace rays of their own."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.choices import check_choice
from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.filters_kernels import memory_monitor
from atra.embree.scene import BUILD_QUALITIES, EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace, check_widths
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_world_range, padded_vertices
from atra.rays.embree_kernels import embree_kernel
from atra.rays.geometries import checked_faces
from atra.rays.order import RayOrder, plan_of
from atra.rays.rays import Rays
from atra.rays.rays_kernels import RayBatch
from atra.tracing.lifetime import Lifetime, check_same_faces

FEWEST_TRIANGLES = 1 << 17
"""Smallest mesh whose rays are put in order; a smaller one fits the cache anyway."""

NO_T = np.empty(0, np.float32)
"""In place of the parameters of hits where rays are asked only whether they hit anything."""

_NOWHERE = np.uint32(0xFFFFFFFF)
"""A corner that no mesh has: Embree leaves out the triangles that name it, and the others keep their numbers."""


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


class KernelScene(Lifetime):
    """A mesh in an Embree scene, built on first use, and the threads whose kernels ask it with packets of rays.

    Parameters
    ----------
    mesh
        What rays meet.
    faces : (F,) bool, optional
        The triangles that rays meet; None: all.
    threads
        Threads of a batch; None: every core that the process may use.
    packet_width
        Rays of a packet: 1, 4, 8 or 16; None: the widest that the machine has.
    build_quality
        Of Embree's BVH: "low", "medium" or "high".
    robust
        Whether Embree closes shared edges (RTC_SCENE_FLAG_ROBUST).
    pool
        Threads to use in place of own ones.

    Raises
    ------
    InputError
        For an option's value, faces of another shape or type, and a mesh smaller than 1e-9 or farther than 1e11 from
        the world's origin.
    """

    def __init__(
        self,
        mesh: Mesh,
        *,
        faces: NDArray[np.bool_] | None = None,
        threads: int | None = None,
        packet_width: int | None = None,
        build_quality: str = "medium",
        robust: bool = True,
        pool: WorkerPool | None = None,
    ) -> None:
        super().__init__()
        check_choice("build_quality", build_quality, BUILD_QUALITIES)
        self.build_quality, self.robust = build_quality, robust
        self.packet_width = resolve_packet_width(packet_width)
        self._width_of_others = 1 if packet_width is None else self.packet_width
        self._faces = checked_faces(faces, mesh)
        self.take(mesh)
        self._pool = pool or WorkerPool(resolve_threads(threads))
        self.threads = self._pool.threads
        self._order = RayOrder(self._pool)
        self._workspaces: dict[int, list[Workspace]] = {}
        self._scene: EmbreeScene | None = None

    def take(self, mesh: Mesh) -> None:
        """Go on with other vertices of the same faces; the next use builds."""
        check_world_range(mesh)
        with self._lock:
            self.mesh, self._is_built = mesh, False

    def update(self, mesh: Mesh) -> None:
        """Go on with other vertices of the same faces; what is built is built again at once.

        Raises InputError for other faces, ClosedError after `close`.
        """
        with self._lock:
            self._check_open()
            check_same_faces(self.mesh, mesh)
            was_built = self._is_built
            self.take(mesh)
            if was_built:
                self.build()

    def _build(self) -> tuple[float, float]:
        monitor_address, faces = memory_monitor(), self.mesh.traced_faces  # made before the clock starts
        start = perf_counter()
        if self._faces is not None:
            faces = np.where(self._faces[:, None], faces, _NOWHERE)
        local_vertices = self.mesh.local_vertices
        vertices = padded_vertices(len(local_vertices))
        vertices[:] = local_vertices
        scene = EmbreeScene(
            vertices,
            faces,
            build_quality=self.build_quality,
            threads=self.threads,
            monitor_address=monitor_address,
            robust=self.robust,
        )
        taken_s = perf_counter() - start
        if self._scene is not None:
            self._scene.close()
        self._scene = scene
        return 0.0, taken_s

    def run(self, work: Callable[[Query], None], *, coherent: bool = False, width: int | None = None) -> None:
        """Call `work` once per thread, side by side, for kernels that ask Embree; nothing else is traced meanwhile.

        coherent: whether the rays of a packet start and head the same way. width: of packets; None: `packet_width`.
        Raises ClosedError after `close`.
        """
        width = self.packet_width if width is None else width
        with self._in_use():
            scene = self.address
            if width not in self._workspaces:
                self._workspaces[width] = [Workspace(width, coherent=False) for _ in range(self.threads)]
            workspaces = self._workspaces[width]
            for workspace in workspaces:
                workspace.set_coherent(coherent)
            own = [(workspace.packet, workspace.flags) for workspace in workspaces]
            self._pool.run(lambda worker, counter: work(Query(worker, counter, scene, *own[worker])))
            check_widths(workspaces)

    def hit(self, rays: Rays, coherent: bool | None, t: NDArray[np.float32], answers: NDArray[Any]) -> None:
        """Write what rays hit first, or, where `t` is empty, whether they hit anything.

        rays: around the mesh's origin. coherent: as for `RayScene.intersect`. t, answers: (N,), as for
        `nearest_kernel`.
        """
        numbers = rays.origins, rays.directions, rays.tnear, rays.tfar
        plan = plan_of(numbers, self.mesh, coherent, FEWEST_TRIANGLES)
        width = self.packet_width if plan.is_coherent else self._width_of_others
        kernel = embree_kernel(width, not len(t))

        def trace(batch: RayBatch, *out: NDArray[Any]) -> None:
            def work(query: Query) -> None:
                kernel(query.counter, query.scene, query.packet, query.flags, batch, plan.near_by, *out)

            self.run(work, coherent=bool(coherent), width=width)

        with self._in_use():
            if len(answers):
                self._order.traced(numbers, plan.in_order, trace, t, answers)

    def occluded(
        self, origins: ArrayLike, directions: ArrayLike, *, tnear: ArrayLike = 0.0, tfar: ArrayLike = np.inf
    ) -> NDArray[np.bool_]:
        """(N,) bool: whether rays in world space hit anything between their `tnear` and `tfar`; as for `Rays`."""
        rays = Rays(origins, directions, tnear, tfar)  # type: ignore[arg-type]
        found = np.empty(len(rays), np.bool_)
        self.hit(rays.counted_from(self.mesh.origin), None, NO_T, found.view(np.uint8))
        return found

    @property
    def address(self) -> int:
        """The RTCScene, for kernels that ask more than one. Raises as `run`."""
        with self._in_use():
            return self._scene.address  # type: ignore[union-attr]

    @property
    def embree_bytes(self) -> int:
        """Bytes Embree holds for the scene by its own account; 0 before `build`."""
        return 0 if self._scene is None else self._scene.embree_bytes

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        self._order.forget()
        if self._scene is not None:
            self._scene.close()


def scene_for_kernels(mesh: Mesh, options: Any, faces: NDArray[np.bool_] | None = None) -> KernelScene:
    """A scene with the options threads, packet_width, build_quality and robust of an object that has them."""
    own = {name: getattr(options, name) for name in ("threads", "packet_width", "build_quality", "robust")}
    return KernelScene(mesh, faces=faces, **own)
