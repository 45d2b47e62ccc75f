"""What is shown of disagreements: lines, a list and pictures of them, and a figure of who is wrong by float64."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator
from numpy.typing import NDArray

from atra.files.paths import write_atomically
from atra.judge.compare import Verdict
from atra.judge.marks import mark_verdicts
from experiments.drawing.axes import tidy_axis
from experiments.drawing.pages import write_notes
from experiments.drawing.shading import encode_png
from experiments.drawing.style import BLACK, BLUE, GREY, SMALL, TIMES
from experiments.drawing.values import column, numbers
from experiments.harness.records import load_record
from experiments.methods.naming import say_kind
from experiments.results.settings import settings
from experiments.results.table import csv_bytes
from experiments.workloads.agreement import AGREEMENT
from experiments.workloads.images import HOLES, say_holes
from experiments.workloads.panels import make_panels, panels_figure, workload_figure
from experiments.workloads.series import say_unmeasured

LIST_FILE = "disagreements.csv"
FILES = (re.escape(LIST_FILE), r"disagreements_.+_\d+x\d+(_.+_degrees)?\.png")

TARGET = 2
"""A method may err this many times as often as rtcIntersect1 itself."""

_POINT = (
    "scene", "stands_for", "view", "fov_y_degrees", "width", "height", "method", "geometry", "culling", "split_x",
    "split_y", "packet_width",
)  # fmt: skip
_IMAGE = ("scene", "view", "fov_y_degrees", "width", "height")
_CODES = {kind.name.lower(): kind.value for kind in Verdict}
_PRIM_IDS = ("truth_prim_id", "method_prim_id", "baseline_prim_id")
_RIGHT = ("right", "tied")
_WHO = np.array(["neither", "method", "baseline", "both"])


def agreement_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of agreement that were measured."""
    return table[(table["workload"] == AGREEMENT.name) & (table["status"] == "ok")]


def errs_too_often(rows: pd.DataFrame) -> bool:
    """Whether the method is wrong more than TARGET times as often as rtcIntersect1, where the two differ."""
    return bool(rows["method_wrong"].sum() > TARGET * rows["baseline_wrong"].sum())


def read_disagreements(table: pd.DataFrame, records: Path) -> pd.DataFrame:
    """One row for every pixel where a method and rtcIntersect1 differ or the oracle found one of them wrong.

    After the point's columns: offset_x, offset_y, x, y: the ray. verdict: of `atra.judge.compare`. sampled: part of the
    point's sample. wrong: method, baseline, both or neither. truth_*, method_*, baseline_*: triangle, depth in float64
    and barycentric distance from the edge (negative: outside); for method and baseline also the fields of
    `oracle.Answer`. An empty field is a miss, or infinite. records: the folder of the records.
    """
    parts = []
    for _, row in agreement_rows(table).iterrows():
        record = load_record(records, row["point_id"])
        if record is None or not record.results["disagreements"]["x"]:
            continue
        listed = pd.DataFrame(record.results["disagreements"])
        wrong = [(~listed[f"{name}_correctness"].isin(_RIGHT)).to_numpy(np.intp) for name in ("method", "baseline")]
        listed.insert(listed.columns.get_loc("verdict") + 1, "wrong", _WHO[wrong[0] + 2 * wrong[1]])
        for name in _PRIM_IDS:
            listed[name] = listed[name].astype("Int64")
        for place, name in enumerate(_POINT):
            listed.insert(place, name, row[name])
        parts.append(listed)
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*_POINT, "x", "y", "verdict"])


def write(folder: Path, records: Path, table: pd.DataFrame) -> None:
    """The list, and for each scene and size of image a picture of where the images of any point differ; nothing for a
    table without agreement."""
    rows = agreement_rows(table)
    if len(rows) == 0:
        return
    listed = read_disagreements(table, records)
    write_atomically(folder / LIST_FILE, csv_bytes(listed))
    images = rows[list(_IMAGE)].drop_duplicates()
    for image in images.to_dict("records"):
        of_image, alike = listed, images
        for name, value in image.items():
            of_image = of_image[of_image[name].eq(value)]
            alike = alike if name == "fov_y_degrees" else alike[alike[name].eq(value)]
        picture = encode_png(mark_verdicts(_gravest(of_image, int(image["width"]), int(image["height"]))))
        words = [image["scene"], image["view"] if image["view"] != "own" else "", f"{image['width']}x{image['height']}"]
        words.append(f"{image['fov_y_degrees']:g}_degrees" if len(alike) > 1 else "")
        # A scene of the user's own may have any name.
        file = re.sub(r"[^\w.-]", "_", "_".join(["disagreements", *filter(None, words)]))
        write_atomically(folder / f"{file}.png", picture)


def _gravest(rows: pd.DataFrame, width: int, height: int) -> NDArray[np.uint8]:
    """(H, W) uint8, of each pixel the gravest verdict of any point and offset."""
    verdict = np.zeros((height, width), np.uint8)
    place = rows["y"].to_numpy(np.intp), rows["x"].to_numpy(np.intp)
    np.maximum.at(verdict, place, rows["verdict"].map(_CODES).to_numpy(np.uint8))
    return verdict


_COUNTS = (
    *(f"pixels_{kind.name.lower()}" for kind in Verdict), "images", "method_wrong", "baseline_wrong", "rays_sampled",
    "sampled_method_wrong", "sampled_baseline_wrong",
)  # fmt: skip


