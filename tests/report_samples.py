"""Contents of a made-up report: a small table, figures, pictures, claims, a machine."""

from dataclasses import replace

import numpy as np

from atra.files.saving import encode_png
from experiments.drawing.figure import Axis, Figure, Line, NamedFigure, Panel
from experiments.methods import METHODS, find_method
from experiments.report import ReportContents
from experiments.results.claims import JudgedClaim
from experiments.results.table import columns, frame_of, rows_of, table_files
from experiments.workloads import WORKLOADS, find_workload
from experiments.workloads.picture.files import ScenePictures

HOSTILE = "<script>document.title='taken over'</script>"
SCENES = {"cornell_box": (1112, None), "material_ball": (61600, "mitsuba")}

ENVIRONMENT = {
    "cpu": "Some processor", "cpu_extensions": ["sse4.2", "avx2"], "instruction_set": None, "logical_cores": 4,
    "system": "Linux", "python_version": "3.11.7", "embree_version": "4.4.0", "load_average": [0.5, 0.25, 0.1],
    "memory_total_bytes": 2**34, "git_commit": "0123456789abcdef0123", "git_dirty": True,
}  # fmt: skip


CLAIMS = (
    JudgedClaim("one_axis", "§4.1", "Splitting one axis beats splitting both.", "one axis", "ratio of the best times",
          False, "", "holds", "1.31", "[1.25, 1.36]", None),
    JudgedClaim("best", "§4.2", "The best speed-up on the Cornell box is 7.50.", "7.50",
          "largest speed-up of single rays", False, "nearest hit",
          "does not hold", "1.52", "[1.50, 1.55]", "single rays spend their time in the filter, which packets share"),
    JudgedClaim("best", "§4.2", "The best speed-up on the Cornell box is 7.50.", "7.50",
          "largest speed-up of single rays", False, "all hits", "holds", "7.61", "[7.55, 7.68]", None),
    JudgedClaim("memory", "§4.4", "Memory is little affected up to 16 to 64 splits.", "16 to 64",
            "bytes at 16 splits over 1", True, "", "not measured", "-", None, "no memory rows"),
)  # fmt: skip


def small_table():
    """Eight rows: two flagged, one skipped, one failed with an error and a scene of angle brackets and line breaks."""
    times = zip((1, 2, 4, 8), (0.05, 0.009, 0.1, 0.02), strict=True)
    rows = [_time_row("cornell_box", split, time) for split, time in times]
    rows[0]["warnings"] = "spread is 12% of the median; shortest sample is below 1 ms"
    rows[1]["warnings"] = "spread is 31% of the median"
    rows[1] |= {"speedup": 20.5, "speedup_low": 20.25, "speedup_high": 20.75, "pixels_wrong": 3}
    rows[2]["plan_time_s"] = 1.5e-7
    stand_in = _time_row("material_ball", 2, 0.25, packet_width=1)
    skipped = _row("cornell_box", split_x=16, status="skipped", error="needs 9.5 GiB, the budget is 4 GiB")
    hostile = _row(HOSTILE, split_x=2, status="failed", error=f'said "no",\r\nthen {HOSTILE} & more')
    memory = _row("cornell_box", workload="memory", grids="memory", rss_bytes=2**30, peak_rss_bytes=2**30 + 1)
    rows += [stand_in, skipped, hostile, memory]
    return table_of([row | {"point_id": f"{place:020x}"} for place, row in enumerate(rows)])


def _row(scene, **fields):
    triangles, stands_for = SCENES.get(scene, (10, None))
    return {
        "scene": scene, "triangles": triangles, "stands_for": stands_for, "width": 1024, "height": 1024, "split_x": 1,
        "split_y": 1, "culling": True, "method": "aligned", "packet_width": 8, "threads": 1, "workload": "frame",
        "geometry": "copied", "build_quality": "medium", "grids": "horizontal", "status": "ok", "cpu": "Some processor",
        "measured_at": "2000-01-01T10:00:00+00:00",
    } | fields  # fmt: skip


