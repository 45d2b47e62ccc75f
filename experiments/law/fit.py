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
from experiments.law.model.formulas import NANO, SEEN, WHOLE, Counts, build_terms, family, fit, frame_terms
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
    table["method"] = [one.method for one in choices]
    table["family"] = [family(one, want) for one, want in zip(choices, table["want"], strict=True)]
    known = list(zip(seen, choices, table["want"], strict=True))
    table["frame_terms"] = [frame_terms(one.look, choice, want) for one, choice, want in known]
    table["build_terms"] = [build_terms(one.look, choice) for one, choice, _ in known]
    table["array_bytes"] = [array_bytes(one.look, choice) for one, choice, _ in known]
    table["bytes_terms"] = [byte_terms(one.look, choice) for one, choice, _ in known]
    counted = [one.look.copied(choice.method, choice.split, choice.culling) for one, choice, _ in known]
    table["predicted_copies"] = [one.copies for one in counted]
    table["predicted_again"] = [one.again for one in counted]
    counters = [counters_of(one.look, choice, want) for one, choice, want in known]
    for k, name in enumerate(COUNTERS):
        table[name] = [one[k] for one in counters]
    table["raster_s"] = [one.look.raster_s for one in seen]
    for name in ("look_s", "plan_s", "frame_s"):
        table[name] = [getattr(one, name) for one in seen]
    # One and the same packets beside every method: their median says how fast the machine was.
    for _, of in table.groupby(["instruction_set", "scene", "view", "want"]):
        table.loc[of.index, "measured_time_s"] = of["packets_time_s"].median() / of["over_packets"]
    table["measured_build_s"] = table["plan_time_s"] + table["build_time_s"]
    table["measured_bytes"] = table["bytes"]
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
        terms, arrays = np.stack(list(of["bytes_terms"])), of["array_bytes"].to_numpy()
        found[f"{name}|bytes"] = fit(terms, of["measured_bytes"].to_numpy(), arrays).tolist()
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
        arrays + float(np.dot(one, constants[f"{name}|bytes"]))
        for one, arrays, name in zip(rows["bytes_terms"], rows["array_bytes"], rows["method"], strict=True)
    ]
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
            lines += ["  fastest method down, chosen one across:", *_indented(confusion_of(rows, want, ("raster",)))]
        lines += ["  residuals of frames, nearest hit, log:", *_indented(residuals_of(rows).round(2))]
        known = ", ".join(f"{name} {value:.2f}" for name, value in named_if_known(rows).items())
        lines.append(f"  named, rasteriser apart, if this part of the residuals were known: {known}")
        looks = rows.drop_duplicates(["scene", "view"])
        for name in ("look", "plan"):
            ratio = looks[f"{name}_s"] / looks["frame_s"]
            lines.append(
                f"  a {name} takes {ratio.median():.0f} raster frames in the median, {ratio.max():.0f} at most"
            )
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


def confusion_of(rows: pd.DataFrame, want: str, without: tuple[str, ...] = ()) -> pd.DataFrame:
    """Numbers of views by their fastest method (down) and the one that is chosen (across)."""
    rows = rows[(rows["want"] == want) & ~rows["method"].isin(without)]
    views = [of for _, of in rows.groupby(["scene", "view"])]
    fastest = [of.loc[of["measured_time_s"].idxmin(), "method"] for of in views]
    chosen = [of.loc[of["predicted_time_s"].idxmin(), "method"] for of in views]
    return pd.crosstab(pd.Series(fastest, name="fastest"), pd.Series(chosen, name="chosen"))


def _parted(rows: pd.DataFrame) -> pd.DataFrame:
    """Frames of the nearest hit, the rasteriser's apart, with `of_all`, the log of predicted over measured, and its
    means: `of_view`, of a family in a view; `of_split`, of what remains, of a family's split in all views."""
    rows = rows[(rows["want"] == "nearest") & (rows["method"] != "raster")]
    rows = rows.assign(of_all=np.log(rows["predicted_time_s"] / rows["measured_time_s"]))
    rows = rows.assign(of_view=rows.groupby(["family", "scene", "view"])["of_all"].transform("mean"))
    rest = rows.assign(rest=rows["of_all"] - rows["of_view"])
    return rest.assign(of_split=rest.groupby(["family", "split_x", "split_y"])["rest"].transform("mean"))


def residuals_of(rows: pd.DataFrame) -> pd.DataFrame:
    """For each family the standard deviation of its residuals: all, of means of views, of what remains."""
    grouped = _parted(rows).groupby("family")
    return pd.DataFrame({name: grouped[name].std() for name in ("of_all", "of_view", "rest")})


def named_if_known(rows: pd.DataFrame) -> dict[str, float]:
    """The share of views whose fastest method is named, rasteriser apart, were a part of the residuals taken away."""
    rows, found = _parted(rows), {}
    for name in ("of_view", "of_split"):
        known = rows.assign(predicted_time_s=rows["predicted_time_s"] * np.exp(-rows[name]))
        found[name] = choices_of(known, "nearest")["named"]
    return found


def _indented(table: pd.DataFrame) -> list[str]:
    return [f"    {line}" for line in table.to_string().splitlines()]


COLUMNS = (
    "instruction_set", "scene", "view", "triangles", "width", "height", "method", "packet_width", "culling", "split_x",
    "split_y", "want", "family", "measured_time_s", "predicted_time_s", "measured_build_s", "predicted_build_s",
    "predicted_bytes", "measured_bytes", "copies", "predicted_copies", "predicted_again",
    *COUNTERS, "look_s", "plan_s", "frame_s", "raster_s", "rounds",
)  # fmt: skip


WANTS = {"frame": "nearest", "gather": "count"}
"""Workloads of the sweep, and what their frames ask for."""

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
            rows.loc[of.index, "bytes"] += [0.0 if one.method in COUNTED else array_bytes(look, one) for one in choices]
        rows.loc[rows["want"].ne("nearest"), "bytes"] = np.nan
        parts.append(rows)
    folder.mkdir(parents=True, exist_ok=True)
    pd.concat(parts, ignore_index=True).to_parquet(measured, index=False, compression="zstd")
    pd.DataFrame(list(looks.values())).to_parquet(looked, index=False, compression="zstd")


def main(given: Sequence[str]) -> None:
    """Add tables, fit, report, and write the table."""
    if not given:
        raise InputError(f"no folder is given, expected one with measured.parquet, or tables beside it\n{__doc__}")
    folder, tables = Path(given[0]), [pd.read_parquet(one) for one in given[1:]]
    if tables:
        add_tables(folder, tables)
    table = gather(folder)
    judged = leave_one_out(table)
    print(report(judged))
    judged[list(COLUMNS)].to_parquet(folder / "table.parquet", index=False)
    for isa, rows in table.groupby("instruction_set"):
        rounded = {name: [float(f"{one:.3g}") for one in values] for name, values in constants_of(rows).items()}
        print(isa, json.dumps(rounded, indent=1))


if __name__ == "__main__":
    main(sys.argv[1:])
