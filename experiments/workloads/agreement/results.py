"""Files of the oracle's results: a list of all disagreements, and a picture of them for each scene."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from atra.files.paths import write_atomically
from atra.judge.compare import Verdict
from experiments.drawing.shading import encode_png, mark_verdicts
from experiments.harness.records import load_record
from experiments.results.table import csv_bytes
from experiments.workloads.agreement import AGREEMENT

LIST_FILE = "disagreements.csv"

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
    `atra.judge.oracle.Answer`. An empty field is a miss, or infinite. records: the folder of the records.
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