def _time_row(scene, split_x, time_s, packet_width=8):
    measured = {}
    medians = {"render_time{}_s": time_s, "speedup{}": 0.15 / time_s, "speedup_vs_packets{}": 0.06 / time_s}
    for name, median in medians.items():
        for end, factor in (("", 1), ("_low", 0.95), ("_high", 1.06)):
            measured[name.format(end)] = median * factor
    return _row(
        scene, split_x=split_x, packet_width=packet_width, triangles_traced=1234567, plan_time_s=0.5,
        rss_bytes=3 * 2**20, pixels_equal=1048576, pixels_tied=0, pixels_edge=0, pixels_wrong=0, **measured,
    )  # fmt: skip


def write_tables(folder, tables):
    """The files of a sweep's tables, in a folder that may be new."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in table_files(tables).items():
        (folder / name).write_bytes(content)


def table_of(rows):
    """A table of these rows; as in one of records, a row has no option that its method or workload has not."""
    unknown = {name for row in rows for name in row} - set(columns())
    assert not unknown, unknown
    options = {name for kind in (*METHODS, *WORKLOADS) for name in kind.options.__dataclass_fields__}
    own = []
    for row in rows:
        kinds = (find_method(row["method"]), find_workload(row["workload"]))
        has = {name for kind in kinds for name in kind.options.__dataclass_fields__}
        own.append({name: value for name, value in row.items() if name in has or name not in options})
    return frame_of(own)


def scene_pictures(scene="cornell_box", **fields):
    """Pictures of 16 x 16 pixels that differ in two."""
    images = {name: encode_png(np.full((16, 16, 3), tone, np.uint8)) for name, tone in _TONES.items()}
    values = {
        "triangles": 1112, "stands_for": None, "width": 16, "height": 16, "pixels_equal": 254, "pixels_tied": 2,
        "pixels_edge": 0, "pixels_wrong": 0,
    }  # fmt: skip
    return ScenePictures(**{"scene": scene, **values, **images, **fields})


_TONES = {"aligned": 90, "pixel": 120, "difference": 255}


def drawn_figure(name, caption, *point_ids):
    line = Line("one", np.array([1.0, 2.0]), np.array([3.0, 2.0]), {"color": "#123456"})
    panels = [Panel(title, lines=[line], notes=[f"a note on {name}"]) for title in ("left", "right")]
    figure = Figure("lines", panels, x=Axis("splits"), y=Axis("ms"), notes=["three processes"])
    return NamedFigure(name, caption, figure, frozenset(point_ids))


def small_contents(**fields):
    """Whose second scene's pictures must not be passed on."""
    table = small_table()
    times, memory = (rows_of(table, grid)["point_id"] for grid in ("horizontal", "memory"))
    values = {
        "title": "The paper on this machine", "command": "python run.py sweep=paper", "table": table,
        "processes": table.assign(process=0),
        "figures": (
            drawn_figure("figure5", "Frame time over horizontal splits.", *times),
            drawn_figure("figure7", "Memory over horizontal splits.", *memory),
        ),
        "pictures": (scene_pictures(), scene_pictures("mitsuba")),
        "claims": CLAIMS, "environment": ENVIRONMENT,
    }  # fmt: skip
    return ReportContents(**values | fields)


def contents_that_say(text):
    """A report that has this text wherever a text of data may stand."""
    table = small_table()
    for name in ("scene", "error", "warnings", "cpu", "stands_for", "measured_at"):
        table[name] = (table[name].fillna("") + text).astype(table[name].dtype)
    said = dict.fromkeys(("text", "paper_value", "how", "value", "interval", "why"), text)
    return small_contents(
        title=text, command=text, table=table, processes=table, claims=(replace(CLAIMS[0], **said),),
        figures=(drawn_figure(text, f'"{text}', *table["point_id"]),),
        pictures=(scene_pictures(text, stands_for=text),), environment={"cpu": text, text: text},
    )  # fmt: skip
