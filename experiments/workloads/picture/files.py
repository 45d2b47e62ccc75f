"""The pictures of a point, out of its record: as files, and for figures."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from atra.files.paths import write_atomically
from experiments.harness.records import Record, load_record
from experiments.workloads.baselines import SINGLE
from experiments.workloads.images import PIXELS
from experiments.workloads.picture import PICTURE


def write(folder: Path, record: Record) -> list[Path]:
    """`<scene>_<method>.png`, `<scene>_rtcIntersect1.png` and `<scene>_difference.png` in `folder`, made if missing;
    returns their paths. Raises StorageError."""
    scene, method = (record.configuration[name] for name in ("scene", "method"))
    written = []
    for name, picture in zip((method, SINGLE, "difference"), record.results["pictures"].values(), strict=True):
        path = folder / f"{scene}_{name}.png"
        write_atomically(path, base64.b64decode(picture))
        written.append(path)
    return written


@dataclass(frozen=True)
class ScenePictures:
    """One scene, shaded from the hits of the aligned method and of rtcIntersect1, and where they differ.

    stands_for: the paper's scene that this replaces. pixels_*: counts of verdicts. aligned, pixel, difference: PNGs.
    """

    scene: str
    triangles: int
    stands_for: str | None
    width: int
    height: int
    pixels_equal: int
    pixels_tied: int
    pixels_edge: int
    pixels_wrong: int
    aligned: bytes
    pixel: bytes
    difference: bytes


KEPT = "pictures"
"""Folder beside a kept table that holds its pictures as `<scene>_aligned.png` and the like, where records are gone."""


def read_pictures(table: pd.DataFrame, folder: Path) -> list[ScenePictures]:
    """The pictures of the table's rows that have some, in its order. folder: of the sweep; `records` is beside it."""
    pictures = []
    for _, row in table[(table["workload"] == PICTURE.name) & (table["status"] == "ok")].iterrows():
        images = _of_record(folder.parent / "records", row["point_id"]) or _kept(folder / KEPT, str(row["scene"]))
        if images is None:
            continue
        numbers: dict[str, Any] = {name: int(row[name]) for name in ("triangles", "width", "height", *PIXELS)}
        stands_for = None if pd.isna(row["stands_for"]) else str(row["stands_for"])
        pictures.append(ScenePictures(scene=str(row["scene"]), stands_for=stands_for, **numbers, **images))
    return pictures


def _of_record(records: Path, point_id: str) -> dict[str, Any] | None:
    record = load_record(records, point_id)
    if record is None:
        return None
    return {name: base64.b64decode(text) for name, text in record.results["pictures"].items()}


def _kept(folder: Path, scene: str) -> dict[str, Any] | None:
    paths = {name: folder / f"{scene}_{name}.png" for name in ("aligned", "pixel", "difference")}
    are_kept = all(path.exists() for path in paths.values())
    return {name: path.read_bytes() for name, path in paths.items()} if are_kept else None
