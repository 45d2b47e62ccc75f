"""Looks at the measured views, and what is kept of measurements and looks, so that a fit needs no new ones.

    ATRA_ISA=avx2 python -m experiments.law.keep FOLDER reports/reference/law

FOLDER is that of `experiments.law.measure`. Looks at every view of the instruction set that was not looked at, then
writes measured.parquet and looks.parquet of all that lies in FOLDER.
"""

from __future__ import annotations

import json
import os
from argparse import ArgumentParser
from dataclasses import dataclass
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pandas as pd

from experiments.law.measure import VIEWS, mesh_and_camera
from experiments.law.model.choice import Choice, candidates
from experiments.law.model.constants import machine
from experiments.law.model.copying import Copied
from experiments.law.model.forecasting import forecast
from experiments.law.model.looking import Look, look_at

COUNTS = ("boxes", "tested", "met")

FIELDS = ("width", "height", "triangles", "vertices", "is_parallel", "hit", "raster_s", "raster_bytes",
          "bvh_bytes")  # fmt: skip


@dataclass(frozen=True)
class KeptLook:
    """A look, without its sample of triangles but with what was copied of it.

    look_s, plan_s: processor seconds of a look, and of a look with forecasts of all choices for the nearest hit.
    frame_s: of the look's raster frame at the same time; `look.raster_s` was measured beside the methods' times.
    """

    look: Look
    look_s: float
    plan_s: float
    frame_s: float


def choice_of(row: Any) -> Choice:
    """The choice of a measured row."""
    method = "instanced" if row["geometry"] == "instanced" else str(row["method"])
    culling = not (method in ("aligned", "instanced") and str(row["culling"]) == "False")
    return Choice(method, (int(row["split_x"]), int(row["split_y"])), int(row["packet_width"]), culling)


def told_of(look: Look, choices: list[Choice]) -> dict[str, Any]:
    """A look in plain values, and what is copied for each choice."""
    told = {name: getattr(look, name) for name in FIELDS}
    told |= {name: getattr(look, name).ravel().tolist() for name in COUNTS}
    keys = dict.fromkeys((one.method, one.split, one.culling) for one in choices)
    copied = [[*key, *look.copied(*key)] for key in keys]
    return {**told, "shapes": json.dumps(look.shapes), "copied": json.dumps(copied)}


def look_of(told: Any) -> Look:
    """What `told_of` told of; its sample is lost."""
    shapes = tuple(tuple(one) for one in json.loads(told["shapes"]))
    counts = [np.array(told[name], np.float64).reshape(len(shapes), 2, -1) for name in COUNTS]
    copied = {
        (method, tuple(split), culling): Copied(*numbers)
        for method, split, culling, *numbers in json.loads(told["copied"])
    }
    return Look(
        shapes=shapes, boxes=counts[0], tested=counts[1][..., 0], met=counts[2][..., 0],
        sample=None,  # type: ignore[arg-type]
        counted=copied, **{name: told[name] for name in FIELDS},
    )  # fmt: skip


def look_at_view(measured: Path, looked: Path) -> None:
    """Write a look at a measured view."""
    rows = pd.read_csv(measured, keep_default_na=False)
    first = rows.iloc[0]
    mesh, camera = mesh_and_camera(str(first["scene"]), str(first["view"]))
    look_at(mesh, camera)  # loads kernels
    start = thread_time()
    look = look_at(mesh, camera)
    look_s = thread_time() - start
    start, known = thread_time(), machine()
    again = look_at(mesh, camera)
    for choice in candidates(camera):
        forecast(again, choice, "nearest", known)
    told: dict[str, Any] = {name: str(first[name]) for name in ("instruction_set", "scene", "view")}
    told |= {"look_s": look_s, "plan_s": thread_time() - start, "frame_s": look.raster_s}
    told |= told_of(look, [choice_of(row) for row in rows.to_dict("records")])
    looked.write_text(json.dumps(told), encoding="utf-8")


def kept_looks(path: Path) -> dict[tuple[str, str, str], KeptLook]:
    """All looks, by instruction set, scene and view."""
    return {
        (row["instruction_set"], row["scene"], row["view"]): KeptLook(
            look_of(row), row["look_s"], row["plan_s"], row["frame_s"]
        )
        for row in pd.read_parquet(path).to_dict("records")
    }


def keep(folder: Path, kept: Path) -> None:
    """Write measured.parquet and looks.parquet of all views that were looked at."""
    looked = sorted(folder.glob("*.json"))
    rows = pd.concat([pd.read_csv(one.with_suffix(".csv"), keep_default_na=False) for one in looked], ignore_index=True)
    for name in ("bytes", "time_s", "packets_time_s", "over_packets", "plan_time_s", "build_time_s"):
        rows[name] = pd.to_numeric(rows[name], errors="coerce")
    rows["culling"] = rows["culling"].astype(str)
    rows.to_parquet(kept / "measured.parquet", index=False, compression="zstd")
    looks = pd.DataFrame([json.loads(one.read_text(encoding="utf-8")) for one in looked])
    looks.to_parquet(kept / "looks.parquet", index=False, compression="zstd")


def main() -> None:
    """Look, then keep."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("kept", type=Path)
    given = parser.parse_args()
    isa = os.environ.get("ATRA_ISA")
    for scene, view in VIEWS if isa else ():
        measured = given.folder / f"{isa}-{scene}-{view}.csv"
        if measured.exists() and not measured.with_suffix(".json").exists():
            look_at_view(measured, measured.with_suffix(".json"))
            print(scene, view, flush=True)
    keep(given.folder, given.kept)


if __name__ == "__main__":
    main()
