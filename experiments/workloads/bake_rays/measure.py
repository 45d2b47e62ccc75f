"""Time of rays that share their directions: aligned, one by one, and in packets, round by round."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import atra
from atra.bake import Atlas, Texels
from atra.bake.tiles import Tiles
from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.rays.rays import Rays
from experiments.harness.point import Point
from experiments.workloads.bake_rays import ONE_BY_ONE, TOGETHER, Use
from experiments.workloads.baselines import OWN
from experiments.workloads.rounds import load_mesh, measured, timed_rounds
from experiments.workloads.workload import Measured
from scenes.directory import default_cache

_SUN = np.array((0.35, 1.0, -0.25))
"""To it; that of `scenes.lit.rooms`."""

_CELLS = 128
"""Of a bundle's image, side by side, where its rays are aligned."""


def measure(point: Point) -> Measured:
    """Time a round of rays. Raises InputError and MemoryBudgetError as tracers and `Atlas` do."""
    mesh = load_mesh(point)
    make = _measure_bundles if point.workload_options.use is Use.bundle else _measure_tiles
    with ExitStack() as stack:
        return make(point, mesh, stack)


def directions_of(point: Point) -> NDArray[np.float64]:
    """(D, 3) unit vectors, the same at every call: the sun, or anywhere."""
    settings = point.workload_options
    if settings.use is Use.sun:
        return (_SUN / np.linalg.norm(_SUN))[None]
    found = np.random.Generator(np.random.PCG64(1)).normal(size=(settings.directions, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


class AlignedTiles:
    """Rays of directions from tiles; every direction is planned and built when it is its turn."""

    def __init__(self, point: Point, tiles: Tiles) -> None:
        self._point, self._tiles = point, tiles
        self.prepare_s = 0.0

    def trace(self, directions: NDArray[np.float64], offsets: Any, keep: bool = False) -> list[NDArray[np.bool_]]:
        """What rays meet, if it is to be kept: of each direction and offset, (R,) bool of the tiles that face it."""
        kept, self.prepare_s = [], 0.0
        for direction in directions:
            start = perf_counter()
            facing = self._tiles.facing(direction)
            meshes = [self._tiles.mesh_at(int(tile), direction) for tile in facing]
            near = [mesh for mesh in meshes if mesh is not None]
            if not near:
                kept += [np.zeros(int((self._tiles.texel[facing] >= 0).sum()), bool)] * (len(offsets) if keep else 0)
                continue
            camera = self._tiles.camera
            alignment = atra.Alignment.of_frames([camera] * len(near), atra.Split.of_image((1, 1), camera))
            options: dict[str, Any] = self._point.tracing.ours | {"ties": "any"}
            with atra.FramesTracer(near, alignment, **options) as tracer:
                self.prepare_s += perf_counter() - start
                frames = None
                for offset in offsets:
                    frames = tracer.trace(offset, out=frames)
                    if keep:
                        kept.append(self._hit(frames, facing, meshes))
        return kept

    def _hit(self, frames: Any, facing: NDArray[np.int64], meshes: list[Mesh | None]) -> NDArray[np.bool_]:
        found, frame = [], iter(frames.depth)
        for tile, mesh in zip(facing, meshes, strict=True):
            member = self._tiles.texel[tile] >= 0
            found.append(np.zeros(int(member.sum()), bool) if mesh is None else np.isfinite(next(frame))[member])
        return np.concatenate(found)


def _measure_tiles(point: Point, mesh: Mesh, stack: ExitStack) -> Measured:
    settings = point.workload_options
    atlas = Atlas.unwrap(mesh, settings.map_size, kept_in=default_cache() / "atlases", time_limit_s=point.time_limit_s)
    tiles = Tiles.of(Texels.of(mesh, atlas), settings.tile_size, settings.least_texels)
    if not len(tiles):
        raise InputError(
            f"no tile of a flat chart of {point.scene} has {settings.least_texels} texels: set "
            "workload.least_texels or a larger workload.map_size"
        )
    directions, offsets = (
        directions_of(point),
        [tuple(pair) for pair in atra.sub_pixel_offsets(settings.positions).tolist()],
    )
    own = AlignedTiles(point, tiles)
    scenes = {
        name: stack.enter_context(
            atra.RayScene(mesh, packet_width=width, threads=point.threads, build_quality=point.build_quality)
        )
        for name, width in ((ONE_BY_ONE, 1), (TOGETHER, None))
    }
    batches = [
        Rays(*tiles.rays(tiles.facing(direction), direction, offset)) for direction in directions for offset in offsets
    ]

    def occlude(scene: atra.RayScene) -> list[NDArray[np.bool_]]:
        return [scene.occluded(batch, coherent=True) for batch in batches]

    aligned = own.trace(directions, offsets, keep=True)
    different = sum(int((a != b).sum()) for a, b in zip(aligned, occlude(scenes[ONE_BY_ONE]), strict=True))
    prepared: list[float] = []

    def trace() -> None:
        own.trace(directions, offsets)
        prepared.append(own.prepare_s)

    calls: dict[str, Any] = {OWN: trace, **{name: partial(occlude, scene) for name, scene in scenes.items()}}
    timed = timed_rounds(point, calls)
    results = {
        "prepare_s": median(prepared),
        "aligned_texel_share": tiles.texel_share,
        "tiles": len(tiles),
        "rays_compared": sum(map(len, batches)),
        "rays_different": different,
    }
    return measured(results, timed)


def _measure_bundles(point: Point, mesh: Mesh, stack: ExitStack) -> Measured:
    """All hits along parallel rays across the whole scene: counted, as any exchange of light between them begins."""
    settings = point.workload_options
    size, ours = settings.map_size, point.tracing.ours
    cameras = [
        atra.OrthographicCamera.of_light(tuple(direction), mesh.bounds, size, size)
        for direction in directions_of(point)
    ]
    offsets = [tuple(pair) for pair in atra.sub_pixel_offsets(settings.positions).tolist()]
    tracers: dict[str, Any] = {
        OWN: stack.enter_context(atra.AlignedTracer(mesh, cameras[0], split=(min(_CELLS, size), 1), **ours)),
        ONE_BY_ONE: stack.enter_context(atra.PixelTracer(mesh, cameras[0], packet_width=1, **ours)),
        TOGETHER: stack.enter_context(atra.PixelTracer(mesh, cameras[0], **ours)),
    }
    prepared: list[float] = []

    def gather(tracer: Any) -> Any:
        found, preparing_s = [], 0.0
        for camera in cameras:
            start = perf_counter()
            tracer.look(camera)
            preparing_s += perf_counter() - start
            found += [tracer.gather(atra.Count(), offset).count for offset in offsets]
        prepared.append(preparing_s)
        return found

    counts = {name: gather(tracer) for name, tracer in tracers.items()}
    pairs = list(zip(counts[OWN], counts[ONE_BY_ONE], strict=True))
    prepared.clear()
    calls = {name: partial(gather, tracer) for name, tracer in tracers.items()}
    timed = timed_rounds(point, calls)
    results = {
        "prepare_s": median(prepared),
        "rays_compared": sum(a.size for a, _ in pairs),
        "rays_different": sum(int((a != b).sum()) for a, b in pairs),
    }
    return measured(results, timed)
