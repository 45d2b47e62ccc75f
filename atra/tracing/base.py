"""Tracers on Embree: the options, buffers, scene and tie rule that they share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool, resolve_threads
from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.device import EmbreeDevice
from atra.embree.scene import EmbreeScene, resolve_packet_width
from atra.embree.workspace import Workspace, check_widths
from atra.exact.ties import TieTiles, coplanar_overlaps, lowest_of_ties, tie_tiles
from atra.geometry.mesh import Mesh
from atra.geometry.ray_space import check_range, ray_axes
from atra.geometry.view import View
from atra.hits import Hits
from atra.tracing.budgets import check_image_memory
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.images import images_of, outputs
from atra.tracing.lifetime import Result, TracerLifetime, in_turn
from atra.tracing.options import Options

Views = tuple[tuple[Mesh, View], ...]
"""What each image shows, and its camera."""


class EmbreeTracer(TracerLifetime[Result]):
    """Options, buffers and scene that the tracers share; `camera` is that of the rays shot.

    options: fields of `options_type` by name.
    Raises InputError for a mesh smaller than 1e-9, or farther than 1e11 from the eye: float32 would lose triangles;
    MemoryBudgetError for images that the free memory cannot hold; and as the options do.
    """

    options_type: ClassVar[type[Options]] = Options
    options: Options
    views: Views

    def __init__(self, options: Mapping[str, Any]) -> None:
        super().__init__()
        self.options = self.options_type.of(type(self).__name__, options)
        self.packet_width = resolve_packet_width(self.options.packet_width)
        self.threads = resolve_threads(self.options.threads)
        self.geometry: AlignedGeometry | None = None
        self._scene: EmbreeDevice | None = None
        self._tie_tiles: list[TieTiles | None] = []  # of each image: where to look for ties, if anywhere
        self._pool = WorkerPool(self.threads)

    def _show_views(self, views: Views) -> None:
        """Take what each image shows, and its camera."""
        self.views = views
        self.mesh, camera = views[0]
        self.camera = camera
        direction = ray_axes(camera)[2].tolist() if camera.is_parallel else None
        self._workspaces = [
            Workspace(self.packet_width, coherent=True, direction=direction) for _ in range(self.threads)
        ]

    def _build_again(self) -> None:
        self._forget()  # before anything is built: both together may not fit
        super()._build_again()

    @abstractmethod
    def _plan_geometry(self) -> AlignedGeometry: ...

    @abstractmethod
    def _filter_address(self) -> int: ...

    @abstractmethod
    def _run(self, offset: tuple[float, float], depth: NDArray, prim_id: NDArray) -> None: ...

    @property
    def _row_stride(self) -> int:
        """Pixels from one row of the output to the next."""
        return self.camera.width

    def _plan(self) -> float:
        start = perf_counter()
        self.geometry = self._plan_geometry()
        geometry_s = perf_counter() - start
        if self.options.ties == "lowest":  # found once per mesh, like reading it, and so outside the clock of a plan
            for mesh, _ in self.views:
                coplanar_overlaps(mesh)
        start = perf_counter()
        self._plan_ties()
        return geometry_s + perf_counter() - start

    def _plan_ties(self) -> None:
        if self.options.ties == "lowest":
            tiles = [tie_tiles(mesh, camera) for mesh, camera in self.views]
            self._tie_tiles = [of_image if of_image.any else None for of_image in tiles]

    def _settle_ties(self, offset: tuple[float, float], prim_id: NDArray[np.uint32]) -> None:
        """prim_id: (rows, W), image below image."""
        for image, tiles in enumerate(self._tie_tiles):
            if tiles is not None:
                mesh, camera = self.views[image]
                own_rows = prim_id[image * camera.height : (image + 1) * camera.height]
                lowest_of_ties(mesh, camera, tiles, offset, own_rows, self._pool, self._directions(camera, offset))

    def _directions(self, camera: View, offset: tuple[float, float]) -> NDArray[np.float64] | None:
        """As `lowest_of_ties` takes them."""
        return None

    def _build(self) -> float:
        assert self.geometry is not None
        self._filter_address(), memory_monitor()  # compiled before the clock starts
        start = perf_counter()
        scene = self._build_scene(self.geometry)
        taken_s = perf_counter() - start
        if self._scene is not None:
            self._scene.close()
        self._scene = scene
        return taken_s

    def _build_scene(self, geometry: AlignedGeometry) -> EmbreeDevice:
        return self._scene_of(geometry, self.options.build_quality, filter_address=self._filter_address())

    def _scene_of(self, geometry: AlignedGeometry, build_quality: str, **settings: Any) -> EmbreeScene:
        """settings: of `EmbreeScene`, beside what is the same for all scenes of a tracer."""
        return EmbreeScene(
            geometry.vertices,
            geometry.faces,
            build_quality=build_quality,
            threads=self.threads,
            robust=self.options.robust,
            user_data=geometry.records,
            monitor_address=memory_monitor(),
            transforms=geometry.transforms,
            **settings,
        )

    @property
    def _scene_address(self) -> int:
        """The one Embree scene, for kernels."""
        assert isinstance(self._scene, EmbreeScene)
        return self._scene.address

    def _trace_rows(
        self, offset: tuple[float, float], rows: int, out: tuple[NDArray[np.float32], NDArray[np.uint32]] | None
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """Trace images of so many rows in all, one below the other; returns depth and prim_id, (rows, W) each.

        Raises InputError for an `out` that does not fit.
        """
        depth, prim_id = outputs((rows, self.camera.width), self._row_stride, out)
        for workspace in self._workspaces:
            workspace.set_row_bytes(depth.strides[0])
        self._run(offset, depth, prim_id)
        self._settle_ties(offset, prim_id)
        check_widths(self._workspaces)
        return depth, prim_id

    @property
    @in_turn
    def triangle_count(self) -> int:
        """Triangles in the Embree scene, copies included; 0 before `build`."""
        return 0 if self.geometry is None else self.geometry.copy_count

    @property
    @in_turn
    def embree_bytes(self) -> int:
        """Bytes Embree holds for this tracer by its own account; 0 before `build`."""
        return 0 if self._scene is None else self._scene.embree_bytes

    @property
    @in_turn
    def counters(self) -> Mapping[str, float]:
        """What `atra.Tracer` says of counters."""
        return {"triangles_traced": self.triangle_count, "embree_bytes": self.embree_bytes}

    def _forget(self) -> None:
        """Let go of all that was planned and built."""
        if self._scene is not None:
            self._scene.close()
        self.geometry = None

    def _release(self) -> None:
        self._pool.close()  # first, so that none of its threads is in a scene that goes
        self._forget()


def check_views(views: Views, takes_lenses: bool = False) -> None:
    """Raise InputError for what float32 cannot trace, and for a lens unless the method takes it; MemoryBudgetError for
    images larger than the free memory."""
    for mesh, camera in views:
        check_range(mesh, camera, takes_lenses)
    check_image_memory(sum(camera.height for _, camera in views), views[0][1].width)


class ImageTracer(EmbreeTracer[Hits]):
    """A tracer of one image."""

    def _trace(self, offset: tuple[float, float], out: Hits | None) -> Hits:
        depth, prim_id = self._trace_rows(offset, self.camera.height, images_of(out))
        return Hits(depth, prim_id, offset, self.mesh, self.camera, self.threads)
