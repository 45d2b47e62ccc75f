"""What is shown of disagreements: lines, a list and pictures of them, and a figure of who is wrong by float64."""

from __future__ import annotations

import re
from collections.abc import Iterator
from math import nan
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.files.paths import write_atomically
from atra.files.saving import encode_png
from atra.judge.compare import Verdict
from atra.judge.marks import mark_verdicts
from experiments.drawing.figure import Axis, Bar, Figure, Panel
from experiments.drawing.style import BLACK, BLUE, GREY, TIMES
from experiments.drawing.values import column, numbers
from experiments.harness.records import load_record
from experiments.methods.naming import say_kind
from experiments.results.settings import settings
from experiments.results.table import csv_bytes
from experiments.workloads.agreement import AGREEMENT
from experiments.workloads.images import HOLES, say_holes
from experiments.workloads.panels import figure_of, make_panels, read_panels, workload_figure
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
            f"{kind} {of_kind['method_wrong'].sum():,} against {of_kind['baseline_wrong'].sum():,}"
            for kind, of_kind in of_scene.groupby(of_scene.apply(say_kind, axis=1), sort=False)
            if errs_too_often(of_kind)
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


def agreement_figure(table: pd.DataFrame) -> Figure:
    """One panel a scene, two bars a method: pixels at which it and rtcIntersect1 are wrong by the oracle.

    Counts pixels where the two differ, over all splits, offsets and image sizes. The axis is linear from 0 to 1 and
    logarithmic beyond.
    """
    images = int(numbers(table, "images")[column(table, "images").notna().to_numpy(bool)].sum())
    note = f"{images:,} images, every pixel compared; wrong by float64 where the images differ"
    return figure_of(
        "bars", read_panels(make_panels(table, settings()), _panel), table, note,
        x=Axis("pixels", "counts", "{:,.0f}".format), legend=list(_SERIES),
        headings=("", "wrong: the method, and rtcIntersect1"),
    )  # fmt: skip


def _panel(rows: pd.DataFrame) -> Panel:
    bars, notes, kinds = [], [], rows.apply(say_kind, axis=1)
    counted = rows["status"].eq("ok") & column(rows, "method_wrong").notna() & column(rows, "baseline_wrong").notna()
    for name in dict.fromkeys(kinds):
        notes += say_unmeasured(rows[kinds == name], name)
        of_kind = rows[(kinds == name) & counted]
        if len(of_kind) == 0:
            bars.append(Bar(name, nan, nan, nan, GREY, "not measured"))
            continue
        counts = {label: int(of_kind[source].sum()) for label, (source, _) in _SERIES.items()}
        for label, (_, color) in _SERIES.items():
            is_first = label == next(iter(_SERIES))
            told = (name, _say(of_kind, counts)) if is_first else ("", "")
            bars.append(Bar(told[0], counts[label], nan, nan, color, told[1], series=label))
    sampled = rows[counted]
    if len(sampled):
        wrong = " and ".join(f"{sampled[f'sampled_{who}_wrong'].sum():,}" for who in ("method", "baseline"))
        notes.append(
            f"of {sampled['rays_sampled'].sum():,} rays drawn from all pixels and tested with every triangle, the "
            f"methods and rtcIntersect1 are wrong at {wrong}"
        )
    return Panel(bars=bars, notes=notes)


def _say(rows: pd.DataFrame, counts: dict[str, int]) -> str:
    verdicts = {kind: int(rows[f"pixels_{kind.name.lower()}"].sum()) for kind in Verdict}
    told = ", ".join(f"{verdicts[kind]:,} {kind.name.lower()}" for kind in (Verdict.WRONG, Verdict.EDGE, Verdict.TIED))
    told = told.replace(" wrong", f" wrong{say_holes({name: column(rows, name).sum() for name in HOLES})}", 1)
    beyond = f", over {TARGET}{TIMES}" if errs_too_often(rows) else ""
    method, baseline = counts.values()
    return f"{method:,} : {baseline:,}{beyond} of {sum(verdicts.values()) / 1e6:.3g} M pixels; {told}"


FIGURES = (
    workload_figure(
        "agreement", "Who is wrong, by float64, where a method and single rays per pixel differ", AGREEMENT,
        agreement_figure,
    ),
)  # fmt: skip
