"""A mesh that rays are shot at in batches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from atra.choices import check_choice
from atra.compiled.instruction_sets import chosen_instruction_set
from atra.compiled.threads import resolve_threads
from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.scene import BUILD_QUALITIES, EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace, check_widths
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import padded_vertices
from atra.rays.all_hits.scene import AllHitsScene
from atra.rays.order import Numbers, RayOrder
from atra.rays.plan import exact_plan_of, plan_of
from atra.rays.rays import RayHits, Rays, checked_out, rays_of
from atra.rays.rays_kernels import closest_hit_kernel, occlusion_kernel

PRECISIONS = ("exact", "watertight", "fast")
"""How the hits of rays of one's own are found."""

ORDERED = 1 << 20
"""Rays that are put in an order at a time, which bounds the memory that takes; more gain nothing."""

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
    world; None: as they are. One that mirrors turns the winding, so that fronts stay outside. One mesh may be in the
    list many times; each copy takes memory of its own. `geometry_id` counts the meshes.
    faces: (F,) bool, those of all meshes together that rays meet; None: all.
    touches: a ray that meets an outline in an edge or corner alone hits it, as Embree has it; otherwise it does as a
    ray near by does. For "exact" alone.
    threads: of a batch; None takes every core that the process may use.
    precision: "exact" decides hits without rounding, those of the rays and vertices as stored; "watertight" takes
    Embree's robust arithmetic, with which no ray slips through between two triangles; "fast" takes Embree's fast
    arithmetic, with which rays also slip past meshes far from the world's origin, where float32 is coarse: of 200,000
    rays in a closed box that lies a hundred times its size away 2 are lost, at a thousand times 43.
    packet_width, build_quality: of Embree, for "watertight" and "fast". Without a packet_width only rays that are alike
    go in packets, and others are traced one by one, which is faster.

    **The hit of a ray** is that of the ray as given, its numbers as stored, with the vertices as stored, in exact
    arithmetic: the nearest, and of equally near ones that of the lowest `prim_id`. A ray through an edge or corner
    counts as moved by an infinitely small way (`atra.exact.lines_kernels`), so it hits one of the triangles that meet
    there, and a triangle seen edge-on never. `t` is right to a unit of float32, and float64's of `all_hits` to
    2^-29 of the way to the mesh's farthest corner. `precision="exact"`, the default, keeps this; "watertight" and
    "fast" ask Embree, in `intersect` and `occluded` alone: rays are rounded to float32, triangles seen all but edge-on
    may be lost or hit beside, t may be off, and of equally near ones any is stored.
    `all_hits`, `count`, `gather` and `contains` are exact with each.

    Raises InputError for an option's value, for faces of another shape or type, and for a mesh smaller than 1e-9 or
    farther than 1e11 from the world's origin.

    Source: `rtcIntersect1/4/8/16` and `rtcOccluded1/4/8/16` of Embree's API, with its RTC_RAY_QUERY_FLAG_COHERENT for
    `coherent` and RTC_SCENE_FLAG_ROBUST for "watertight"; Gribble, Wald et al. as in `atra.trees` for our own tree.
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
        self.precision, self.build_quality = precision, build_quality
        self._is_exact, self._touches = precision == "exact", bool(touches)
        if touches and not self._is_exact:
            raise InputError(f'touches is {touches!r}, expected False with precision="{precision}"')
        super().__init__(mesh, transforms, faces, resolve_threads(threads))
        self.packet_width = resolve_packet_width(packet_width)
        self._order = RayOrder(self._pool)
        self._width_unlike = 1 if packet_width is None else self.packet_width
        self._workspaces: dict[int, list[Workspace]] = {}
        self._scene: EmbreeScene | None = None

    def _build(self) -> tuple[float, float]:
        if not self._is_exact:
            return 0.0, self._build_scene()
        start = perf_counter()
        _ = self.crossings
        return 0.0, perf_counter() - start

    def _take(self, mesh: Mesh) -> None:
        super()._take(mesh)
        self._is_current = False

    def _build_scene(self) -> float:
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
            robust=self.precision != "fast",
        )
        taken_s = perf_counter() - start
        if self._scene is not None:
            self._scene.close()
        self._scene, self._is_current = scene, True
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
        t = np.empty(shape, np.float32) if out is None else checked_out("out.t", t, np.float32, shape)
        prim_id = np.empty(shape, np.uint32) if out is None else checked_out("out.prim_id", prim_id, np.uint32, shape)
        if np.may_share_memory(t, prim_id):
            raise InputError("out has one memory for t and prim_id: pass a result of `intersect`")
        with self._in_use():
            self._run(closest_hit_kernel, coherent, rays, t.reshape(-1), prim_id.reshape(-1))
            if self.geometries.count == 1 and not self.geometries.is_mirrored[0]:
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
        found = np.empty(shape, np.bool_) if out is None else checked_out("out", out, np.bool_, shape)
        answers = found.reshape(-1).view(np.uint8)
        with self._in_use():
            self._run(occlusion_kernel, coherent, rays, answers)
        return found

    def _run(
        self,
        kernel_of: Callable[[int], Callable[..., None]],
        coherent: bool | None,
        rays: Rays,
        *outputs: NDArray[Any],
    ) -> None:
        """Write what rays hit. outputs: t and prim_id of the closest hit, or 1 where they are occluded."""
        with self._in_use():
            rays = self._own(rays)
            if self._is_exact:
                numbers = rays.origins, rays.directions, rays.tnear, rays.tfar
                near_by, in_order = exact_plan_of(numbers, self.mesh, coherent)
                crossings = self.crossings

                def trace(given: Numbers, *answers: NDArray[Any]) -> None:
                    t, found = answers if len(answers) == 2 else (_NO_T, *answers)
                    crossings.hit(given, near_by, self._touches, t, found)
            else:
                rays = rays.as_float32()
                numbers = rays.origins, rays.directions, rays.tnear, rays.tfar
                plan = plan_of(numbers, self.mesh, coherent, self.packet_width, self._width_unlike)
                kernel, in_order = kernel_of(plan.width), plan.in_order

                def trace(given: Numbers, *answers: NDArray[Any]) -> None:
                    placed = plan.placed(given)

                    def work(query: Query) -> None:
                        kernel(query.counter, query.scene, query.packet, query.flags, placed, *answers)

                    self._shoot(work, plan.width, bool(coherent))

            if not in_order:
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
        """Call `work` once per thread, side by side, for kernels of the caller's own, which ask Embree; nothing else is
        traced meanwhile. With "exact" Embree's scene is "watertight", and the first call builds it. Its vertices are
        `mesh.local_vertices`.

        coherent: as for `intersect`. Raises ClosedError after `close`.
        """
        self._shoot(work, self.packet_width, coherent)

    def _shoot(self, work: Callable[[Query], None], width: int, coherent: bool) -> None:
        """As `run`, in packets of `width`."""
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

    @property
    def address(self) -> int:
        """The RTCScene, for kernels that ask more than one. Raises as `run`."""
        with self._in_use():
            if self._scene is None or not self._is_current:
                self._build_scene()
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


def scene_for_kernels(mesh: Mesh, options: Any, faces: NDArray[np.bool_] | None = None) -> RayScene:
    """A scene for kernels that ask Embree themselves. options: has threads, packet_width, build_quality and robust."""
    names = ("threads", "packet_width", "build_quality")
    own = {name: getattr(options, name) for name in names}
    return RayScene(mesh, faces=faces, precision="watertight" if options.robust else "fast", **own)


_NO_T = np.empty(0, np.float32)
