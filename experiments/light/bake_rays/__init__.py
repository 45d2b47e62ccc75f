"""Workload `bake_rays`: what alignment can do for rays of a bake that share their directions, with plan and build."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra import AlignedTracer, Count, OrthographicCamera, PixelTracer, RayScene, sub_pixel_offsets
from atra.errors import InputError
from atra.exact.intersection import intersect_rays
from atra.geometry.mesh import Mesh
from atra.light import Atlas, Texels
from atra.rays.rays import Rays
from experiments.harness.column import REAL, WHOLE, Column
from experiments.harness.options import Settings, option, whole
from experiments.harness.point import Measured, Point, Workload
from experiments.harness.records import Record
from experiments.light.sun.tiles import Tiles
from experiments.results.statistics import statistics_columns
from experiments.workloads.baselines import OWN, over_own, series
from experiments.workloads.rounds import load_mesh, measured, timed_rounds
from scenes.directory import default_cache

ONE_BY_ONE, TOGETHER = "single_rays", "coherent_packets"
"""Names in the samples, beside the aligned rays: the same rays one by one, and in the widest packets."""

CELLS = 128
"""Largest number of cells side by side in a bundle's image."""


USES = ("sun", "sky", "bundle")
"""sun: rays of one direction from texels. sky: rays of several directions, each planned and built again. bundle: all
hits of parallel rays across the whole scene."""


@dataclass(frozen=True)
class BakeRaysSettings(Settings):
    """Which rays share their directions."""

    use: str = option("sun", "purpose of the rays: sun, sky or bundle", choices=USES)
    positions: int = whole(16, "sub-texel positions that rays of a direction start from", 1, 1 << 12)
    directions: int = whole(1, "directions of a round, where the use is not the sun", 1, 1 << 12)
    map_size: int = whole(512, "texels along a side of the map, and rays of a bundle", 1, 1 << 13)
    tile_size: int = whole(8, "texels along a side of a tile", 1, 1 << 10)
    least_texels: int = whole(16, "fewest texels of a tile whose rays are traced", 1, 1 << 20)
    shortcut: bool = option(True, "rays of tiles, or parts of them, that one triangle shadows are not traced")


def _headline(record: Record) -> str:
    own, packets = (median(record.samples[name]) for name in (OWN, TOGETHER))
    return (
        f"packets {packets * 1e3:.1f} ms, aligned {own * 1e3:.1f} ms: {packets / own:.2f}x; "
        f"{record.results['rays_different']} of {record.results['rays_compared']} rays see something else"
    )


BAKE_RAYS = Workload(
    name="bake_rays",
    options=BakeRaysSettings,
    columns=(
        *statistics_columns("aligned_time{}_s", "aligned rays, plan and build included", series(OWN)),
        *statistics_columns("single_over_aligned{}", "rays one by one / aligned", over_own(series(ONE_BY_ONE))),
        *statistics_columns("packets_over_aligned{}", "coherent packets / aligned", over_own(series(TOGETHER))),
        Column("prepare_s", REAL, "plan and build of aligned rays in a round"),
        Column("triangles_aligned", WHOLE, "copies of triangles for all tiles and directions"),
        Column("aligned_texel_share", REAL, "share of the lit texels that lie in tiles of flat charts"),
        Column("tiles", WHOLE, "tiles of flat charts"),
        Column("rays_compared", WHOLE, "rays whose visibility, or number of hits, was compared"),
        Column("rays_different", WHOLE, "compared rays whose answer differs", over=max),
        Column("rays_undecided", WHOLE, "others whose rounding decides: at a triangle's rim, or on one", over=max),
    ),
    headline=_headline,
    package=__name__,
    samples=lambda _: frozenset((OWN, ONE_BY_ONE, TOGETHER)),
    judged=OWN,
    needs=("rays_compared", "rays_different"),
    told=("aligned_time_s", "single_over_aligned", "packets_over_aligned", "rays_different"),
)  # fmt: skip


SUN = np.array((0.35, 1.0, -0.25))
"""Direction to the sun of `scenes.lit.rooms`."""

_RIM = 1e-6
"""Distance to an edge or a start triangle, as a share of the scene's size, below which a ray is undecided."""

_MOST_DOUBTS = 100
"""Most differing rays that are checked in float64; more than these do not differ by rounding."""


def measure(point: Point) -> Measured:
    """Time a round of rays. Raises InputError and MemoryBudgetError as tracers and `Atlas` do."""
    mesh = load_mesh(point)
    make = _measure_bundles if point.workload_options.use == "bundle" else _measure_tiles
    with ExitStack() as stack:
        return make(point, mesh, stack)


def directions_of(point: Point) -> NDArray[np.float64]:
    """(D, 3) unit vectors, the same at every call: the sun, or anywhere."""
    settings = point.workload_options
    if settings.use == "sun":
        return (SUN / np.linalg.norm(SUN))[None]
    found = np.random.Generator(np.random.PCG64(1)).normal(size=(settings.directions, 3))
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


class AlignedTiles:
    """Rays of directions from tiles; every direction is planned and built when it is its turn.

    prepare_s: plan and build of all of them. triangles: copies made for all of them."""

    def __init__(self, point: Point, tiles: Tiles) -> None:
        self._tiles = tiles
        self._options = {"threads": point.threads, "shortcut": point.workload_options.shortcut}
        self._rooms: dict[int, NDArray[np.bool_]] = {}
        self.prepare_s, self.triangles = 0.0, 0

    def trace(self, directions: NDArray[np.float64], offsets: NDArray[np.float64]) -> None:
        """Trace the rays of all directions, one after the other."""
        self.prepare_s, self.triangles = 0.0, 0
        for number, direction in enumerate(directions):
            start = perf_counter()
            with self._tiles.towards(self._tiles.facing(direction), direction, **self._options) as rays:
                self.prepare_s += perf_counter() - start
                self.triangles += rays.triangle_count
                self._rooms[number] = rays.trace(offsets, out=self._rooms.get(number))

    def met(self, directions: NDArray[np.float64]) -> list[NDArray[np.bool_]]:
        """Whether the rays of the last call hit something: (R,) bool for each direction, positions of a texel side by
        side."""
        lit = [self._tiles.texel[self._tiles.facing(direction)] >= 0 for direction in directions]
        return [self._rooms[number][here].ravel() for number, here in enumerate(lit)]


