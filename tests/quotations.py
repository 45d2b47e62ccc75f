"""Quotations: rows and phrases of README and docs, made from the tables under reports/reference that they come from.

    python -m tests.quotations

prints them all, to be put into the pages when a table is measured anew; tests/test_documents.py looks for each of them.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from math import floor, log10
from pathlib import Path
from typing import Any

import pandas as pd

ROOT = Path(__file__).resolve().parents[1]
REFERENCE = ROOT / "reports" / "reference"
TIMES = "\N{MULTIPLICATION SIGN}"
SCENES = ("cornell_box", "mitsuba", "fireplace_room", "sponza")

Make = Callable[[Any], list[str]]


@dataclass(frozen=True)
class Quotation:
    """What a page says of a table: rows of its own tables, or phrases."""

    page: str
    source: str
    make: Make

    def fragments(self) -> list[str]:
        path = REFERENCE / self.source
        return self.make(json.loads(path.read_text(encoding="utf-8")) if path.suffix == ".json" else pd.read_csv(path))


def digits(value: float, count: int = 3) -> str:
    """So many significant digits, but two decimals at most: 16.5, 9.25, 0.68."""
    decimals = count - 1 - floor(log10(value))
    return f"{value:.{min(max(decimals, 0), 2)}f}"


def interval(row: pd.Series, name: str) -> str:
    return f"{digits(row[name])} [{digits(row[name + '_low'])}, {digits(row[name + '_high'])}]"


def split_of(row: pd.Series) -> str:
    return f"{row['split_x']:,} {TIMES} {row['split_y']:,}"


def milliseconds(seconds: float) -> str:
    return f"{seconds * 1e3:.1f}"


def power_of_ten(value: float) -> str:
    exponent = floor(log10(value))
    return f"{value / 10**exponent:.1f} · 10{str(exponent).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))}"


def table_row(*cells: Any) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def best(table: pd.DataFrame, scene: str, method: str, by: str = "speedup_vs_packets") -> pd.Series:
    """The row with the largest ratio, which is paired: the shortest time may be a quiet moment's."""
    rows = table[table["scene"].eq(scene) & table["method"].eq(method) & table["status"].eq("ok")]
    return rows.loc[rows[by].idxmax()]


def first_ahead(row: pd.Series, packets: pd.Series) -> int:
    """The frame from which on a method has taken less time than packets, plan and build included."""
    once, others = (
        one[["plan_time_s", "build_time_s", "first_frame_time_s"]].fillna(0).sum() for one in (row, packets)
    )
    gain = row["packets_render_time_s"] - row["render_time_s"]
    return 1 if once < others else floor((once - others) / gain) + 2


def frames_of_each_method(table: pd.DataFrame) -> list[str]:
    rows = []
    for scene in SCENES:
        aligned, visible_first, packets = (best(table, scene, name) for name in ("aligned", "visible_first", "pixel"))
        rows.append(
            table_row(
                f"`{scene}`",
                f"{visible_first['triangles']:,}",
                milliseconds(visible_first["baseline_render_time_s"]),
                milliseconds(visible_first["packets_render_time_s"]),
                milliseconds(aligned["render_time_s"]),
                interval(aligned, "speedup_vs_packets"),
                milliseconds(visible_first["render_time_s"]),
                interval(visible_first, "speedup_vs_packets"),
                first_ahead(visible_first, packets),
            )
        )
    assert set(table["pixels_wrong"]) == {0}
    assert set(table["packets_width"]) == {16}
    return [*rows, f"none of the {len(table)} images", f"medians of {table['rounds'].max()} paired rounds"]


