"""This version against another clone, in processes that take turns; adds rows to a table and prints the ratios.

    python -m experiments.studies paired OTHER TABLE.parquet processes=5 threads=1,2 scenes=sponza,
    ATRA_ISA=avx2 python -m experiments.studies paired OTHER TABLE.parquet processes=5

OTHER: a folder with the other version and an environment of its own (`OTHER/.venv`). Every process measures one scene
in one of the versions. Each method builds what it needs, traces a frame that does not count, and then the frames that
do. Rays have Embree's fast setting, as in the tables. A digest says whether images are equal.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from atra.errors import InputError
from experiments.results.statistics import FEWEST_PROCESSES, Estimate
from experiments.studies.processes import HERE, Row, Turn, add_rows, in_processes
from scenes.directory import PAPER_SCENES
from scenes.loading import SceneSource, load_scene

ASKED = ("image", "views", "count", "packets", "packets_count", "aligned", "visible_first", "hybrid")
"""What a process measures: the rasteriser's image, its image from another place in every frame and its number of hits;
the methods that shoot rays; and a sample of a hybrid picture of 1280 x 720 grey pixels with a sun."""


def frames(scene: str, camera: dict[str, Any], asked: list[str], count: int, size: int, threads: int) -> list[Row]:
    """Milliseconds of `count` frames and a digest of what they found, for all that is asked. scene: a file of NumPy."""
    import hashlib
    from time import perf_counter

    import numpy as np

    import atra

    kept = np.load(scene)
    mesh = atra.Mesh(kept["vertices"], kept["faces"])
    view = atra.Camera(**camera, width=size, height=size)

    def made(kind: Any, **options: Any) -> Any:
        try:
            return kind(mesh, view, threads=threads, robust=False, **options)
        except TypeError:  # the rasteriser and older versions have no such option
            return kind(mesh, view, threads=threads, **options)

    def hybrid() -> Any:
        from atra import light

        lit = light.Scene(mesh, lights=(light.Sun((-0.5, -1.0, -0.6)),))
        wide = atra.Camera(**camera, width=1280, height=720)
        return light.HybridRenderer(lit, wide, threads=threads, robust=False)

    kinds = {"aligned": lambda: made(atra.AlignedTracer, split=(256, 1)), "hybrid": hybrid}
    kinds |= {name: lambda: made(atra.PixelTracer) for name in ("packets", "packets_count")}
    kinds |= {"visible_first": lambda: made(atra.VisibleFirstTracer, split=(256, 1))}
    rows = []
    for what in asked:
        tracer = kinds.get(what, lambda: made(atra.RasterTracer))()
        tracer.build()
        places = iter(np.linspace(0.0, 0.1, count + 1))
        out = None if what == "hybrid" or what.endswith("count") else tracer.trace()

        def answer(what: str = what, tracer: Any = tracer, places: Any = places, out: Any = out) -> list[Any]:
            if what == "hybrid":
                tracer.add(1)
                return []  # pictures are unlike each other
            if what.endswith("count"):
                result = tracer.gather(atra.Count())
                return [result.count if hasattr(result, "count") else result]
            if what == "views":
                to_target = np.subtract(camera["target"], camera["eye"])
                eye = tuple(camera["eye"] + next(places) * to_target)
                tracer.look(atra.Camera(**{**camera, "eye": eye}, width=size, height=size))
            hits = tracer.trace(out=out)
            return [hits.depth, hits.prim_id]

        answer()
        taken_ms = []
        for _ in range(count):
            start = perf_counter()
            arrays = answer()
            taken_ms.append(1e3 * (perf_counter() - start))
        digest = hashlib.sha256()
        for array in arrays:
            digest.update(np.ascontiguousarray(array).tobytes())
        middle = float(np.median(taken_ms))
        rows.append({"what": what, "digest": digest.hexdigest()[:16], "least_ms": min(taken_ms), "median_ms": middle})
        tracer.close()
    return rows


def study(
    other: str, table: str, *, scenes: Sequence[str] = PAPER_SCENES, source: str = "directory",
    asked: Sequence[str] = ASKED, threads: Sequence[int] = (1,), processes: int = 5, count: int = 11, size: int = 1024,
) -> None:  # fmt: skip
    """Measure both versions on scenes of a `scenes.loading.SceneSource`, and print the table's ratios.

    count: frames of a process. Raises InputError for too few processes.
    """
    if processes < FEWEST_PROCESSES:
        raise InputError(f"processes is {processes}, expected at least {FEWEST_PROCESSES} for intervals")
    python = Path("Scripts/python.exe" if os.name == "nt" else "bin/python")
    versions = {"other": (Path(other), str(Path(other).resolve() / ".venv" / python)), "this": (HERE, sys.executable)}
    same = {"instruction_set": os.environ.get("ATRA_ISA", "native"), "frames": count, "size": size}
    rows = pd.DataFrame()
    with TemporaryDirectory() as folder:
        for name in scenes:
            scene = load_scene(SceneSource(source), name, None)
            kept = Path(folder, f"{name.replace('/', '_')}.npz")
            np.savez(kept, vertices=scene.mesh.vertices, faces=scene.mesh.faces)
            given = {"scene": str(kept), "camera": scene.camera, "asked": list(asked), "count": count, "size": size}
            for number in threads:
                given["threads"] = number
                columns = {**same, "scene": name, "triangles": scene.mesh.triangle_count, "threads": number}
                turns = [
                    Turn(given, columns | {"version": version, "commit": _commit(place)}, by, place)
                    for version, (place, by) in versions.items()
                ]
                rows = add_rows(Path(table), in_processes(frames, processes, *turns))
    print(ratios(rows).to_string(index=False))


def _commit(folder: Path) -> str:
    told = subprocess.run(["git", "-C", str(folder), "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True)
    return told.stdout.strip()


def ratios(rows: pd.DataFrame) -> pd.DataFrame:
    """How many times as fast this version is, by what was asked: mean ratio of the medians of the processes that took
    turns, with its 95 % interval; the ratio of the least times; and whether all images are equal."""
    keys, rows_of_ratios = ["instruction_set", "threads", "what", "scene"], []
    for key, group in rows.groupby(keys, sort=True):
        paired = group.pivot_table(index="process", columns="version", values=["median_ms", "least_ms"])
        if paired.shape[1] < 4:
            continue
        estimate = Estimate.of(list(paired["median_ms", "other"] / paired["median_ms", "this"]))
        least = paired["least_ms"].min()
        rows_of_ratios.append({
            **dict(zip(keys, key, strict=True)), "this_ms": round(least["this"], 3),
            "ratio": f"{estimate.value:.3f} [{estimate.low:.3f}, {estimate.high:.3f}]",
            "ratio_of_least": round(least["other"] / least["this"], 3),
            "same": "yes" if group["digest"].nunique() == 1 else "no",
        })  # fmt: skip
    return pd.DataFrame(rows_of_ratios)
