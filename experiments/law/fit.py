"""The law, fitted: what was measured beside what the model says with constants fitted without that scene.

    python -m experiments.law.fit FOLDER [results/law/table.parquet ...]

Rows of `sweep=law`, if tables are given, and looks at their views are put into measured.parquet and looks.parquet of
FOLDER, from which everything else follows: table.parquet is written there, it is said how the targets are met, and the
constants of all scenes are printed.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from atra.compiled.instruction_sets import LANE_COUNTS, instruction_sets_here
from atra.errors import InputError
from experiments.law.looks import choice_of, kept_looks, look_at_view, look_of
from experiments.law.model.formulas import NANO, SEEN, WANTS, WHOLE, Counts, build_terms, family, fit, frame_terms
from experiments.law.model.looking import Look
from experiments.law.model.memory import array_bytes, byte_terms

COUNTERS = ("packets", "upper", "lower", "tested", "met")
"""Packets of the whole image, and for one of them boxes in the levels that cells share and below, triangles tested and
triangles hit."""


def counters_of(look: Look, choice: Any, want: str) -> list[float | None]:
    """`COUNTERS` of a frame: along the whole ray for aligned rays and all hits, else up to what is seen."""
    if choice.method == "raster":
        return [None] * len(COUNTERS)
    whole = want != "nearest" or choice.method in ("aligned", "instanced")
    counts = Counts(look, choice, WHOLE if whole else SEEN)
    return [getattr(counts, name) for name in COUNTERS]


def gather(folder: Path) -> pd.DataFrame:
    """All measured rows, with their counts."""
    table = pd.read_parquet(folder / "measured.parquet")
    looks = kept_looks(folder / "looks.parquet")
    rows = table.to_dict("records")
    table["choice"] = choices = [choice_of(row) for row in rows]
    seen = [looks[row["instruction_set"], row["scene"], row["view"]] for row in rows]
    table["method"] = [choice.method for choice in choices]
    table["family"] = [family(choice, want) for choice, want in zip(choices, table["want"], strict=True)]
    known = list(zip(seen, choices, table["want"], strict=True))
    table["frame_terms"] = [frame_terms(seen_view.look, choice, want) for seen_view, choice, want in known]
    table["build_terms"] = [build_terms(seen_view.look, choice) for seen_view, choice, _ in known]
    table["array_bytes"] = [array_bytes(seen_view.look, choice) for seen_view, choice, _ in known]
    table["bytes_terms"] = [byte_terms(seen_view.look, choice) for seen_view, choice, _ in known]
    counted = [seen_view.look.copied(choice.method, choice.split, choice.culling) for seen_view, choice, _ in known]
    table["predicted_copies"] = [copied.copies for copied in counted]
    table["predicted_again"] = [copied.again for copied in counted]
    counters = [counters_of(seen_view.look, choice, want) for seen_view, choice, want in known]
    for k, name in enumerate(COUNTERS):
        table[name] = [counts[k] for counts in counters]
    table["raster_s"] = [seen_view.look.raster_s for seen_view in seen]
    for name in ("look_s", "frame_s"):
        table[name] = [getattr(seen_view, name) for seen_view in seen]
    # One and the same packets beside every method: their median says how fast the machine was.
    for _, of in table.groupby(["instruction_set", "scene", "view", "want"]):
        table.loc[of.index, "measured_time_s"] = of["packets_time_s"].median() / of["over_packets"]
    table["measured_build_s"] = table["plan_time_s"] + table["build_time_s"]
    table["measured_bytes"] = table["bytes"]
    return table


def constants_of(rows: pd.DataFrame) -> dict[str, list[float]]:
    """Constants of every family, fitted to these rows."""
    constants = {}
    for name, of in rows.groupby("family"):
        frames = fit(np.stack(list(of["frame_terms"])), of["measured_time_s"].to_numpy())
        constants[str(name)] = (frames / NANO).tolist()
    nearest = rows[rows["want"] == "nearest"]
    for name, of in nearest.groupby("method"):
        builds = fit(np.stack(list(of["build_terms"])), of["measured_build_s"].to_numpy())
        constants[f"{name}|build"] = (builds / NANO).tolist()
        terms, arrays = np.stack(list(of["bytes_terms"])), of["array_bytes"].to_numpy()
        constants[f"{name}|bytes"] = fit(terms, of["measured_bytes"].to_numpy(), arrays).tolist()
    return constants


def predict(rows: pd.DataFrame, constants: dict[str, list[float]]) -> pd.DataFrame:
    """The predictions of rows, by these constants; NaN where a family has none."""

    def costs(terms: str, names: pd.Series) -> list[float]:
        every = zip(rows[terms], names, strict=True)
        return [float(np.dot(terms, constants.get(name, np.full(len(terms), np.nan)))) for terms, name in every]

    return pd.DataFrame({
        "predicted_time_s": np.array(costs("frame_terms", rows["family"])) * NANO,
        "predicted_build_s": np.array(costs("build_terms", rows["method"] + "|build")) * NANO,
        "predicted_bytes": np.array(costs("bytes_terms", rows["method"] + "|bytes")) + rows["array_bytes"].to_numpy(),
    }, index=rows.index)  # fmt: skip


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


def report(rows: pd.DataFrame) -> str:
    """Errors of one instruction set, and how well the fastest prediction chooses."""
    errors, views = errors_of(rows), rows.groupby(["scene", "view"]).ngroups
    lines = [f"{rows['scene'].nunique()} scenes, {views} views, {len(rows)} rows; {_said(errors)}"]
    lines += [f"  {name}: {_said(errors[of.index])}" for name, of in rows.groupby("family")]
    for name in ("bytes", "build_s"):
        lines.append(f"  {name}: {_said((rows[f'predicted_{name}'] / rows[f'measured_{name}'] - 1.0).abs().dropna())}")
    for want in ("nearest", "count"):
        for without in ((), ("raster",)):
            chosen = ", ".join(f"{name} {value:.2f}" for name, value in choices_of(rows, want, without).items())
            lines.append(f"  {want} without {without}: {chosen}")
    return "\n".join(lines)


def _said(errors: pd.Series) -> str:
    return f"median error {errors.median():.1%}, nine of ten within {errors.quantile(0.9):.1%}"


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
    "predicted_bytes", "measured_bytes", "copies", "predicted_copies", "predicted_again",
    *COUNTERS, "look_s", "frame_s", "raster_s", "rounds",
)  # fmt: skip


KEPT = ("embree_bytes", "bvh_bytes", "scratch_bytes", "list_bytes", "lookup_bytes")
"""Columns of bytes that a tracer counts."""

COUNTED = ("raster", "bvh", "classified")
"""Methods whose tracers count all their bytes; of the others the look knows the arrays."""

KEYS = ["instruction_set", "scene", "view"]


def measured_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The measured points of a table of `sweep=law` as rows of measured.parquet, without the bytes of arrays. Scenes
    that stand for others are left out."""
    own = table["stands_for"].isna() if "stands_for" in table else True
    rows = table[table["status"].eq("ok") & table["workload"].isin(list(WANTS)) & own].reset_index(drop=True)
    widest = max(width for width in LANE_COUNTS if rows[f"packets_{width}_render_time_s"].notna().all())
    time_s = rows["render_time_s"].astype(float)
    packets_s = rows[f"packets_{widest}_render_time_s"].astype(float)
    own_width = ~rows["method"].isin(["raster", "bvh", "classified"])
    held = rows["instruction_set"].where(rows["instruction_set"].ne("none"))
    same = ["scene", "view", "triangles", "width", "height", "method", "rounds", "plan_time_s", "build_time_s"]
    return rows[same].assign(
        instruction_set=held.fillna(instruction_sets_here()[-1]), want=rows["workload"].map(WANTS),
        packet_width=rows["packet_width"].where(own_width, 1).astype(int), geometry=rows["geometry"].fillna(""),
        culling=rows["culling"].astype(str), split_x=rows["split_x"].fillna(1).astype(int),
        split_y=rows["split_y"].fillna(1).astype(int), time_s=time_s, packets_time_s=packets_s,
        over_packets=packets_s / time_s, copies=rows["triangles_traced"],
        bytes=sum(rows[name].fillna(0).astype(float) for name in KEPT if name in rows),
    )  # fmt: skip


