"""This version against another clone, frame by frame in turns; adds rows to a table and prints the ratios.

    python -m experiments.paired OTHER TABLE.parquet --processes 5 --threads 1 2
    ATRA_ISA=avx2 python -m experiments.paired OTHER TABLE.parquet --processes 5

OTHER: a folder with the other version and an environment of its own (`OTHER/.venv`). Every process measures one scene
in one of the versions; the versions take turns. Each method builds what it needs, traces a frame that does not count,
and then the frames that do. Rays have Embree's fast setting, as in the tables. A digest says whether images are equal.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd

from experiments.harness.environment import read_environment
from experiments.results.statistics import FEWEST_PROCESSES, Estimate
from scenes.directory import PAPER_SCENES
from scenes.loading import SceneSource, load_scene

ASKED = ("image", "views", "count", "packets", "packets_count", "aligned", "visible_first", "tiles", "hybrid")
"""What a process measures: the rasteriser's image, its image from another place in every frame and its number of hits;
the methods that shoot rays; and a sample of a hybrid picture of 1280 x 720 pixels with a sun, whose surfaces have
textures, or are grey in versions that had no materials of glTF."""

_PROCESS = """
import hashlib, json, sys
from time import perf_counter
import numpy as np
import atra
given = json.loads(sys.argv[1])
kept = np.load(given["scene"])
mesh = atra.Mesh(kept["vertices"], kept["faces"])
camera = atra.Camera(**given["camera"], width=given["size"], height=given["size"])
def made(kind, **options):
    try:
        return kind(mesh, camera, threads=given["threads"], robust=False, **options)
    except TypeError:  # the rasteriser and older versions have no such option
        return kind(mesh, camera, threads=given["threads"], **options)
makers = {
    "image": lambda: made(atra.RasterTracer), "views": lambda: made(atra.RasterTracer),
    "count": lambda: made(atra.RasterTracer),
    "packets": lambda: made(atra.PixelTracer), "packets_count": lambda: made(atra.PixelTracer),
    "aligned": lambda: made(atra.AlignedTracer, split=(256, 1)),
    "visible_first": lambda: made(atra.VisibleFirstTracer, split=(256, 1)),
    "tiles": lambda: made(tiled(), split=(16, 16)),
    "hybrid": lambda: hybrid(),
}
def tiled():
    try:
        from experiments.methods.culled.tracer import TiledTracer
    except ImportError:  # older versions
        from atra import TiledTracer
    return TiledTracer
def hybrid():
    camera = atra.Camera(**given["camera"], width=1280, height=720)
    try:
        from atra import light
    except ImportError:
        from atra import render
        scene = render.RenderScene(mesh, lights=(render.Sun((-0.5, -1.0, -0.6)),))
        return render.HybridRenderer(scene, camera, threads=given["threads"])
    texels = np.random.default_rng(1).integers(0, 256, (2, 1024, 1024, 3), np.uint8)
    texels[1, :, :, 2] = 255
    material = light.MetallicRoughness(light.Image(texels[0], is_coded=True), normals=light.Image(texels[1]))
    uv = (mesh.vertices[:, :2] + mesh.vertices[:, 2:]).astype(np.float32)
    scene = light.Scene(mesh, (material,), lights=(light.Sun((-0.5, -1.0, -0.6)),), uv=uv)
    return light.HybridRenderer(scene, camera, threads=given["threads"], robust=False)
told = {}
for what in given["asked"]:
    tracer = makers[what]()
    tracer.build()
    if what == "hybrid":
        answer, arrays = lambda: tracer.add(1), lambda _: []  # pictures are unlike each other
    elif what.endswith("count"):
        answer = lambda: tracer.gather(atra.Count())
        arrays = lambda found: [found.count if hasattr(found, "count") else found]
    else:
        out = tracer.trace()
        answer = lambda: tracer.trace(out=out)
        if what == "views":
            places = iter(np.linspace(0.0, 0.1, given["frames"] + 1))
            to_target = np.subtract(given["camera"]["target"], given["camera"]["eye"])
            def answer():
                eye = tuple(given["camera"]["eye"] + next(places) * to_target)
                tracer.look(atra.Camera(**{**given["camera"], "eye": eye}, width=given["size"], height=given["size"]))
                return tracer.trace(out=out)
        arrays = lambda found: [found.depth, found.prim_id]
    found = answer()
    taken_ms = []
    for _ in range(given["frames"]):
        start = perf_counter()
        found = answer()
        taken_ms.append(1e3 * (perf_counter() - start))
    digest = hashlib.sha256()
    for array in arrays(found):
        digest.update(np.ascontiguousarray(array).tobytes())
    told[what] = taken_ms, digest.hexdigest()[:16]
    tracer.close()