def sweep_lines(rows: pd.DataFrame) -> Iterator[str]:
    """One line a scene: the verdicts, who erred how often, and which methods miss the target. rows: those measured."""
    for scene, of_scene in rows.groupby("scene", sort=False):
        total = {name: int(of_scene[name].sum()) for name in _COUNTS}
        holes = say_holes({name: column(of_scene, name).sum() for name in HOLES})
        beyond = [
            f"{kind} {one['method_wrong'].sum():,} against {one['baseline_wrong'].sum():,}"
            for kind, one in of_scene.groupby(of_scene.apply(say_kind, axis=1), sort=False)
            if errs_too_often(one)
        ]
        often = (
            f"more than {TARGET} times as often: {'; '.join(beyond)}" if beyond else f"no method over {TARGET} times"
        )
        pixels = sum(total[f"pixels_{kind.name.lower()}"] for kind in Verdict)
        yield (
            f"{scene}: {pixels:,} pixels in {total['images']:,} images, {total['pixels_wrong']:,} wrong{holes}, "
            f"{total['pixels_edge']:,} edge, {total['pixels_tied']:,} tied; by float64 methods err at "
            f"{total['method_wrong']:,} of these, rtcIntersect1 at {total['baseline_wrong']:,}, {often}; "
            f"of {total['rays_sampled']:,} sampled rays at {total['sampled_method_wrong']:,} and "
            f"{total['sampled_baseline_wrong']:,}"
        )


_SERIES = {"method": ("method_wrong", BLUE), "rtcIntersect1": ("baseline_wrong", BLACK)}
"""Label -> column and colour, from the top down."""

_BAR = 0.2


def draw_agreement_figure(table: pd.DataFrame, columns: int = 2) -> Figure:
    """One panel a scene, one pair of bars a method: pixels at which it and rtcIntersect1 are wrong by the oracle.

    Counts pixels where the two differ, over all splits, offsets and image sizes. The axis is linear from 0 to 1 and
    logarithmic beyond.
    """
    panels = make_panels(table, settings())
    tallest = max((panel.rows.apply(say_kind, axis=1).nunique() for panel in panels), default=1)
    images = int(numbers(table, "images")[column(table, "images").notna().to_numpy(bool)].sum())
    foot = f"{images:,} images, every pixel compared; wrong by float64 where the images differ"
    return panels_figure(panels, _draw_panel, columns, table, foot, legend=list(_SERIES), height=1.6 + 0.65 * tallest)


def _draw_panel(axis: Axes, rows: pd.DataFrame) -> None:
    notes, kinds = [], rows.apply(say_kind, axis=1)
    names = list(dict.fromkeys(kinds))
    counted = rows["status"].eq("ok") & column(rows, "method_wrong").notna() & column(rows, "baseline_wrong").notna()
    highest = 1
    for place, name in enumerate(names):
        notes += say_unmeasured(rows[kinds == name], name)
        of_kind = rows[(kinds == name) & counted]
        if len(of_kind) == 0:
            _write(axis, place, f"{name}: not measured", GREY)
            continue
        counts = {label: int(of_kind[source].sum()) for label, (source, _) in _SERIES.items()}
        for offset, (label, (_, color)) in zip((-0.5, 0.5), _SERIES.items(), strict=True):
            axis.barh(place + 0.25 + offset * _BAR, counts[label], height=_BAR, color=color, label=label, zorder=2)
        highest = max(highest, *counts.values())
        _write(axis, place, f"{name}: {_say(of_kind, counts)}", BLACK)
    axis.set_yticks([])
    axis.set_ylim(max(len(names), 1) - 0.5, -0.5)
    _finish(axis, highest)
    sampled = rows[counted]
    if len(sampled):
        wrong = " and ".join(f"{sampled[f'sampled_{who}_wrong'].sum():,}" for who in ("method", "baseline"))
        notes.append(
            f"of {sampled['rays_sampled'].sum():,} rays drawn from all pixels and tested with every triangle, the "
            f"methods and rtcIntersect1 are wrong at {wrong}"
        )
    write_notes(axis, notes)


def _say(rows: pd.DataFrame, counts: dict[str, int]) -> str:
    verdicts = {kind: int(rows[f"pixels_{kind.name.lower()}"].sum()) for kind in Verdict}
    told = ", ".join(f"{verdicts[kind]:,} {kind.name.lower()}" for kind in (Verdict.WRONG, Verdict.EDGE, Verdict.TIED))
    told = told.replace(" wrong", f" wrong{say_holes({name: column(rows, name).sum() for name in HOLES})}", 1)
    beyond = f", over {TARGET}{TIMES}" if errs_too_often(rows) else ""
    method, baseline = counts.values()
    return f"{method:,} : {baseline:,}{beyond}\nof {sum(verdicts.values()) / 1e6:.3g} M pixels; {told}"


def _write(axis: Axes, place: int, text: str, color: str) -> None:
    axis.text(
        0, place - 0.18, text, transform=axis.get_yaxis_transform(), va="center", fontsize=SMALL, color=color, zorder=4,
        bbox={"boxstyle": "square,pad=0", "facecolor": "white", "edgecolor": "none", "alpha": 0.85},
    )  # fmt: skip


def _finish(axis: Axes, highest: int) -> None:
    axis.set_xscale("symlog", linthresh=1, linscale=0.4)
    ticks = [0, *(10**power for power in range(len(str(highest)) + 1) if 10**power <= 10 * highest)]
    axis.set_xticks(ticks)
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.0f}"))
    axis.xaxis.set_minor_locator(NullLocator())
    axis.set_xlim(0, 1.2 * highest)
    axis.set_xlabel("pixels")
    tidy_axis(axis, "x", frame=("bottom",))


FIGURES = (
    workload_figure(
        "agreement", "Who is wrong, by float64, where a method and single rays per pixel differ", AGREEMENT,
        draw_agreement_figure,
    ),
)  # fmt: skip
