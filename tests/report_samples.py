"""Contents of a made-up report: a table as large as the paper's sweep, figures, pictures, claims, a machine."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image

from experiments.methods import METHODS, find_method
from experiments.report import ReportContents, ReportFigure, ScenePictures
from experiments.results.claims import JudgedClaim
from experiments.results.table import columns, rows_of
from experiments.workloads import WORKLOADS, find_workload

HOSTILE = "<script>document.title='taken over'</script>"
POWERS = [2**power for power in range(11)]
SCENES = {"cornell_box": (1112, None), "material_ball": (61600, "mitsuba"), "atrium": (262267, "sponza")}
STATISTICS = ("", "_q1", "_q3", "_low", "_high")

ENVIRONMENT: dict[str, Any] = {
    "cpu": "Some processor", "cpu_extensions": ["sse4.2", "avx2"], "instruction_set": None, "physical_cores": 2,
    "logical_cores": 4,
    "affinity": [0, 1], "machine": "x86_64", "system": "Linux", "python_version": "3.11.7", "embree_version": "4.4.0",
    "numba_version": "0.68.1", "governor": None, "load_average": [0.5, 0.25, 0.1], "memory_total_bytes": 2**34,
    "git_commit": "0123456789abcdef0123", "git_dirty": True, "taken_at": "2000-01-01T10:00:00+00:00",
}  # fmt: skip


CLAIMS = (
    JudgedClaim("one_axis", "§4.1", "Splitting one axis beats splitting both.", "one axis", "ratio of the best times",
          "holds", "1.31", "[1.25, 1.36]", None),
    JudgedClaim("best", "§4.2", "The best speed-up on the Cornell box is 7.50.", "7.50",
          "largest speed-up of single rays",
          "does not hold", "1.52", "[1.50, 1.55]", "single rays spend their time in the filter, which packets share"),
    JudgedClaim("memory", "§4.4", "Memory is little affected up to 16 to 64 splits.", "16 to 64",
            "bytes at 16 splits over 1", "not measured", "-", None, "no memory rows"),
)  # fmt: skip


def small_table() -> pd.DataFrame:
    """Eight rows: two doubtful, one skipped, one failed with an error and a scene of angle brackets and line breaks."""
    rows = [
        _time_row("cornell_box", split, random, render_time_s=time)
        for split, time, random in zip((1, 2, 4, 8), (0.05, 0.009, 0.1, 0.02), _randoms(), strict=False)
    ]
    rows[0]["doubts"] = "spread is 12% of the median; shortest sample is below 1 ms"
    rows[1]["doubts"] = "spread is 31% of the median"
    rows[1] |= {"speedup": 20.5, "speedup_low": 20.25, "speedup_high": 20.75, "pixels_wrong": 3}
    # A number whose shortest text differs between languages.
    rows[2]["plan_time_s"] = 1.5e-7
    stand_in = _time_row("material_ball", 2, np.random.default_rng(9), packet_width=1)
    skipped = _row("cornell_box", split_x=16, status="skipped", error="needs 9.5 GiB, the budget is 4 GiB")
    hostile = _row(HOSTILE, split_x=2, status="failed", error=f'said "no",\r\nthen {HOSTILE} & more')
    memory = _row("cornell_box", workload="memory", grids="memory", rss_bytes=2**30, peak_rss_bytes=2**30 + 1)
    rows += [stand_in, skipped, hostile, memory]
    return table_of([row | {"point_id": f"{place:020x}"} for place, row in enumerate(rows)])


def paper_sized_table(row_count: int = 550) -> pd.DataFrame:
    """As many rows as the paper's sweep, no number twice: as hard to compress as a real one."""
    rows = [row for row, _ in zip(_endless_rows(), range(row_count), strict=False)]
    return table_of(rows)


def _endless_rows() -> Iterator[dict[str, Any]]:
    random = np.random.default_rng(5)
    while True:
        for scene in SCENES:
            for split, culling, width in product(POWERS, (False, True), (1, 8)):
                if not culling and split == POWERS[-1] and scene == "atrium":
                    yield _row(scene, split_x=split, status="skipped", error="needs 12.5 GiB, the budget is 4 GiB")
                else:
                    row = _time_row(scene, split, random, packet_width=width)
                    yield row | {"culling": culling, "doubts": _some_doubts(random)}
            for x, y in product((1, 2, 4, 8, 16), repeat=2):
                yield _time_row(scene, x, random, packet_width=1) | {"split_y": y, "grids": "grid"}
            for split, geometry in product(POWERS, ("copied", "instanced")):
                yield _build_row(scene, split, random) | {"geometry": geometry}
                yield _memory_row(scene, split, random) | {"geometry": geometry}


def _some_doubts(random: np.random.Generator) -> str | None:
    return f"spread is {random.integers(10, 60)}% of the median" if random.random() < 0.3 else None


def _randoms() -> Iterator[np.random.Generator]:
    return (np.random.default_rng(seed) for seed in range(100))


def _row(scene: str, **fields: Any) -> dict[str, Any]:
    triangles, stands_for = SCENES.get(scene, (10, None))
    return {
        "scene": scene, "triangles": triangles, "stands_for": stands_for, "width": 1024, "height": 1024, "split_x": 1,
        "split_y": 1, "culling": True, "method": "aligned", "packet_width": 8, "threads": 1, "workload": "frame",
        "geometry": "copied", "build_quality": "medium", "grids": "horizontal", "status": "ok", "cpu": "Some processor",
        "measured_at": "2000-01-01T10:00:00+00:00",
    } | fields  # fmt: skip


