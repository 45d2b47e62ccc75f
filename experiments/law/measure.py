"""Measure every method and split on the scenes and views of the law; one process a view, a file of each.

    python -m experiments.law.measure FOLDER --seconds 360

ATRA_ISA chooses the instruction set. Frames of a method and of packets per pixel take turns; what is kept is the median
of the ratio of both in the same round, beside the medians of the times, which are processor time of one thread. A view
whose file is there is not measured again.
"""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from statistics import median
from time import monotonic, perf_counter, thread_time
from typing import Any

import atra
from atra.compiled.instruction_sets import instruction_sets_here
from atra.embree.library import load_library
from atra.errors import AtraError
from experiments.classification.bvh.tracer import BvhTracer
from experiments.classification.shafts.tracer import ClassifiedTracer
from experiments.methods.culled.tracer import TiledTracer
from scenes.generated import FAMILIES
from scenes.loading import SceneSource, load_scene, scene_is_available
from scenes.scene import Scene
from scenes.views import view_fields

COLUMNS = (
    "instruction_set", "scene", "view", "triangles", "width", "height", "method", "packet_width", "geometry", "culling",
    "split_x", "split_y", "want", "rounds", "time_s", "packets_time_s", "over_packets", "plan_time_s", "build_time_s",
    "bytes", "copies",
)  # fmt: skip

SIZE = 512

_PAPER = ("cornell_box", "mitsuba", "fireplace_room", "sponza")

_SCENES = (
    *_PAPER, "soup_10000", "needles_20000", "terrain_100000", "city_10000", "shells_30000", "spheres_3000",
    "forest_30000", "three_holes", "material_ball", "soup_300", "terrain_1000", "city_100", "needles_1000",
    "shells_1000", "soup_200000", "weekend", "spheres_100000", "atrium", "city_1000000", "spheres_10000000",
    "living_room", "terrain_3000000", "needles", "shells_1000000", "forest_300000", "needles_200000",
)  # fmt: skip

VIEWS = (
    *((name, "own") for name in _SCENES),
    *((name, view) for view in ("near", "aside", "wide") for name in _PAPER),
    *(("three_holes", "near"), ("atrium", "above"), ("living_room", "around")),
)
"""Scenes with their views, the most telling first."""

LEAST_ROUNDS, MOST_ROUNDS, ENOUGH_S = 3, 7, 0.2

MANY_TRIANGLES, FEW_CASES = 2_000_000, ("raster", "pixel", "visible_first 128", "aligned 64 1", "aligned 128 128")
"""Scenes with at least so many triangles have only these cases, since each build takes seconds."""

MOST_COPIES = 6_000_000

SLOW_COUNT_S = 6.0
"""Where deciding samples near edges takes longer, as with needles, all hits are measured with packets alone."""

SLOW_BUILD_S = 1.0
"""A faster build is timed a second time, when all its kernels are loaded."""

KEPT = ("embree_bytes", "bvh_bytes", "scratch_bytes", "list_bytes", "lookup_bytes")
"""Counters that are bytes."""

Case = tuple[str, dict[str, Any], Callable[[], Any]]


def cases(mesh: atra.Mesh, camera: atra.Camera) -> Iterator[Case]:
    """The method, what distinguishes the case, and a call that makes its tracer."""
    widest = load_library().native_packet_widths[-1]
    same = {"threads": 1, "ties": "any"}

    def of(method: str, kind: Any, split: tuple[int, int] | None = None, **options: Any) -> Case:
        told = {"split_x": 1, "split_y": 1, "packet_width": 1, **options}
        if split is None:
            return method, told, lambda: kind(mesh, camera, **same, **options)
        told |= {"split_x": split[0], "split_y": split[1]}
        return method, told, lambda: kind(mesh, camera, split, **same, **options)

    yield of("raster", atra.RasterTracer)
    yield of("pixel", atra.PixelTracer, packet_width=1)
    yield of("bvh", BvhTracer)
    yield of("classified", ClassifiedTracer)
    for split in ((8, 8), (32, 32)):
        yield of("tiles", TiledTracer, split, packet_width=widest)
    for split in ((16, 1), (128, 1), (32, 32), (128, 128)):
        yield of("visible_first", atra.VisibleFirstTracer, split, packet_width=widest)
    copied = {"geometry": "copied", "culling": True, "packet_width": widest}
    for split in ((1, 1), (8, 1), (64, 1), (256, 1), (1, 64), (16, 16), (64, 64), (128, 128)):
        yield of("aligned", atra.AlignedTracer, split, **copied)
    for split in ((8, 1), (128, 1), (64, 64)):
        yield of("aligned", atra.AlignedTracer, split, **{**copied, "packet_width": 1})
    yield of("aligned", atra.AlignedTracer, (8, 1), **{**copied, "culling": False})
    yield of("aligned", atra.AlignedTracer, (16, 1), geometry="instanced", culling=False, packet_width=widest)


WANTS: dict[str, Callable[[Any, Any], Any]] = {
    "nearest": lambda tracer, out: tracer.trace(out=out),
    "count": lambda tracer, out: tracer.gather(atra.Count(), out=out),
}

_COUNTS = {
    "raster": ((1, 1),),
    "pixel": ((1, 1),),
    "aligned": ((8, 1), (64, 1), (256, 1), (64, 64), (128, 128)),
    "instanced": ((16, 1),),
}
"""Splits at which all hits are measured, too."""


def mesh_and_camera(name: str, view: str) -> tuple[atra.Mesh, atra.Camera]:
    """What a view of a scene shows. Raises InputError for one that is not on this machine."""
    scene = scene_named(name)
    return scene.mesh, atra.Camera(**view_fields(scene.mesh, scene.camera, view), width=SIZE, height=SIZE)


