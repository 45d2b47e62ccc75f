"""The table of the law: what was measured beside what the model says with constants fitted without that scene.

    python -m experiments.law.predict FOLDER TABLE

FOLDER is that of `experiments.law.measure`. Looks at every view first where that was not done (ATRA_ISA as there); a
run without ATRA_ISA then fits and writes the table, says how the targets are met, and prints the constants of all
scenes.
"""

from __future__ import annotations

import json
import os
from argparse import ArgumentParser
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
import pandas as pd

from atra.model.choice import Choice
from atra.model.formulas import (
    NANO,
    SEEN,
    WHOLE,
    Counts,
    build_terms,
    byte_terms,
    copies,
    family,
    fit,
    frame_terms,
)
from atra.model.looking import Look, look_at
from experiments.law.measure import VIEWS, mesh_and_camera


def choice_of(row: Any) -> Choice:
    """The choice of a measured row."""
    method = "instanced" if row["geometry"] == "instanced" else str(row["method"])
    culling = not (method in ("aligned", "instanced") and str(row["culling"]) == "False")
    return Choice(method, (int(row["split_x"]), int(row["split_y"])), int(row["packet_width"]), culling)


COUNTERS = ("packets", "upper", "lower", "tested", "met")
"""Packets of the whole image, and for one of them boxes in the levels that cells share and below, triangles tested and
triangles hit."""


def counters_of(look: Look, choice: Choice, want: str) -> list[float | None]:
    """`COUNTERS` of a frame: along the whole ray for aligned rays and all hits, else up to what is seen."""
    if choice.method == "raster":
        return [None] * len(COUNTERS)
    whole = want != "nearest" or choice.method in ("aligned", "instanced")
    counts = Counts(look, choice, WHOLE if whole else SEEN)
    return [getattr(counts, name) for name in COUNTERS]


def look_at_view(measured: Path, looked: Path) -> None:
    """Write the counts of all rows of a measured view, in the order of its file."""
    rows = pd.read_csv(measured, keep_default_na=False)
    scene, view = str(rows["scene"][0]), str(rows["view"][0])
    mesh, camera = mesh_and_camera(scene, view)
    look_at(mesh, camera)  # loads kernels
    start = thread_time()
    look = look_at(mesh, camera)
    told: dict[str, Any] = {"look_s": thread_time() - start, "raster_s": look.raster_s, "rows": []}
    told |= {"edges": look.edges, "hit": look.hit, "met": look.met.tolist(), "tested": look.tested.tolist(),
             "boxes": look.boxes.tolist(), "raster_bytes": look.raster_bytes, "shapes": look.shapes}  # fmt: skip
    for row in rows.to_dict("records"):
        choice = choice_of(row)
        told["rows"].append({
            "frame": frame_terms(look, choice, str(row["want"])).tolist(),
            "build": build_terms(look, choice).tolist(), "bytes": byte_terms(look, choice).tolist(),
            "copies": copies(look, choice), "counters": counters_of(look, choice, str(row["want"])),
        })  # fmt: skip
    looked.write_text(json.dumps(told), encoding="utf-8")


def gather(folder: Path) -> pd.DataFrame:
    """All measured rows, with their counts."""
    tables = []
    for looked in sorted(folder.glob("*.json")):
        rows = pd.read_csv(looked.with_suffix(".csv"), keep_default_na=False)
        told = json.loads(looked.read_text())
        for name in ("frame", "build", "bytes"):
            rows[f"{name}_terms"] = [np.array(one[name]) for one in told["rows"]]
        rows["predicted_copies"] = [one["copies"] for one in told["rows"]]
        for k, name in enumerate(COUNTERS):
            rows[name] = [one["counters"][k] for one in told["rows"]]
        rows["look_s"], rows["raster_s"], rows["raster_bytes"] = told["look_s"], told["raster_s"], told["raster_bytes"]
        # One and the same packets beside every method: their median says how fast the machine was.
        for want in ("nearest", "count"):
            of = rows["want"] == want
            rows.loc[of, "measured_time_s"] = rows.loc[of, "packets_time_s"].median() / rows.loc[of, "over_packets"]
        tables.append(rows)
    table = pd.concat(tables, ignore_index=True)
    choices = [choice_of(row) for row in table.to_dict("records")]
    table["choice"] = choices
    table["method"] = [one.method for one in choices]
    table["family"] = [family(one, want) for one, want in zip(choices, table["want"], strict=True)]
    table["measured_build_s"] = table["plan_time_s"] + table["build_time_s"]
    table["measured_bytes"] = pd.to_numeric(table["bytes"], errors="coerce")
    return table


def constants_of(rows: pd.DataFrame) -> dict[str, list[float]]:
    """Constants of every family, fitted to these rows."""
    found = {}
    for name, of in rows.groupby("family"):
        found[str(name)] = (fit(np.stack(list(of["frame_terms"])), of["measured_time_s"].to_numpy()) / NANO).tolist()
    nearest = rows[rows["want"] == "nearest"]
    for name, of in nearest.groupby("method"):
        builds = fit(np.stack(list(of["build_terms"])), of["measured_build_s"].to_numpy())
        found[f"{name}|build"] = (builds / NANO).tolist()
        if name != "raster":
            found[f"{name}|bytes"] = fit(np.stack(list(of["bytes_terms"])), of["measured_bytes"].to_numpy()).tolist()
    return found


