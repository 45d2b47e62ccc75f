"""The paper's gain on the Cornell box by an older Embree: single rays through libembree3.

    python -m experiments.studies older_embree libembree3.so.3 reports/reference/older_embree

The first argument is a file or a name that the system finds; Debian 12 has the library in its package libembree3-3.
Geometry and rays are those of `atra.AlignedTracer`. The kernels are others: a query of Embree 3 has other arguments
than one of Embree 4. Each process measures everything in turns; the images are judged as all are.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numba import njit, types
from numpy.typing import NDArray

from atra.alignment.alignment import Alignment
from atra.alignment.cells import CellOptions, reference_rays
from atra.alignment.copies import copied_geometry
from atra.alignment.second_pass import SECOND_PASS_TILE, nearest_in_tiles
from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.intrinsics import address_at, float_at, uint32_at
from atra.compiled.memory import store
from atra.compiled.store import callback
from atra.compiled.threads import WorkerPool
from atra.compiled.vectors import splat
from atra.embree import layout
from atra.embree.packets_kernels import INFINITY, MISS, START
from atra.errors import EmbreeError
from atra.geometry.camera import Camera
from atra.geometry.split import Split
from atra.hits import Hits
from atra.judge.compare import compare
from atra.tracing.geometry import AlignedGeometry, plan_plain_geometry
from experiments.harness.rounds import measure_rounds
from experiments.results.statistics import Estimate, best_of
from experiments.studies.processes import Row, Turn, in_processes
from scenes.built_in import BUILT_IN

SPLITS = (64, 128, 256, 512)
NEAREST, ALL_HITS = "nearest", "all_hits"
"""The paper's two possible baselines at 1 x 1: `rtcIntersect1`, and aligned rays without culling."""

_WIDTH = 1024
_VALID, _RECORDS, _CONTEXT, _RAY, _HIT = 0, 8, 16, 24, 32
"""Byte offsets in RTCFilterFunctionNArguments."""

_DEPTH, _PRIM_ID, _CONTEXT_WORDS = 24, 32, 8
"""RTCIntersectContext has 24 bytes; the addresses of the pixel that the filter writes stand behind them."""

_P, _U, _S = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
_SIGNATURES: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "rtcNewDevice": (_P, (ctypes.c_char_p,)),
    "rtcReleaseDevice": (None, (_P,)),
    "rtcGetDeviceError": (ctypes.c_int, (_P,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_P, ctypes.c_int)),
    "rtcNewScene": (_P, (_P,)),
    "rtcReleaseScene": (None, (_P,)),
    "rtcCommitScene": (None, (_P,)),
    "rtcNewGeometry": (_P, (_P, ctypes.c_int)),
    "rtcReleaseGeometry": (None, (_P,)),
    "rtcCommitGeometry": (None, (_P,)),
    "rtcAttachGeometry": (_U, (_P, _P)),
    "rtcSetSharedGeometryBuffer": (None, (_P, ctypes.c_int, _U, ctypes.c_int, _P, _S, _S, _S)),
    "rtcSetGeometryUserData": (None, (_P, _P)),
    "rtcSetGeometryIntersectFilterFunction": (None, (_P, _P)),
    "rtcIntersect1": (None, (_S, _S, _S)),  # numbers, as Numba passes addresses
}


@cache
def _keep_nearest() -> Any:
    """The filter of `atra.AlignedTracer` for one ray: keep the hit where it is nearer than the cell's, reject it."""

    @callback(types.void(types.int64))
    def keep_nearest(arguments):  # type: ignore[no-untyped-def]
        record = address_at(address_at(arguments + _RECORDS) + 8 * uint32_at(address_at(arguments + _HIT) + 20))
        context, depth = address_at(arguments + _CONTEXT), float_at(address_at(arguments + _RAY) + 32)
        pixel = 4 * (record >> 32)
        if depth < float_at(address_at(context + _DEPTH) + pixel):
            store(splat(depth, 1), address_at(context + _DEPTH) + pixel)
            store(splat(np.int32(record & 0xFFFFFFFF), 1), address_at(context + _PRIM_ID) + pixel)
        store(splat(np.int32(0), 1), address_at(arguments + _VALID))

    return keep_nearest


