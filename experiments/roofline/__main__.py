"""Measure the rasteriser's stages on scenes; writes a table and draws it.

    python -m experiments.roofline reports/reference/roofline --frames 40
    ATRA_ISA=avx2 python -m experiments.roofline reports/reference/roofline --frames 40

One thread; pin it to a core. Rows of the chosen instruction set replace those of the table. ms: least time of a stage
among the frames, by a clock inside the loop. hot_ms: the same work at once again, caches warm and branches learned; for
the output, its bytes by the rate at which this machine writes past the caches. What lies between is waiting for memory
and mispredicted branches. Bytes are counted, those that stay in the first cache left out.
"""

from __future__ import annotations

import csv
from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

import atra
from atra.all_hits.target_kernels import band_stride
from atra.compiled.aligned_memory import aligned_empty
from atra.compiled.instruction_sets import chosen_instruction_set, instruction_sets_here, native_lanes
from atra.compiled.threads import WorkerPool
from atra.raster.frames import FrameMemory, bands_of
from atra.raster.image import ImageAddresses, eye_of
from experiments.harness.environment import read_environment
from experiments.roofline import stages_kernels as stages
from experiments.roofline.figure import draw_stages
from scenes.directory import PAPER_SCENES
from scenes.loading import SceneSource, load_scene

COLUMNS = (
    "scene", "instruction_set", "lanes", "stage", "of", "count", "ms", "hot_ms", "read_mb", "written_mb", "idle_lanes",
    "processor", "commit",
)  # fmt: skip

_OF = (
    "clusters times bands", "pixels", "clusters in bands", "vertices", "triangles", "triangles", "triangles",
    "triangles", "pixels", "rows",
)  # fmt: skip
"""What is counted of each stage."""

_BYTES = ((8, 8), (4, 0), (0, 0), (12, 0), (8, 0), (0, 0), (0, 0), (0, 0), (8, 8), (0, 0))
"""Bytes from and to memory beyond the first cache, of each that is counted."""


def main() -> None:
    """Measure what the arguments say, and write table and figure."""
    parser = ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("--source", default="directory", help="of the scenes, see `scenes.loading.SceneSource`")
    parser.add_argument("--scenes", nargs="*", default=PAPER_SCENES)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    table, machine = given.folder / "table.csv", read_environment()
    same = {"instruction_set": chosen_instruction_set() or instruction_sets_here()[-1], "lanes": native_lanes()}
    own = [
        {**same, "scene": name, **row, "processor": machine.cpu, "commit": machine.git_commit}
        for name in given.scenes
        for row in _measured(load_scene(SceneSource(given.source), name, None), given.size, given.frames)
    ]
    rows = [row for row in _rows_of(table) if row["instruction_set"] != same["instruction_set"]] + own
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    draw_stages(_rows_of(table), given.folder / "stages.png")


def _rows_of(table: Path) -> list[dict[str, str]]:
    if not table.exists():
        return []
    with table.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _measured(scene: Any, size: int, frames: int) -> Iterator[dict[str, Any]]:
    """The rows of a scene, in the order of a frame."""
    camera, pool, lanes = atra.Camera(width=size, height=size, **scene.camera), WorkerPool(1), native_lanes()
    memory, (eye, _numbers) = FrameMemory.of(scene.mesh, pool), eye_of(scene.mesh, camera, (0.5, 0.5))
    depth, prim_id = aligned_empty((size, size), np.float32), aligned_empty((size, size), np.uint32)
    band_rows, doubled = bands_of(size, size)
    stride = int(band_stride.py_func(size))
    workspace = memory.of_threads(1, size, 2 * band_rows, 16 * band_rows * stride)[0]
    nearer = np.full((4 * band_rows + 1, stride), np.inf, np.float32)
    draw: Any = stages.watched_kernel(lanes)
    image = ImageAddresses(depth.ctypes.data, prim_id.ctypes.data, size, size)

    def frame(purpose: int) -> tuple[NDArray[np.int64], NDArray[np.int64], float, float]:
        counter, took, counts = np.zeros(1, np.int64), np.zeros(10, np.int64), np.zeros(13, np.int64)
        start = perf_counter()
        memory.cull(eye, camera, band_rows, pool)
        culled = perf_counter()
        order = memory.order()
        ordered = perf_counter()
        draw(
            counter.ctypes.data, eye, memory.clusters.addresses, memory.rectangles, memory.bounds, order,
            band_rows, doubled, image, workspace, purpose, nearer.ctypes.data, took, counts,
        )  # fmt: skip
        return took, counts, culled - start, ordered - culled

    tick_ms = _tick_ms(depth)
    counts = frame(stages.COUNTED)[1]
    timed, hot = ([frame(purpose) for _ in range(frames)] for purpose in (stages.TIMED, stages.HOT))
    ms, hot_ms = (np.min([took for took, *_ in runs], axis=0) * tick_ms for runs in (timed, hot))
    per_byte = min(stages.stream_often(depth.ctypes.data, depth.nbytes, 4) for _ in range(9)) / 4 / depth.nbytes
    hot_ms[stages.OUTPUT] = 8 * size * size * per_byte * tick_ms
    per_row = min(
        stages.decide_often(workspace.points, 0x40002000000000, lanes, workspace.exact, 999)[0] for _ in range(9)
    )
    ms[stages.DOUBTS] = hot_ms[stages.DOUBTS] = counts[stages.DOUBTS] * per_row / 999 * tick_ms
    for name, place, of in (("culling of clusters", 2, "clusters"), ("order of clusters", 3, "clusters seen")):
        least = 1e3 * min(float(run[place]) for run in timed)
        count = memory.clusters.count
        yield _row(name, of, count, least, np.nan, (24 if place == 2 else 12, 20 if place == 2 else 8), np.nan)
    for stage, name in enumerate(stages.STAGES):
        idle = float(1.0 - counts[12] / max(counts[11], 1)) if stage == stages.NARROW else np.nan
        yield _row(name, _OF[stage], int(counts[stage]), float(ms[stage]), float(hot_ms[stage]), _BYTES[stage], idle)
    pool.close()


def _row(
    stage: str, of: str, count: int, ms: float, hot_ms: float, moved: tuple[int, int], idle: float
) -> dict[str, Any]:
    read, written = (count * part / 1e6 for part in moved)
    return {
        "stage": stage, "of": of, "count": count, "ms": f"{ms:.4f}", "hot_ms": _text(hot_ms, 4),
        "read_mb": f"{read:.2f}", "written_mb": f"{written:.2f}", "idle_lanes": _text(idle, 3),
    }  # fmt: skip


def _text(value: float, digits: int) -> str:
    return "" if np.isnan(value) else f"{value:.{digits}f}"


def _tick_ms(memory: NDArray[Any]) -> float:
    """Milliseconds of a tick of the clock inside kernels."""
    stages.stream_often(memory.ctypes.data, memory.nbytes, 1)
    start = perf_counter()
    ticks = stages.stream_often(memory.ctypes.data, memory.nbytes, 60)
    return 1e3 * (perf_counter() - start) / ticks


if __name__ == "__main__":
    main()