def predict(rows: pd.DataFrame, constants: dict[str, list[float]]) -> pd.DataFrame:
    """The predictions of rows, by these constants."""
    found = pd.DataFrame(index=rows.index)
    found["predicted_time_s"] = [
        float(np.dot(one, constants.get(name, np.full(len(one), np.nan)))) * NANO
        for one, name in zip(rows["frame_terms"], rows["family"], strict=True)
    ]
    found["predicted_build_s"] = [
        float(np.dot(one, constants[f"{name}|build"])) * NANO
        for one, name in zip(rows["build_terms"], rows["method"], strict=True)
    ]
    found["predicted_bytes"] = [
        float(row["raster_bytes"]) if row["method"] == "raster"
        else float(np.dot(row["bytes_terms"], constants[f"{row['method']}|bytes"]))
        for row in rows.to_dict("records")
    ]  # fmt: skip
    return found


def leave_one_out(table: pd.DataFrame) -> pd.DataFrame:
    """Each row with predictions by constants that its scene, in no view, had a part in."""
    parts = []
    for (_, scene), rows in table.groupby(["instruction_set", "scene"]):
        others = table[(table["instruction_set"] == rows["instruction_set"].iloc[0]) & (table["scene"] != scene)]
        parts.append(rows.join(predict(rows, constants_of(others))))
    return pd.concat(parts).sort_index()


def errors_of(rows: pd.DataFrame) -> pd.Series:
    """|predicted / measured - 1| of frame times."""
    return (rows["predicted_time_s"] / rows["measured_time_s"] - 1.0).abs()


def report(table: pd.DataFrame) -> str:
    """The targets and what is reached."""
    lines = []
    for isa, rows in table.groupby("instruction_set"):
        errors = errors_of(rows)
        views = rows.groupby(["scene", "view"]).ngroups
        lines.append(f"{isa}: {rows['scene'].nunique()} scenes, {views} views, {len(rows)} rows")
        lines.append(f"  frames: median error {errors.median():.1%}, nine of ten within {errors.quantile(0.9):.1%}")
        for name, of in rows.groupby("family"):
            e = errors_of(of)
            lines.append(f"    {name}: {e.median():.1%}, {e.quantile(0.9):.1%} of {len(of)}")
        bytes_ = (rows["predicted_bytes"] / rows["measured_bytes"] - 1).abs().dropna()
        lines.append(f"  bytes: median {bytes_.median():.1%}, nine of ten {bytes_.quantile(0.9):.1%}, "
                     f"within 10%: {(bytes_ <= 0.1).mean():.0%}")  # fmt: skip
        builds = (rows["predicted_build_s"] / rows["measured_build_s"] - 1).abs()[rows["want"] == "nearest"]
        lines.append(f"  plan and build: median {builds.median():.1%}, nine of ten {builds.quantile(0.9):.1%}")
        for want in ("nearest", "count"):
            for without in ((), ("raster",)):
                found = choices_of(rows, want, without)
                told = ", ".join(f"{name} {value:.2f}" for name, value in found.items())
                lines.append(f"  {want} without {without}: {told}")
        looks = rows.drop_duplicates(["scene", "view"])
        ratio = looks["look_s"] / looks["raster_s"]
        lines.append(f"  a look takes {ratio.median():.0f} raster frames in the median, {ratio.max():.0f} at most")
    return "\n".join(lines)


def choices_of(rows: pd.DataFrame, want: str, without: tuple[str, ...] = ()) -> dict[str, float]:
    """How the fastest prediction of each view does: shares of views whose fastest method it names, and that
    constant answers name; median and ninth decile of its frame over the fastest, less 1."""
    rows = rows[(rows["want"] == want) & ~rows["method"].isin(without)]
    regrets, named, fastest = [], [], []
    for _, of in rows.groupby(["scene", "view"]):
        chosen = of.loc[of["predicted_time_s"].idxmin()]
        regrets.append(chosen["measured_time_s"] / of["measured_time_s"].min() - 1)
        fastest.append(of.loc[of["measured_time_s"].idxmin(), "method"])
        named.append(chosen["method"] == fastest[-1])
    return {
        "views": len(named), "named": float(np.mean(named)),
        "raster": fastest.count("raster") / len(named),
        "visible_first": fastest.count("visible_first") / len(named),
        "median": float(np.median(regrets)), "decile": float(np.quantile(regrets, 0.9)),
    }  # fmt: skip


COLUMNS = (
    "instruction_set", "scene", "view", "triangles", "width", "height", "method", "packet_width", "culling", "split_x",
    "split_y", "want", "family", "measured_time_s", "predicted_time_s", "measured_build_s", "predicted_build_s",
    "predicted_bytes", "measured_bytes", "copies", "predicted_copies", *COUNTERS, "look_s", "raster_s", "rounds",
)  # fmt: skip


def main() -> None:
    """Look, or fit and report."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("table", type=Path)
    given = parser.parse_args()
    isa = os.environ.get("ATRA_ISA")
    if isa:
        for scene, view in VIEWS:
            measured = given.folder / f"{isa}-{scene}-{view}.csv"
            if measured.exists() and not measured.with_suffix(".json").exists():
                look_at_view(measured, measured.with_suffix(".json"))
        return
    table = gather(given.folder)
    judged = leave_one_out(table)
    print(report(judged))
    judged[list(COLUMNS)].to_parquet(given.table, index=False)
    for isa, rows in table.groupby("instruction_set"):
        rounded = {name: [float(f"{one:.3g}") for one in values] for name, values in constants_of(rows).items()}
        (given.folder / f"constants-{isa}.txt").write_text(json.dumps(rounded, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