def scene_named(name: str) -> Scene:
    """A scene of the paper, a built-in or a generated one. Raises InputError for one that is not on this machine."""
    family = name.rpartition("_")[0]
    made = SceneSource.generated if family in FAMILIES else SceneSource.procedural
    source = made if scene_is_available(made, name) and name not in _PAPER else SceneSource.directory
    return load_scene(source, name, None)


def memory_of(tracer: Any) -> int:
    """Bytes that a built tracer keeps: what Embree holds by its own account, our own BVH, lists and look-up of shafts,
    the rasteriser's clusters, and the arrays of every scene."""
    prepared = getattr(tracer, "prepared", None)
    passes = getattr(prepared, "second_passes", ())
    scenes = [getattr(prepared, "whole", None), *(one.scene for one in passes if one is not None)]
    arrays = [one for scene in scenes if scene is not None for kept in scene._kept[1:] for one in kept]
    geometry = getattr(prepared, "geometry", None)
    arrays += [getattr(geometry, one, None) for one in ("vertices", "faces", "records", "transforms")]
    return int(sum(tracer.counters.get(one, 0) for one in KEPT) + sum(one.nbytes for one in arrays if one is not None))


def measure_view(name: str, view: str, path: Path) -> None:
    """Write the rows of a view."""
    mesh, camera = mesh_and_camera(name, view)
    isa = os.environ.get("ATRA_ISA") or instruction_sets_here()[-1]
    widest = load_library().native_packet_widths[-1]
    rows = []
    slow_count = False
    with atra.PixelTracer(mesh, camera, packet_width=widest, threads=1, ties="any") as packets:
        outs: dict[str, Any] = dict.fromkeys(WANTS)
        for method, told, make in [("pixel", {"packet_width": widest}, lambda: packets), *cases(mesh, camera)]:
            split = (told.get("split_x", 1), told.get("split_y", 1))
            is_whole = method == "aligned" and not told["culling"] and told["geometry"] == "copied"
            if is_whole and split[0] * mesh.triangle_count > MOST_COPIES:
                continue
            if mesh.triangle_count > MANY_TRIANGLES:
                told_as = f"{method} {split[0]} {split[1]}"
                if not told_as.startswith(FEW_CASES) or (method == "aligned" and told["packet_width"] == 1):
                    continue
            tracer = None
            try:
                tracer = make()
                tracer.build()
                if mesh.triangle_count < MANY_TRIANGLES // 10 or tracer.build_time_s < SLOW_BUILD_S:
                    tracer.build()
                built = tracer.plan_time_s, tracer.build_time_s
                counters = tracer.counters
                for want, call in WANTS.items():
                    kind = "instanced" if told.get("geometry") == "instanced" else method
                    if want == "count" and (split not in _COUNTS.get(kind, ()) or is_whole):
                        continue
                    if want == "count" and slow_count:
                        continue
                    begin = perf_counter()
                    timed = take_turns(partial(call, tracer), partial(call, packets), outs, want)
                    slow_count |= want == "count" and perf_counter() - begin > SLOW_COUNT_S
                    counters = tracer.counters
                    rows.append({
                        "instruction_set": isa, "scene": name, "view": view, "triangles": mesh.triangle_count,
                        "width": SIZE, "height": SIZE, "method": method, "geometry": "", "culling": "", "split_x": 1,
                        "split_y": 1, "want": want, **told, **timed, "plan_time_s": built[0], "build_time_s": built[1],
                        "bytes": memory_of(tracer) if want == "nearest" else "", "copies": counters["triangles_traced"],
                    })  # fmt: skip
            except (AtraError, MemoryError) as error:
                print(f"{name} {view} {method} {told}: {error}", file=sys.stderr)
            finally:
                if tracer is not None and tracer is not packets:
                    tracer.close()
    part = path.with_suffix(".part")
    with part.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)
    part.rename(path)


def take_turns(
    own: Callable[[Any], Any], packets: Callable[[Any], Any], outs: dict[str, Any], want: str
) -> dict[str, Any]:
    """Frames of both, one after the other."""
    pairs: list[tuple[float, float]] = []
    out = own(None)
    if outs[want] is None:
        outs[want] = packets(None)
    begin = perf_counter()
    while len(pairs) < LEAST_ROUNDS or (len(pairs) < MOST_ROUNDS and perf_counter() - begin < ENOUGH_S):
        start = thread_time()
        out = own(out)
        middle = thread_time()
        outs[want] = packets(outs[want])
        pairs.append((middle - start, thread_time() - middle))
    return {
        "rounds": len(pairs),
        "time_s": median(one for one, _ in pairs),
        "packets_time_s": median(other for _, other in pairs),
        "over_packets": median(other / one for one, other in pairs),
    }


def main() -> None:
    """Measure what is missing, for so long."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=330.0)
    parser.add_argument("--one", nargs=2, metavar=("SCENE", "VIEW"))
    given = parser.parse_args()
    isa = os.environ.get("ATRA_ISA") or "widest"
    given.folder.mkdir(parents=True, exist_ok=True)

    def path_of(name: str, view: str) -> Path:
        return given.folder / f"{isa}-{name}-{view}.csv"

    if given.one:
        scene, seen_as = given.one
        measure_view(scene, seen_as, path_of(scene, seen_as))
        return
    end = monotonic() + given.seconds
    for name, view in VIEWS:
        if not path_of(name, view).exists() and monotonic() < end:
            begin = monotonic()
            command = [sys.executable, "-m", "experiments.law.measure", str(given.folder), "--one", name, view]
            failed = subprocess.run(command, check=False).returncode
            print(f"{name} {view}: {monotonic() - begin:.0f} s{' FAILED' * bool(failed)}", flush=True)


if __name__ == "__main__":
    main()