def methods_in_detail(table: pd.DataFrame) -> list[str]:
    rows = []
    for name, method in (("visible-first", "visible_first"), ("aligned", "aligned"), ("culled tiles", "tiles")):
        chosen = [best(table, scene, method) for scene in SCENES]
        rows.append(table_row(name, *(f"{digits(row['speedup_vs_packets'])} ({split_of(row)})" for row in chosen)))
    visible_first = [best(table, scene, "visible_first") for scene in SCENES]
    over_single = [digits(row["speedup"]) for row in visible_first]
    packets = [best(table, scene, "pixel") for scene in SCENES]
    held = [row["embree_bytes"] / one["embree_bytes"] for row, one in zip(visible_first, packets, strict=True)]
    return [
        *rows,
        table_row("Zen 5, AVX-512, the table above", 16, *(digits(row["speedup_vs_packets"]) for row in visible_first)),
        table_row("visible-first, over `rtcIntersect1`", *over_single),
        table_row("visible-first, Embree's bytes over those of packets", *(f"{value:.1f}" for value in held)),
    ]


def paper_speedups(table: pd.DataFrame) -> list[str]:
    paper = {"cornell_box": "7.50", "mitsuba": "2.94", "fireplace_room": "1.85", "sponza": "1.71"}
    aligned = table[
        table["quantity"].eq("time")
        & table["geometry"].eq("copied")
        & table["culling"].eq(True)
        & table["split_y"].eq(1)
        & table["stands_for"].isna()
    ]
    rows = []
    for scene in SCENES:
        single = best(aligned[aligned["packet_width"].eq(1)], scene, "aligned", "speedup")
        packets = best(aligned[aligned["packet_width"].eq(8)], scene, "aligned")
        cells = (
            f"{interval(row, name)} ({split_of(row)})"
            for row, name in ((single, "speedup"), (packets, "speedup_vs_packets"))
        )
        rows.append(table_row(f"`{scene}`", paper[scene], *cells))
    return rows


def over_all_hits(table: pd.DataFrame) -> list[str]:
    single = table[table["quantity"].eq("time") & table["packet_width"].eq(1) & table["split_y"].eq(1)]
    gains = []
    for scene in SCENES:
        start = single[single["culling"].eq(False) & single["split_x"].eq(1) & single["scene"].eq(scene)]
        top = best(single[single["culling"].eq(True)], scene, "aligned", "speedup")
        gains.append(digits(top["speedup"] / start["speedup"].item()))
    return [f"gain here {', '.join(gains[:-1])} and {gains[-1]} times"]


def paper_points(table: pd.DataFrame) -> list[str]:
    measured, skipped = (int(table["status"].eq(status).sum()) for status in ("ok", "skipped"))
    doubted = int(table["doubts"].notna().sum())
    return [f"{len(table)} points, {measured} measured, {skipped} skipped", f"{doubted} points carry a doubt"]


def claim_verdicts(claims: list[dict[str, str]]) -> list[str]:
    return [
        table_row(claim["text"], claim["section"], claim["verdict"])
        for claim in claims
        if not claim["id"].startswith("best-speedup")
    ]


def instances(table: pd.DataFrame) -> list[str]:
    kinds = (("copies, culling off", "copied", False), ("copies", "copied", True), ("instances", "instanced", False))
    rows = []
    for split_x in (64, 1024):
        of_split = table[
            table["quantity"].eq("time")
            & table["split_x"].eq(split_x)
            & table["split_y"].eq(1)
            & table["packet_width"].eq(8)
            & table["method"].eq("aligned")
        ]
        for kind, geometry, culling in kinds:
            chosen = of_split[of_split["geometry"].eq(geometry) & of_split["culling"].eq(culling)].set_index("scene")
            if set(chosen["status"]) != {"ok"}:
                continue  # skipped on some scene, for the memory it would need
            mebibytes = [f"{chosen.loc[scene, 'embree_bytes'] / 2**20:,.1f}" for scene in SCENES]
            rows.append(table_row(f"{split_x:,} {TIMES} 1, {kind}: Embree's bytes in MiB", *mebibytes))
            speedups = [digits(chosen.loc[scene, "speedup"]) for scene in SCENES]
            rows.append(table_row(f"{split_x:,} {TIMES} 1, {kind}: speed-up over `rtcIntersect1`", *speedups))
    return rows


