"""Milliseconds of frames through a lens and without, by packets and the rasteriser in turns; adds rows to a table.

python -m experiments.studies lens_speed TABLE.csv runs=30 threads=1
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from experiments.studies.processes import Row, Turn, add_rows, in_processes
from scenes.directory import PAPER_SCENES


def timed(scene: str, lens: str, source: str, size: int, threads: int, runs: int) -> list[Row]:
    """Milliseconds of every frame of a scene through a lens, and of the same camera without it."""
    from time import perf_counter

    import atra
    from scenes.loading import SceneSource, load_scene

    shown = load_scene(SceneSource(source), scene, None)
    model, focal = {  # focal lengths as shares of the image's width
        "barrel": (atra.OpenCVLens(k1=-0.25, k2=0.05, p1=0.002, p2=-0.001), 0.9),
        "fisheye": (atra.FisheyeLens(k1=0.05, k2=-0.01), 0.5),
    }[lens]
    placed, pitch = atra.Camera(**shown.camera), 1.0 / (focal * size)
    sensor = atra.ImagePlane(pitch, pitch, 0.5 * size, 0.5 * size)
    camera = atra.LensCamera(placed.eye, placed.target, placed.up, size, size, lens=model, sensor=sensor)
    tracers: dict[str, Any] = {}
    for method, tracer in (("packets", atra.PixelTracer), ("raster", atra.RasterTracer)):
        for suffix, view in (("", camera), (" without lens", camera.undistorted())):
            tracers[method + suffix] = tracer(shown.mesh, view, threads=threads)
    images, rows = {method: tracer.trace() for method, tracer in tracers.items()}, []
    for run in range(-2, runs):  # the first two warm up
        for method, tracer in tracers.items():
            start = perf_counter()
            tracer.trace(out=images[method])
            taken_ms = round(1e3 * (perf_counter() - start), 3)
            if run >= 0:
                rows.append({"method": method, "run": run, "ms": taken_ms})
    return rows


def study(
    table: str, *, runs: int = 30, threads: int = 1, size: int = 1024, source: str = "directory",
    scenes: tuple[str, ...] = PAPER_SCENES,
) -> None:  # fmt: skip
    """Measure images of `size` x `size` pixels of scenes (of a `scenes.loading.SceneSource`) through every lens."""
    for scene in scenes:
        for lens in ("barrel", "fisheye"):
            given = {"scene": scene, "lens": lens, "source": source, "size": size, "threads": threads, "runs": runs}
            columns = {"frame": scene, "lens": lens, "width": size, "height": size, "threads": threads}
            add_rows(Path(table), in_processes(timed, 1, Turn(given, columns)).drop(columns="process"))
