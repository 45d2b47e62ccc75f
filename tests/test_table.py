"""The table, on samples small enough to do by hand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from atra.records import Record
from experiments.configuration import Figure
from experiments.figures import write_figure
from experiments.table import make_table, write_table

ASKED_FOR = [
    "scene", "triangles", "triangles_traced", "width", "height", "split_x", "split_y", "culling", "method",
    "packet_width", "threads", "build_quality", "plan_time_s", "build_time_s", "render_time_s",
    "baseline_render_time_s", "packets_render_time_s", "speedup", "speedup_vs_packets", "rss_bytes",
    "peak_rss_bytes", "embree_bytes", "pixels_equal", "pixels_tied", "pixels_edge", "pixels_wrong", "status",
    "error",
]  # fmt: skip


MEASURED = Record(
    point_id="a",
    status="ok",
    error=None,
    configuration={
        "scene": "box", "triangles": 10, "width": 8, "height": 4, "split_x": 2, "split_y": 1, "culling": True,
        "method": "aligned", "packet_width": None, "threads": 1, "build_quality": "medium", "rounds": 3,
    },
    environment={"cpu": "some cpu", "taken_at": "2000-01-01T00:00:00+00:00"},
    samples={"own": [1.0, 2.0, 4.0], "rtcIntersect1": [10.0, 4.0, 12.0], "packets": [2.0, 4.0, 4.0]},
    results={
        "triangles_traced": 14, "packet_width": 8, "plan_time_s": 0.5, "build_time_s": 0.25, "rss_bytes": 100,
        "peak_rss_bytes": 120, "embree_bytes": 30, "pixels_equal": 30, "pixels_tied": 1, "pixels_edge": 1,
        "pixels_wrong": 0, "rounds": 3, "packets_width": 8,
    },
)  # fmt: skip
SKIPPED = Record("b", "skipped", "needs 9 GiB", {**MEASURED.configuration, "culling": False}, MEASURED.environment)


def test_the_columns_asked_for_come_first_and_in_order() -> None:
    assert list(make_table([MEASURED]).columns)[: len(ASKED_FOR)] == ASKED_FOR


def test_times_are_medians() -> None:
    row = make_table([MEASURED]).iloc[0]
    assert (row["render_time_s"], row["baseline_render_time_s"], row["packets_render_time_s"]) == (2.0, 10.0, 4.0)
    assert (row["render_time_q1_s"], row["render_time_q3_s"], row["render_time_spread_s"]) == (1.5, 3.0, 1.5)


def test_ratios_are_medians_of_ratios_not_ratios_of_medians() -> None:
    row = make_table([MEASURED]).iloc[0]
    assert row["speedup"] == 3.0  # of 10, 2, 3; the medians alone would give 5
    assert row["speedup_vs_packets"] == 2.0  # of 2, 2, 1


def test_the_packet_width_that_ran_is_shown() -> None:
    assert make_table([MEASURED]).iloc[0]["packet_width"] == 8


def test_a_wide_spread_and_missing_rounds_are_doubts() -> None:
    doubts = make_table([replace(MEASURED, configuration={**MEASURED.configuration, "rounds": 9})]).iloc[0]["doubts"]
    assert "spread" in doubts
    assert "3 of 9 rounds" in doubts
    calm = replace(MEASURED, samples={name: [1.0, 1.0, 1.0] for name in MEASURED.samples})
    assert pd.isna(make_table([calm]).iloc[0]["doubts"])


def test_a_skipped_point_is_a_row_with_its_reason_and_no_numbers() -> None:
    table = make_table([MEASURED, SKIPPED])
    row = table.iloc[1]
    assert (row["status"], row["error"], row["split_x"], row["triangles"]) == ("skipped", "needs 9 GiB", 2, 10)
    measured = ["render_time_s", "speedup", "rss_bytes", "triangles_traced", "pixels_wrong", "rounds"]
    assert row[measured].isna().all()


def test_both_files_hold_the_same_rows(tmp_path: Path) -> None:
    table = make_table([MEASURED, SKIPPED])
    write_table(tmp_path, table)
    from_parquet = pd.read_parquet(tmp_path / "table.parquet")
    from_csv = pd.read_csv(tmp_path / "table.csv")
    assert list(from_csv.columns) == list(from_parquet.columns) == list(table.columns)
    for name in ("render_time_s", "speedup", "triangles_traced"):
        assert from_csv[name][0] == from_parquet[name][0] == table[name][0]
        assert pd.isna(from_csv[name][1])
        assert pd.isna(from_parquet[name][1])


@pytest.mark.parametrize("records", [[], [SKIPPED]])
def test_nothing_measured_gives_a_table_and_no_figure(tmp_path: Path, records: list[Record]) -> None:
    table = make_table(records)
    write_table(tmp_path, table)
    write_figure(tmp_path, Figure.horizontal, table)
    assert len(pd.read_csv(tmp_path / "table.csv")) == len(records)
    assert not (tmp_path / "figure5.png").exists()


def test_the_figure_says_what_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from experiments.split_figure import draw_split_figure

    figure = draw_split_figure(make_table([MEASURED, SKIPPED]))
    texts = [text.get_text() for axis in figure.axes for text in axis.texts]
    assert any("culling off, 2: skipped, needs 9 GiB" in text for text in texts)


def test_the_grid_figure_writes_each_time_into_its_cell_and_the_status_where_there_is_none() -> None:
    from experiments.grid_figure import draw_grid_figure

    beside = Record("c", "skipped", "does not divide", {**MEASURED.configuration, "split_x": 3}, MEASURED.environment)
    panel = draw_grid_figure(make_table([MEASURED, beside, SKIPPED])).axes[0]
    assert {text.get_text() for text in panel.texts} == {"2000", "skipped"}