print(json.dumps(told))
"""


def main() -> None:
    """Measure what the arguments say, add it to the table, and print the table's ratios."""
    parser = ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("other", type=Path, help="folder of the other version")
    parser.add_argument("table", type=Path)
    parser.add_argument("--scenes", nargs="*", default=PAPER_SCENES)
    parser.add_argument("--source", default="directory", help="of the scenes, see `scenes.loading.SceneSource`")
    parser.add_argument("--asked", nargs="*", default=ASKED, choices=ASKED)
    parser.add_argument("--threads", nargs="*", type=int, default=[1])
    parser.add_argument("--processes", type=int, default=5)
    parser.add_argument("--frames", type=int, default=11)
    parser.add_argument("--size", type=int, default=1024)
    given = parser.parse_args()
    if given.processes < FEWEST_PROCESSES:
        parser.error(
            f"--processes is {given.processes}, expected at least {FEWEST_PROCESSES}, so that ratios have intervals"
        )
    given.table.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.read_parquet(given.table) if given.table.exists() else pd.DataFrame()
    for measured in _measured(given):
        rows = pd.concat([rows, pd.DataFrame(measured)], ignore_index=True)
        rows.to_parquet(given.table, index=False)
    print(ratios(rows).to_string(index=False))


def _measured(given: Any) -> Iterator[list[dict[str, Any]]]:
    """The rows of each process."""
    here = Path(__file__).resolve().parents[1]
    python = "Scripts/python.exe" if os.name == "nt" else "bin/python"
    versions = {"other": (given.other, str(given.other.resolve() / ".venv" / python)), "this": (here, sys.executable)}
    commits = {name: _commit(folder) for name, (folder, _) in versions.items()}
    same = {"instruction_set": os.environ.get("ATRA_ISA", "native"), "frames": given.frames, "size": given.size}
    same["processor"] = read_environment().cpu
    with TemporaryDirectory() as folder:
        for name in given.scenes:
            scene = load_scene(SceneSource(given.source), name, None)
            kept = Path(folder, f"{name.replace('/', '_')}.npz")
            np.savez(kept, vertices=scene.mesh.vertices, faces=scene.mesh.faces)
            asked = {"scene": str(kept), "camera": scene.camera, "asked": given.asked, "frames": given.frames}
            asked["size"] = given.size
            same |= {"scene": name, "triangles": scene.mesh.triangle_count}
            for process in range(given.processes):
                for threads in given.threads:
                    order = ["other", "this"] if process % 2 else ["this", "other"]
                    for version in order:
                        source, runner = versions[version]
                        told = _told(runner, source, folder, {**asked, "threads": threads})
                        what_is_same = {**same, "threads": threads, "version": version, "process": process}
                        yield [
                            {
                                **what_is_same, "what": what, "digest": digest, "commit": commits[version],
                                "least_ms": min(taken_ms), "median_ms": float(np.median(taken_ms)),
                            }
                            for what, (taken_ms, digest) in told.items()
                        ]  # fmt: skip


def _told(python: str, source: Path, folder: str, asked: dict[str, Any]) -> dict[str, Any]:
    """What one process of a version prints. Exits with its error if it fails."""
    environment = os.environ | {"PYTHONPATH": str(source.resolve()), "ATRA_QUIET": "1"}
    run = subprocess.run(
        [python, "-c", _PROCESS, json.dumps(asked)], cwd=folder, env=environment, capture_output=True, text=True
    )
    if run.returncode:
        raise SystemExit(f"the version in {source} failed: {run.stderr[-2000:]}")
    return dict(json.loads(run.stdout))


def _commit(folder: Path) -> str:
    told = subprocess.run(["git", "-C", str(folder), "rev-parse", "--short=12", "HEAD"], capture_output=True, text=True)
    return told.stdout.strip()


def ratios(rows: pd.DataFrame) -> pd.DataFrame:
    """How many times as fast this version is, by what was asked: mean ratio of the medians of the processes that took
    turns, with its 95 % interval; the ratio of the least times; and whether all images are equal."""
    keys, found = ["instruction_set", "threads", "what", "scene"], []
    for key, group in rows.groupby(keys, sort=True):
        paired = group.pivot_table(index="process", columns="version", values=["median_ms", "least_ms"])
        if paired.shape[1] < 4:
            continue
        estimate = Estimate.of(list(paired["median_ms", "other"] / paired["median_ms", "this"]))
        least = paired["least_ms"].min()
        found.append({
            **dict(zip(keys, key, strict=True)), "this_ms": round(least["this"], 3),
            "ratio": f"{estimate.value:.3f} [{estimate.low:.3f}, {estimate.high:.3f}]",
            "ratio_of_least": round(least["other"] / least["this"], 3),
            "same": "yes" if group["digest"].nunique() == 1 else "no",
        })  # fmt: skip
    return pd.DataFrame(found)


if __name__ == "__main__":
    main()