def undecided(mesh: Mesh, rays: Rays, numbers: NDArray[np.int64]) -> int:
    """Number of rays that float32 cannot decide: they pass a triangle's rim, or start on one, and hit no other surely.

    Directions are unit vectors.
    """
    count, near = 0, _RIM * float((mesh.bounds[1] - mesh.bounds[0]).max())
    every = np.arange(mesh.triangle_count)
    corners = mesh.triangles(every)
    sides = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)  # opposite of each corner
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    heights = areas[:, None] / np.maximum(sides, np.finfo(float).tiny)
    for ray in numbers[:_MOST_DOUBTS]:
        direction = np.broadcast_to(rays.directions[ray].astype(np.float64), (len(every), 3))
        found = intersect_rays(mesh, rays.origins[ray] - 2 * near * direction, direction, every)
        weights = np.stack([1 - found.u - found.v, found.u, found.v], axis=1)
        to_rim = np.nan_to_num((weights * heights).min(axis=1), nan=-np.inf)
        depth = found.depth - 2 * near
        ahead, inside = (depth > near) & np.isfinite(depth), to_rim > near
        doubtful = (to_rim >= -near) & np.where(ahead, ~inside, np.abs(depth) <= near)
        count += bool(doubtful.any() and not (ahead & inside).any())
    return count


def rays_of(tiles: Tiles, direction: NDArray[np.float64], offsets: NDArray[np.float64]) -> Rays:
    """Rays of the tiles that face a direction; positions of a texel lie side by side, which suits packets."""
    facing = tiles.facing(direction)
    origins, directions = zip(*(tiles.rays(facing, direction, tuple(offset)) for offset in offsets), strict=True)
    return Rays(np.stack(origins, axis=1).reshape(-1, 3), np.stack(directions, axis=1).reshape(-1, 3))


def _measure_tiles(point: Point, mesh: Mesh, stack: ExitStack) -> Measured:
    settings = point.workload_options
    atlas = Atlas.unwrap(mesh, settings.map_size, kept_in=default_cache() / "atlases", time_limit_s=point.time_limit_s)
    tiles = Tiles.of(Texels.of(mesh, atlas), settings.tile_size, settings.least_texels)
    if not len(tiles):
        raise InputError(
            f"no tile of a flat chart of {point.scene} has {settings.least_texels} texels: set "
            "workload.least_texels or a larger workload.map_size"
        )
    directions, offsets = directions_of(point), sub_pixel_offsets(settings.positions)
    own = AlignedTiles(point, tiles)
    scenes = {
        name: stack.enter_context(
            RayScene(
                mesh, packet_width=width, threads=point.threads, build_quality=point.build_quality, precision="fast"
            )
        )
        for name, width in ((ONE_BY_ONE, 1), (TOGETHER, None))
    }
    batches = [rays_of(tiles, direction, offsets) for direction in directions]

    def occlude(scene: RayScene) -> list[NDArray[np.bool_]]:
        return [scene.occluded(batch, coherent=True) for batch in batches]

    own.trace(directions, offsets)
    pairs = zip(own.met(directions), occlude(scenes[ONE_BY_ONE]), strict=True)
    different = [np.flatnonzero(one != other) for one, other in pairs]
    doubtful = sum(undecided(mesh, batch, numbers) for batch, numbers in zip(batches, different, strict=True))
    prepared: list[float] = []

    def trace() -> None:
        own.trace(directions, offsets)
        prepared.append(own.prepare_s)

    calls: dict[str, Any] = {OWN: trace, **{name: partial(occlude, scene) for name, scene in scenes.items()}}
    timed = timed_rounds(point, calls)
    results = {
        "prepare_s": median(prepared),
        "triangles_aligned": own.triangles,
        "aligned_texel_share": tiles.texel_share,
        "tiles": len(tiles),
        "rays_compared": sum(map(len, batches)),
        "rays_different": sum(map(len, different)) - doubtful,
        "rays_undecided": doubtful,
    }
    return measured(results, timed)


def _measure_bundles(point: Point, mesh: Mesh, stack: ExitStack) -> Measured:
    """All hits along parallel rays across the whole scene: counted."""
    settings = point.workload_options
    size, ours = settings.map_size, point.tracing.ours
    cameras = [
        OrthographicCamera.of_light(tuple(direction), mesh.bounds, size, size) for direction in directions_of(point)
    ]
    offsets = [tuple(pair) for pair in sub_pixel_offsets(settings.positions).tolist()]
    tracers: dict[str, Any] = {
        OWN: stack.enter_context(AlignedTracer(mesh, cameras[0], split=(min(CELLS, size), 1), **ours)),
        ONE_BY_ONE: stack.enter_context(PixelTracer(mesh, cameras[0], packet_width=1, **ours)),
        TOGETHER: stack.enter_context(PixelTracer(mesh, cameras[0], **ours)),
    }
    prepared: list[float] = []

    def gather(tracer: Any) -> Any:
        found, preparing_s = [], 0.0
        for camera in cameras:
            start = perf_counter()
            tracer.look(camera)
            preparing_s += perf_counter() - start
            found += [tracer.gather(Count(), offset).count for offset in offsets]
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