def add_tables(folder: Path, tables: Sequence[pd.DataFrame]) -> None:
    """Put rows of `sweep=law`, and looks at views that were not looked at, into measured.parquet and looks.parquet."""
    measured, looked = folder / "measured.parquet", folder / "looks.parquet"
    kept = pd.read_parquet(looked).to_dict("records") if looked.exists() else []
    looks: dict[Any, Any] = {tuple(row[name] for name in KEYS): row for row in kept}
    parts = [pd.read_parquet(measured)] if measured.exists() else []
    for rows in map(measured_rows, tables):
        for key, of in rows.groupby(KEYS):
            choices = [choice_of(row) for row in of.to_dict("records")]
            row = {KEYS[0]: key[0], **look_at_view(str(key[1]), str(key[2]), int(of["width"].iloc[0]), choices)}
            looks[key], look = row, look_of(row)
            rows.loc[of.index, "bytes"] += [
                0.0 if choice.method in COUNTED else array_bytes(look, choice) for choice in choices
            ]
        rows.loc[rows["want"].ne("nearest"), "bytes"] = np.nan
        parts.append(rows)
    folder.mkdir(parents=True, exist_ok=True)
    pd.concat(parts, ignore_index=True).to_parquet(measured, index=False, compression="zstd")
    pd.DataFrame(list(looks.values())).to_parquet(looked, index=False, compression="zstd")


def main(given: Sequence[str]) -> None:
    """Add tables, fit, report, and write the table."""
    if not given:
        raise InputError(f"no folder is given, expected one with measured.parquet, or tables beside it\n{__doc__}")
    folder, tables = Path(given[0]), [pd.read_parquet(path) for path in given[1:]]
    if tables:
        add_tables(folder, tables)
    table = gather(folder)
    judged = leave_one_out(table)
    judged[list(COLUMNS)].to_parquet(folder / "table.parquet", index=False)
    for isa, rows in table.groupby("instruction_set"):
        print(f"{isa}: {report(judged.loc[rows.index])}")
        rounded = {name: [float(f"{value:.3g}") for value in values] for name, values in constants_of(rows).items()}
        print(json.dumps(rounded, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