def kind_of(row: pd.Series) -> str:
    if row["method"] == "aligned":
        culling = "culling on" if row["culling"] else "culling off"
        return "aligned, instanced" if row["geometry"] == "instanced" else f"aligned, {culling}"
    names = {"visible_first": "visible-first", "tiles": "tiles", "pixel": f"packets of {row['packet_width']} per pixel"}
    return names[row["method"]]


def sums_by_kind(table: pd.DataFrame) -> pd.DataFrame:
    table = table.assign(
        kind=[kind_of(row) for _, row in table.iterrows()],
        pixels=table.filter(regex="^pixels_").sum(axis=1),
    )
    summed = dict.fromkeys(table.filter(regex="^(pixels|images$|rays_|method_|baseline_wrong|sampled_)"), "sum")
    largest = dict.fromkeys(("depth_error_max", "baseline_depth_error_max"), "max")
    return table.groupby(["scene", "kind"], sort=False).agg(summed | largest)


def agreement_by_kind(table: pd.DataFrame) -> list[str]:
    sums = sums_by_kind(table)
    assert not sums["pixels_wrong"].any()
    rows = []
    for (scene, kind), row in sums.iterrows():
        rows.append(
            table_row(
                f"`{scene}`",
                kind,
                int(row["images"]),
                f"{row['pixels'] / 1e6:.1f} M",
                f"{int(row['pixels_tied']):,}",
                f"{int(row['pixels_edge']):,}",
                f"{int(row['method_wrong']):,} : {int(row['baseline_wrong']):,}",
                f"{int(row['sampled_method_wrong'])} : {int(row['sampled_baseline_wrong'])}",
                power_of_ten(row["depth_error_max"]),
                power_of_ten(row["baseline_depth_error_max"]),
            )
        )
    return rows


def agreement_in_all(table: pd.DataFrame) -> list[str]:
    sums, totals = sums_by_kind(table), table.sum(numeric_only=True)
    by_scene = table.groupby("scene")[["method_wrong", "baseline_wrong", "pixels_tied"]].sum()
    errors = {scene: f"{row['method_wrong']:,} : {row['baseline_wrong']:,}" for scene, row in by_scene.iterrows()}
    depths = table["depth_error_max"] / table["baseline_depth_error_max"]
    twice = int((sums["method_wrong"] > 2 * sums["baseline_wrong"]).sum())
    pixels = table.filter(regex="^pixels_").to_numpy().sum()
    return [
        f"{totals['images']:.0f} images, {pixels / 1e6:.0f} million pixels",
        f"*Wrong* is {totals['pixels_wrong']:.0f} in all {totals['images']:.0f} images",
        f"at most {depths.max():.1f} times",
        f"Of {totals['rays_sampled']:,.0f} sampled rays the methods are wrong at {totals['sampled_method_wrong']:.0f}, "
        f"`rtcIntersect1` at {totals['sampled_baseline_wrong']:.0f}",
        f"Cornell box {errors['cornell_box']}, fireplace room {errors['fireplace_room']}, Sponza {errors['sponza']}, "
        f"needles {errors['needles']}",
        f"On mitsuba it is {errors['mitsuba']}",
        f"{twice} of {len(sums)} rows err more than twice as often",
        f"Sponza's ties are {by_scene.loc['sponza', 'pixels_tied']}",
    ]


QUOTATIONS = (
    Quotation("README.md", "methods/table.csv", frames_of_each_method),
    Quotation("docs/methods.md", "methods/table.csv", methods_in_detail),
    Quotation("docs/paper.md", "table.csv", paper_speedups),
    Quotation("docs/paper.md", "table.csv", over_all_hits),
    Quotation("docs/paper.md", "table.csv", paper_points),
    Quotation("docs/paper.md", "claims.json", claim_verdicts),
    Quotation("docs/methods.md", "table.csv", instances),
    Quotation("docs/trust.md", "agreement/table.csv", agreement_by_kind),
    Quotation("docs/trust.md", "agreement/table.csv", agreement_in_all),
)


if __name__ == "__main__":
    for quotation in QUOTATIONS:
        print(f"\n{quotation.page}, from {quotation.source}:\n", *quotation.fragments(), sep="\n")