def _kernels(query: Any) -> tuple[Callable[..., None], ...]:
    """Kernels that trace single rays by `rtcIntersect1`: one per pixel; those of the reference cell; and, in the tiles
    that see any, a second pass for triangles that no copy may show (`atra.tracing.geometry.LeftOut`).

    They fill depth, (H, W) float32, and prim_id, (H, W) uint32. ray: (24,) float32, an RTCRayHit, aligned. context:
    (8,) int64. nearest: (tiles y, tiles x) float32, depths before which no ray of a tile meets what was left out.
    """

    @njit
    def start(ray, columns, rows, x, y):  # type: ignore[no-untyped-def]
        for axis in range(3):
            ray[axis] = 0.0
            ray[4 + axis] = columns[axis, x] + rows[axis, y]
        ray[3], ray[7], ray[8] = START, 0.0, INFINITY
        ids = ray.view(np.uint32)
        ids[9], ids[10], ids[11] = MISS, 0, 0
        ids[17] = ids[18] = ids[19] = MISS

    @njit
    def trace_pixels(scene, ray, context, columns, rows, depth, prim_id):  # type: ignore[no-untyped-def]
        ids = ray.view(np.uint32)
        for y in range(depth.shape[0]):
            for x in range(depth.shape[1]):
                start(ray, columns, rows, x, y)
                query(scene, context.ctypes.data, ray.ctypes.data)
                depth[y, x], prim_id[y, x] = ray[8], ids[17]

    @njit
    def trace_cell(scene, ray, context, columns, rows, depth, prim_id):  # type: ignore[no-untyped-def]
        for y in range(rows.shape[1]):
            depth[y, :], prim_id[y, :] = INFINITY, MISS
            for x in range(columns.shape[1]):
                start(ray, columns, rows, x, y)
                context[_DEPTH // 8] = depth.ctypes.data + 4 * (y * depth.shape[1] + x)
                context[_PRIM_ID // 8] = prim_id.ctypes.data + 4 * (y * depth.shape[1] + x)
                query(scene, context.ctypes.data, ray.ctypes.data)

    @njit
    def trace_left_out(scene, ray, context, columns, rows, depth, prim_id, nearest):  # type: ignore[no-untyped-def]
        ids = ray.view(np.uint32)
        across, down = SECOND_PASS_TILE
        for ty, tx in zip(*np.nonzero(np.isfinite(nearest))):  # noqa: B905  # Numba knows no strict
            for y in range(ty * down, min(ty * down + down, depth.shape[0])):
                for x in range(tx * across, min(tx * across + across, depth.shape[1])):
                    if depth[y, x] >= nearest[ty, tx]:
                        start(ray, columns, rows, x, y)
                        ray[3], ray[8] = max(nearest[ty, tx], START), depth[y, x]
                        query(scene, context.ctypes.data, ray.ctypes.data)
                        if ids[17] != MISS:
                            depth[y, x], prim_id[y, x] = ray[8], ids[17]

    return trace_pixels, trace_cell, trace_left_out


class _Embree3:
    """The library with a device of one thread."""

    def __init__(self, path: str) -> None:
        try:
            self.functions = ctypes.CDLL(path)
            for name, (result, arguments) in _SIGNATURES.items():
                function = getattr(self.functions, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError) as error:
            raise EmbreeError(f"{path!r} is no usable libembree3: {error}") from error
        self.device = self.functions.rtcNewDevice(b"threads=1")
        number = self.functions.rtcGetDeviceProperty(self.device, layout.DEVICE_VERSION)
        self.version = f"{number // 10000}.{number // 100 % 100}.{number % 100}"
        if number // 10000 != 3:
            raise EmbreeError(f"{path!r} is Embree {self.version}, expected Embree 3")
        self.trace_pixels, self.trace_cell, self.trace_left_out = _kernels(self.functions.rtcIntersect1)
        self._kept: list[AlignedGeometry] = []

    def build(self, geometry: AlignedGeometry) -> int:
        """The scene of triangles, with the filter where there are records."""
        self._kept.append(geometry)
        scene = self.functions.rtcNewScene(self.device)
        triangles = self.functions.rtcNewGeometry(self.device, layout.GEOMETRY_TRIANGLE)
        for buffer, kind, array in (
            (layout.BUFFER_VERTEX, layout.FORMAT_FLOAT3, geometry.vertices),
            (layout.BUFFER_INDEX, layout.FORMAT_UINT3, geometry.faces),
        ):
            shared = (triangles, buffer, 0, kind, array.ctypes.data, 0, 12, len(array))
            self.functions.rtcSetSharedGeometryBuffer(*shared)
        if len(geometry.records):
            self.functions.rtcSetGeometryUserData(triangles, geometry.records.ctypes.data)
            self.functions.rtcSetGeometryIntersectFilterFunction(triangles, _keep_nearest().address)
        self.functions.rtcCommitGeometry(triangles)
        self.functions.rtcAttachGeometry(scene, triangles)
        self.functions.rtcReleaseGeometry(triangles)
        self.functions.rtcCommitScene(scene)
        code = self.functions.rtcGetDeviceError(self.device)
        if code:
            raise EmbreeError(f"Embree {self.version} cannot build the scene: {layout.ERROR_NAMES.get(code, code)}")
        return int(scene)


def medians(library: str, rounds: int) -> list[Row]:
    """What `measure` finds. Run in a process of its own."""
    from importlib import import_module

    return [import_module("experiments.studies.older_embree").measure(library, rounds)]


def measure(path: str, rounds: int) -> dict[str, Any]:
    """Medians of the rounds: seconds of a frame, by what traced it, and ratios within a round of each baseline over
    each split; and the pixels wrong in all aligned images."""
    scene = BUILT_IN["cornell_box"]
    mesh, camera = scene.make(), Camera(**scene.camera, width=_WIDTH, height=_WIDTH)
    embree, pool = _Embree3(path), WorkerPool(1)
    ray, context = aligned_empty((24,), np.float32), aligned_empty((_CONTEXT_WORDS,), np.int64)
    ray[:], context[:] = 0.0, 0
    context.view(np.int32)[0], context.view(np.uint32)[4] = 1, MISS  # coherent, as the tracers' are; no instance
    whole = Split.of_image((1, 1), camera)
    pixels = reference_rays(Alignment.of_cells(camera, whole), (0.5, 0.5))
    images: dict[str, tuple[NDArray[np.float32], NDArray[np.uint32]]] = {}
    frames: dict[str, Callable[[], None]] = {}

    def add_aligned(name: str, split: Split, culling: bool) -> None:
        alignment = Alignment.of_cells(camera, split)
        options = CellOptions(culling=culling, packet_width=1, robust=False)
        geometry = copied_geometry((mesh,), alignment, options, _WIDTH, pool)
        rays, built, image = reference_rays(alignment, (0.5, 0.5)), embree.build(geometry), images[name]
        (left_out,) = geometry.left_out
        if left_out is None:
            frames[name] = lambda: embree.trace_cell(built, ray, context, *rays, *image)
            return
        others = np.ones(mesh.triangle_count, np.bool_)
        others[left_out.prim_ids] = False
        second = embree.build(plan_plain_geometry(mesh, camera, others))
        nearest = nearest_in_tiles(mesh, camera, left_out)

        def both() -> None:
            embree.trace_cell(built, ray, context, *rays, *image)
            embree.trace_left_out(second, ray, context, *pixels, *image, nearest)

        frames[name] = both

    for name in (NEAREST, ALL_HITS, *map(str, SPLITS)):
        images[name] = np.zeros((_WIDTH, _WIDTH), np.float32), np.zeros((_WIDTH, _WIDTH), np.uint32)
    plain = embree.build(plan_plain_geometry(mesh, camera))
    frames[NEAREST] = lambda: embree.trace_pixels(plain, ray, context, *pixels, *images[NEAREST])
    add_aligned(ALL_HITS, whole, culling=False)
    for split_x in SPLITS:
        add_aligned(str(split_x), Split.of_image((split_x, 1), camera), culling=True)
    timed = measure_rounds(frames, rounds=rounds, warmup=1)
    hits = {name: Hits(*image, (0.5, 0.5), mesh, camera) for name, image in images.items()}
    wrong = sum(compare(hits[name], hits[NEAREST]).pixels_wrong for name in hits if name != NEAREST)
    seconds = {name: np.array(samples) for name, samples in timed.samples.items()}
    told = {f"{name}_s": float(np.median(samples)) for name, samples in seconds.items()}
    told |= {
        _ratio(baseline, split_x): float(np.median(seconds[baseline] / seconds[str(split_x)]))
        for baseline in (NEAREST, ALL_HITS)
        for split_x in SPLITS
    }
    busy = {} if timed.occupancy is None else asdict(timed.occupancy)
    return {"embree_version": embree.version, "pixels_wrong": wrong, **busy, **told}


def gains(rows: pd.DataFrame) -> dict[str, tuple[int, Estimate]]:
    """By baseline, the best split and the gain there. rows: a process each."""
    return {
        baseline: best_of({split_x: list(rows[_ratio(baseline, split_x)]) for split_x in SPLITS})
        for baseline in (NEAREST, ALL_HITS)
    }


def _ratio(baseline: str, split_x: int) -> str:
    return f"{baseline}_over_{split_x}"


def study(library: str, folder: str, *, processes: int = 7, rounds: int = 11) -> None:
    """Measure as many processes as asked for, write folder/table.parquet, and print the gains. library: libembree3, a
    file or a name."""
    table = in_processes(medians, processes, Turn({"library": library, "rounds": rounds}, {"scene": "cornell_box"}))
    Path(folder).mkdir(parents=True, exist_ok=True)
    table.to_parquet(Path(folder, "table.parquet"), index=False)
    for baseline, (split_x, gain) in gains(table).items():
        print(f"Embree {table['embree_version'][0]}: {gain} times as fast as {baseline} at {split_x} x 1")