def _time_row(
    scene: str, split_x: int, random: np.random.Generator, render_time_s: float | None = None, packet_width: int = 8
) -> dict[str, Any]:
    time = float(0.3 * split_x**-0.4 * random.uniform(0.9, 1.1)) if render_time_s is None else render_time_s
    measured: dict[str, Any] = {}
    names = ("render_time{}_s", "baseline_render_time{}_s", "packets_render_time{}_s", "speedup{}",
             "speedup_vs_packets{}")  # fmt: skip
    for name, middle in zip(names, (time, 0.15, 0.06, 0.15 / time, 0.06 / time), strict=True):
        for suffix, factor in zip(STATISTICS, (1, 0.97, 1.03, 0.95, 1.06), strict=True):
            measured[name.format(suffix)] = float(middle * factor * random.uniform(0.999, 1.001))
    measured["render_time_s"] = time
    return _row(
        scene, split_x=split_x, packet_width=packet_width, triangles_traced=int(random.integers(1e3, 1e6)),
        plan_time_s=random.random(), build_time_s=random.random(), baseline_build_time_s=random.random(),
        rss_start_bytes=int(random.integers(1e8, 2e8)), rss_mesh_bytes=int(random.integers(1e8, 2e8)),
        rss_bytes=int(random.integers(1e8, 2e9)), peak_rss_bytes=int(random.integers(1e8, 2e9)),
        embree_bytes=int(random.integers(1e6, 1e9)), pixels_equal=1048576, pixels_tied=0, pixels_edge=0,
        pixels_wrong=0, rounds=9, render_time_spread_s=random.random(), packets_width=8, load_average=random.random(),
        point_id=random.bytes(10).hex(), **measured,
    )  # fmt: skip


def _build_row(scene: str, split_x: int, random: np.random.Generator) -> dict[str, Any]:
    names = ("plan_time{}_s", "build_time{}_s", "baseline_build_time{}_s")
    times = {name.format(suffix): random.random() * split_x**0.5 for name in names for suffix in STATISTICS}
    return _row(scene, split_x=split_x, workload="build", grids="build", rounds=9, point_id=random.bytes(10).hex(),
                **times)  # fmt: skip


def _memory_row(scene: str, split_x: int, random: np.random.Generator) -> dict[str, Any]:
    names = ("rss_start_bytes", "rss_mesh_bytes", "rss_bytes", "peak_rss_bytes", "embree_bytes", "triangles_traced")
    return _row(scene, split_x=split_x, workload="memory", grids="memory", point_id=random.bytes(10).hex(),
                **{name: int(random.integers(1e8, 2e9)) for name in names})  # fmt: skip


def table_of(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """A table of these rows; as in one of records, a row has no option that its method or workload has not."""
    known = columns()
    unknown = {name for row in rows for name in row} - set(known)
    assert not unknown, unknown
    options = {name for kind in (*METHODS, *WORKLOADS) for name in kind.options.__dataclass_fields__}
    own = []
    for row in rows:
        kinds = (find_method(row["method"]), find_workload(row["workload"]))
        has = {name for kind in kinds for name in kind.options.__dataclass_fields__}
        own.append({name: value for name, value in row.items() if name in has or name not in options})
    return pd.DataFrame(
        {name: pd.array([row.get(name) for row in own], dtype=one.dtype) for name, one in known.items()}
    )


def png(image: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG")
    return buffer.getvalue()


def shaded(edge: int = 1024, seed: int = 0) -> np.ndarray:
    """(edge, edge, 3): facets of many shades, about as busy as a picture of a room."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:edge, :edge] / edge
    image = np.full((edge, edge), 0.5)
    for _ in range(40):
        normal, offset = random.normal(size=2), random.uniform(-0.3, 1.2)
        image[(normal[0] * x + normal[1] * y) > offset] *= random.uniform(0.8, 1.2)
    grey = np.clip(image * 255 * (0.9 + 0.1 * y), 0, 255)
    return (grey[..., None] * [1.0, 0.95, 0.88]).astype(np.uint8)


def scene_pictures(scene: str = "cornell_box", edge: int = 1024, seed: int = 0, **fields: Any) -> ScenePictures:
    """Two pictures that differ in two pixels far apart."""
    aligned = shaded(edge, seed)
    pixel, difference = aligned.copy(), np.zeros_like(aligned)
    for place in ((edge // 8, edge // 4), (edge // 2 + 1, edge // 2 + 3)):
        pixel[place] = 255 - pixel[place]
        difference[place] = (255, 170, 0)
    values: dict[str, Any] = {
        "title": scene.replace("_", " "), "pixels_equal": edge * edge - 2, "pixels_tied": 2, "pixels_edge": 0,
        "pixels_wrong": 0,
    }  # fmt: skip
    return ScenePictures(scene, aligned=png(aligned), pixel=png(pixel), difference=png(difference), **values | fields)


SVG = (
    b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 300">'
    b'<rect width="600" height="300" fill="white"/><path d="M50 250 L550 50" stroke="black"/></svg>'
)


def small_contents(**fields: Any) -> ReportContents:
    table = small_table()
    times, memory = (frozenset(rows_of(table, grid)["point_id"]) for grid in ("horizontal", "memory"))
    values: dict[str, Any] = {
        "title": "The paper on this machine", "command": "python run.py sweep=paper", "table": table,
        "figures": (
            ReportFigure("figure5", "Frame time over horizontal splits.", SVG, times),
            ReportFigure("figure7", "Memory over horizontal splits.", png(shaded(64)), memory),
        ),
        "pictures": (
            scene_pictures(edge=64),
            scene_pictures("mitsuba", edge=16, withheld="its licence forbids passing on pictures of it"),
        ),
        "claims": CLAIMS, "environment": ENVIRONMENT,
    }  # fmt: skip
    return ReportContents(**values | fields)
