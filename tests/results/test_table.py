"""The table, on samples small enough to do by hand."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from atra.errors import InputError
from experiments.harness.column import WHOLE, Column
from experiments.harness.records import Record
from experiments.results import table as tables
from experiments.results.people import MOST_COLUMNS, csv_columns
from experiments.results.statistics import REST
from experiments.results.table import (
    Tables,
    columns,
    make_table,
    make_tables,
    read_table,
    read_tables,
    rows_of,
)
from experiments.results.time_warnings import was_idle
from experiments.workloads import WORKLOADS
from experiments.workloads.frame import FRAME
from tests.folders import ROOT
from tests.report_samples import write_tables

ASKED_FOR = [
    "scene", "triangles", "width", "height", "workload", "method", "split_x", "split_y", "packet_width", "culling",
    "threads", "build_quality", "triangles_traced", "rss_bytes", "peak_rss_bytes", "embree_bytes", "pixels_equal",
    "pixels_tied", "pixels_edge", "pixels_wrong", "plan_time_s", "build_time_s", "render_time_s",
    "baseline_render_time_s", "packets_render_time_s", "speedup", "speedup_vs_packets", "status", "error", "point_id",
]  # fmt: skip


MEASURED = Record(
    point_id="a",
    status="ok",
    error=None,
    configuration={
        "scene": "box", "triangles": 10, "width": 8, "height": 4, "workload": "frame", "workload_options": {},
        "method": "aligned", "threads": 1, "build_quality": "medium", "rounds": 3,
        "method_options": {
            "split_x": 2, "split_y": 1, "culling": True, "geometry": "copied", "packet_width": None,
        },
    },
    environment={"cpu": "some cpu", "taken_at": "2000-01-01T00:00:00+00:00"},
    samples={"own": [1.0, 2.0, 4.0], "rtcIntersect1": [10.0, 4.0, 12.0], "packets_8": [2.0, 4.0, 4.0]},
    results={
        "triangles_traced": 14, "packet_width": 8, "plan_time_s": 0.5, "build_time_s": 0.25, "rss_bytes": 100,
        "peak_rss_bytes": 120, "embree_bytes": 30, "pixels_equal": 30, "pixels_tied": 1, "pixels_edge": 1,
        "pixels_wrong": 0, "rounds": 3,
    },
)  # fmt: skip


def with_options(**options):
    """The configuration of `MEASURED` with other options of its method."""
    return MEASURED.configuration | {"method_options": MEASURED.configuration["method_options"] | options}


SKIPPED = Record("b", "skipped", "needs 9 GiB", with_options(culling=False), MEASURED.environment)


def test_the_columns_asked_for_are_there_and_in_order():
    assert [name for name in make_table([MEASURED]).columns if name in ASKED_FOR] == ASKED_FOR


def test_two_columns_of_one_name_and_two_types_are_refused(monkeypatch):
    monkeypatch.setattr(tables, "WORKLOADS", (FRAME, replace(FRAME, columns=(Column("speedup", WHOLE),))))
    with pytest.raises(ValueError, match="column speedup is Float64 and Int64"):
        columns()


def test_times_are_medians_and_ratios_are_medians_of_ratios():
    row = make_table([MEASURED]).iloc[0]
    assert (row["render_time_s"], row["baseline_render_time_s"], row["packets_render_time_s"]) == (2.0, 10.0, 4.0)
    assert row["render_time_spread_s"] == 1.5
    assert pd.isna(row["render_time_low_s"])  # one process says nothing of others
    assert row["speedup"] == 3.0  # of 10, 2, 3; the medians alone would give 5
    assert row["speedup_vs_packets"] == 2.0  # of 2, 2, 1


def test_a_number_beside_an_interval_is_of_the_statistic_that_the_interval_is_of():
    known = columns()
    measured = [column for workload in WORKLOADS for column in workload.columns]
    for column in measured:
        stem, unit = (column.name[:-2], "_s") if column.unit == "s" else (column.name, "")
        if f"{stem}_low{unit}" in known and not stem.endswith(REST):
            assert column.over([1.0, 4.0, 8.0]) == pytest.approx(32 ** (1 / 3)), column.name
            assert column.over([0.0, 0.0]) == 0.0


def test_packets_are_the_fastest_and_every_width_has_columns_of_its_own():
    samples = MEASURED.samples | {"packets_16": [3.0, 3.0, 3.0]}
    row = make_table([replace(MEASURED, samples=samples)]).iloc[0]
    assert (row["packet_width"], row["packets_width"], row["packets_render_time_s"]) == (8, 16, 3.0)
    assert row["speedup_vs_packets"] == 1.5  # of 3, 1.5, 0.75
    assert (row["packets_8_render_time_s"], row["packets_16_render_time_s"]) == (4.0, 3.0)
    assert pd.isna(row["packets_4_render_time_s"])


CALM = {name: [1.0, 1.0, 1.0] for name in MEASURED.samples}


@pytest.mark.parametrize(("affinity", "logical", "told"), [([1], 8, 1), (None, 2, 2), ([0, 1, 2], 3, None)])
def test_more_threads_than_cores_are_flagged(affinity, logical, told):
    environment = MEASURED.environment | {"affinity": affinity, "logical_cores": logical}
    record = replace(MEASURED, environment=environment, samples=CALM, results=MEASURED.results | {"threads": 3})
    warnings = make_table([record]).iloc[0]["warnings"]
    assert pd.isna(warnings) if told is None else warnings == f"3 threads on {told} cores"


def test_a_skipped_point_is_a_row_with_its_reason_and_no_numbers():
    table = make_table([MEASURED, SKIPPED])
    row = table.iloc[1]
    assert (row["status"], row["error"], row["split_x"], row["triangles"]) == ("skipped", "needs 9 GiB", 2, 10)
    measured = ["render_time_s", "speedup", "rss_bytes", "triangles_traced", "pixels_wrong", "rounds"]
    assert row[measured].isna().all()


@pytest.mark.parametrize("records", [[MEASURED, SKIPPED], [SKIPPED], []])
def test_a_table_comes_back_from_its_file_as_it_was_and_the_other_file_holds_the_same(tmp_path, records):
    tables = make_tables(records, {"a": ("horizontal", "grid")})
    assert read_tables(tmp_path) is None
    write_tables(tmp_path, tables)
    stored = read_tables(tmp_path)
    pd.testing.assert_frame_equal(stored.points, tables.points)
    pd.testing.assert_frame_equal(stored.processes, tables.processes)
    from_csv = pd.read_csv(tmp_path / "table.csv")
    assert list(from_csv.columns) == csv_columns(tables.points)
    for name in {"render_time_s", "speedup", "build_time_s"} & set(from_csv.columns):
        np.testing.assert_array_equal(
            from_csv[name].to_numpy(float), tables.points[name].to_numpy(float, na_value=np.nan)
        )
    (tmp_path / "table.parquet").write_bytes(b"PAR1")
    with pytest.raises(InputError, match="cannot be read as a table"):
        read_tables(tmp_path)


def test_a_column_newer_than_a_stored_table_reads_as_missing(tmp_path):
    table = make_table([MEASURED])
    older = table.drop(columns=["speedup", "ties", "culling"])
    write_tables(tmp_path, Tables(older, older))
    table[["speedup", "ties", "culling"]] = None
    expected = table.astype({name: column.dtype for name, column in columns().items()})
    stored = read_tables(tmp_path)
    pd.testing.assert_frame_equal(stored.points, expected)


def test_an_older_tables_workload_is_read_by_its_name_of_today(tmp_path):
    table = make_table([MEASURED, SKIPPED]).assign(workload="rays", ray_kind=["diffuse", None])
    write_tables(tmp_path, Tables(table, table))
    assert list(read_tables(tmp_path).points["workload"]) == ["classification", "rays"]


def test_a_point_of_two_grids_is_a_row_of_each():
    table = make_table([MEASURED, SKIPPED], {"a": ("horizontal", "grid"), "b": ("grid",)})
    rows = {grid: list(rows_of(table, grid)["point_id"]) for grid in ("horizontal", "grid", "hor")}
    assert rows == {"horizontal": ["a"], "grid": ["a", "b"], "hor": []}


@pytest.mark.parametrize(("field", "value"), [("cpu", "another cpu"), ("embree_version", "4.4.1")])
def test_two_environments_never_share_a_table_and_the_field_is_named(field, value):
    later = replace(SKIPPED, environment={**MEASURED.environment, "taken_at": "2001-01-01"})  # the moment may differ
    other = replace(MEASURED, point_id="c", environment={**MEASURED.environment, field: value})
    assert len(make_table([MEASURED, later])) == 2
    with pytest.raises(InputError, match=rf"two environments: {field} is .*{value}"):
        make_table([MEASURED, later, other])


def test_builds_have_times_of_plan_and_build_and_none_of_frames():
    built = replace(
        MEASURED,
        configuration={**MEASURED.configuration, "workload": "build"},
        samples={"plan": [1.0, 2.0, 4.0], "build": [3.0, 3.0, 6.0], "baseline_build": [1.0, 1.5, 1.0]},
    )
    row = make_table([built]).iloc[0]
    assert (row["plan_time_s"], row["build_time_s"], row["baseline_build_time_s"]) == (2.0, 3.0, 1.0)
    assert (row["build_over_plain"], row["plan_and_build_over_plain"]) == (3.0, 4.0)  # of 3, 2, 6 and of 4, 3.3, 10
    assert pd.isna(row["render_time_s"])


def test_a_stand_in_says_whose_place_it_takes():
    def row(scene, source):
        configuration = {**MEASURED.configuration, "scene": scene, "scene_source": source}
        return make_table([replace(MEASURED, configuration=configuration)]).iloc[0]

    assert row("atrium", "procedural")["stands_for"] == "sponza"
    assert pd.isna(row("atrium", "file")["stands_for"])  # a user's own file of that name
    assert pd.isna(row("cornell_box", "procedural")["stands_for"])


def test_a_machine_that_was_busy_while_it_measured_is_flagged_and_one_that_was_before_is_none():
    def row(**results):
        busy = replace(
            MEASURED,
            samples=CALM,
            environment={**MEASURED.environment, "load_average": [9.0, 0.0, 0.0]},
            results={**MEASURED.results, "threads": 1, **results},
        )
        return make_table([busy]).iloc[0]

    assert row(others_share=0.04, stolen_share=0.26)["warnings"] == "others took 30% of its cores"
    assert row(others_share=0.3, stolen_share=None)["warnings"] == "others took 30% of its cores"
    assert pd.isna(row(others_share=0.01, stolen_share=0.03)["warnings"])
    assert row(others_share=0.01)["others_share"] == 0.01
    assert row()[["warnings", "others_share"]].isna().all()  # an old record does not tell


@pytest.mark.parametrize(("others", "stolen"), [(0.0, 0.0), (0.04, 0.0), (0.03, 0.03), (0.0, 0.06), (0.06, None)])
def test_a_machine_is_quiet_where_what_is_measured_bears_no_warning_of_others(others, stolen):
    shares = {"others_share": others, "stolen_share": stolen}
    environment = {**MEASURED.environment, "affinity": list(range(16))}
    record = replace(MEASURED, environment=environment, results={**MEASURED.results, "threads": 1, **shares})
    assert ("others took" in str(make_table([record]).iloc[0]["warnings"])) == (not was_idle(record))


def test_the_warnings_of_a_point_are_those_of_all_its_processes_each_once_and_at_its_worst():
    def process(number, own, **results):
        samples = dict.fromkeys(MEASURED.samples, own)
        configuration = {**MEASURED.configuration, "process": number, "rounds": 5}
        results = {**MEASURED.results, "threads": 1, **results}
        point_id = f"{number}" * 20
        return replace(MEASURED, point_id=point_id, configuration=configuration, samples=samples, results=results)

    calm = process(2, [1.0] * 5)
    busy = process(0, [1.0] * 4, others_share=0.26)
    short = process(1, [1e-4, 1.2e-4, 1.4e-4], others_share=0.3)
    table = make_table([busy, short, calm])
    assert table["warnings"][0].split("; ") == [
        "others took 30% of its cores",
        "3 of 5 rounds",
        "spread is 17% of the median",
        "shortest sample is below 1 ms",
    ]


def test_the_file_for_people_begins_with_what_was_measured_and_has_no_more_columns_than_they_read():
    others = [replace(MEASURED, configuration={**MEASURED.configuration, "scene": f"scene {k}"}) for k in range(3)]
    names = csv_columns(make_table([MEASURED, *others]))
    assert names[0] == "scene"
    assert names.index("method") < names.index("status") < names.index("render_time_s") < names.index("warnings")
    assert names[-1] == "point_id"
    assert len(set(names)) == len(names) <= MOST_COLUMNS


@pytest.mark.parametrize("name", ["methods", "paper", "bake", "gather", "peers", "classification"])
def test_stored_tables_have_twenty_to_thirty_columns_for_people(name):
    table = read_table(ROOT / "reports" / "reference" / name / "table.parquet")
    chosen = csv_columns(table)
    assert 20 <= len(chosen) <= MOST_COLUMNS
    assert table[chosen].notna().any().all()
