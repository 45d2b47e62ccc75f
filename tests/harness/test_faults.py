"""Faults of disk and hand while a sweep runs: a clear refusal or a row, and never a wrong number."""

import errno
import os
import tempfile
from dataclasses import replace

import pandas as pd
import pytest

from atra.errors import InputError, RecordError, StorageError
from experiments.harness.identity import current_environment, identity
from experiments.harness.points import measure, plan_points
from experiments.harness.records import load_record, record_path, write_record
from experiments.report.writing import rewrite_report
from experiments.results.table import Tables, make_table, make_tables
from experiments.sweep import run_sweep
from tests.harness.test_launched import measured_elsewhere
from tests.report_samples import write_tables
from tests.sweeps import Runner, configuration, files, grid

pytestmark = pytest.mark.usefixtures("figures_unsaved")


def test_a_disk_that_fills_up_between_two_records_loses_no_finished_point(tmp_path, monkeypatch):
    records, rename = tmp_path / "records", os.replace

    def refuse_a_second(source, target):
        if any(not name.startswith(".") for name in files(records)):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        rename(source, target)

    with monkeypatch.context() as filling:
        filling.setattr(os, "replace", refuse_a_second)
        with pytest.raises(
            StorageError, match=r"\.json cannot be written: No space left on device; its old content is untouched"
        ):
            run_sweep(grid(tmp_path, 1, 2, 4), run=Runner())
    assert len(files(records)) == 1
    assert files(tmp_path / "one") == {}
    again = Runner()
    table = run_sweep(grid(tmp_path, 1, 2, 4), run=again)
    assert len(again.points) == 2
    assert list(table["status"]) == ["ok", "ok", "ok"]


def test_a_results_folder_that_takes_no_file_is_refused_before_any_work(tmp_path, monkeypatch):
    def refusing(**_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(tempfile, "TemporaryFile", refusing)
    runner = Runner()
    with pytest.raises(InputError, match=r"cannot be written to .*: Read-only file system; choose another results_dir"):
        run_sweep(grid(tmp_path, 1), run=runner)
    assert runner.points == []


def test_a_report_is_refused_if_a_record_behind_it_is_damaged_and_leaves_that_where_it_is(tmp_path):
    path = record_path(tmp_path / "records", run_sweep(grid(tmp_path, 1), run=Runner())["point_id"][0])
    path.write_text("{")
    with pytest.raises(RecordError, match=rf"{path.name} cannot be read .*start its sweep again"):
        rewrite_report(configuration(tmp_path))
    assert path.exists()
    assert "report.html" not in files(tmp_path / "one")


@pytest.mark.parametrize("field", ["cpu", "code_sha256"])
def test_a_table_of_another_machine_or_version_is_told_and_its_points_are_measured_anew(tmp_path, field, capsys):
    (planned,) = plan_points([configuration(tmp_path)])
    foreign = measured_elsewhere(planned, **{field: "another"})
    kept = write_record(tmp_path / "records", foreign)
    write_tables(tmp_path / "one", make_tables([foreign]))
    (tmp_path / "one" / "command.txt").write_text("run.py measure.time_limit_s=10 sweep=one\n")
    points, runner = grid(tmp_path, 1), Runner()
    table = run_sweep(points, command="run.py sweep=one measure.time_limit_s=20", run=runner)
    assert len(runner.points) == 1
    assert points[0].configuration.sweep.name == "one"  # in the same folder, though a limit is another
    assert list(table["point_id"]) == [identity(planned.point, current_environment())]
    told = capsys.readouterr().err
    assert f"is of another machine or version ({field} is 'another' in one and " in told
    assert (load_record(kept.parent, kept.stem) == foreign) == (field == "cpu")  # a record of other code is replaced


def test_a_table_of_another_layout_is_told_and_replaced(tmp_path, capsys):
    (tmp_path / "one").mkdir()
    pd.DataFrame({"scene": ["box"]}).to_parquet(tmp_path / "one" / "table.parquet")
    with pytest.raises(InputError, match="cannot be read as a table of this version"):
        rewrite_report(configuration(tmp_path))
    assert len(run_sweep(grid(tmp_path, 1), run=Runner())) == 1
    assert "cannot be read as a table of this version" in capsys.readouterr().err


@pytest.mark.parametrize(("field", "with_records"), [("cpu", True), ("cpu", False), ("embree_version", True)])
def test_a_report_of_two_machines_or_versions_is_refused(tmp_path, field, with_records):
    planned = plan_points([configuration(tmp_path, split_x=split) for split in (1, 2)])
    records = [measure(planned[0], Runner()), measured_elsewhere(planned[1], **{field: "another"})]
    for record in records if with_records else []:
        write_record(tmp_path / "records", record)
    # No sweep makes such a table; a hand does.
    table = pd.concat([make_tables([record]).points for record in records], ignore_index=True)
    write_tables(tmp_path / "one", Tables(table, table))
    with pytest.raises(InputError, match="another"):
        rewrite_report(configuration(tmp_path))
    assert "report.html" not in files(tmp_path / "one")


def test_a_report_of_another_machine_names_that_machine(tmp_path):
    (planned,) = plan_points([configuration(tmp_path)])
    foreign = measured_elsewhere(planned, cpu="a cpu far away")
    write_record(tmp_path / "records", foreign)
    write_tables(tmp_path / "one", make_tables([foreign]))
    assert "a cpu far away" in rewrite_report(configuration(tmp_path)).read_text(encoding="utf-8")


def warnings(record):
    told = make_table([record])["warnings"][0]
    return "" if pd.isna(told) else told


@pytest.mark.parametrize("method", ["own", "packets_8"])
@pytest.mark.parametrize(("sample", "told"), [
    (3_600.0, "longest sample is 36,000 times the median"),
    (0.001, "median is 100 times the shortest sample"),
    (0.9, ""),
    (0.02, ""),
])  # fmt: skip
def test_a_sample_out_of_all_proportion_is_flagged_and_stays(tmp_path, method, sample, told):
    (planned,) = plan_points([configuration(tmp_path)])
    record = measure(planned, Runner())
    odd = replace(record, samples={**record.samples, method: [0.1, sample, 0.1]})
    assert told in warnings(odd)
    assert ("times the" in warnings(odd)) == bool(told)
    assert load_record(tmp_path, write_record(tmp_path, odd).stem) == odd


@pytest.mark.slow
@pytest.mark.parametrize("variable", ["NUMBA_CACHE_DIR", "PYTHONPYCACHEPREFIX"])
def test_a_folder_for_code_that_takes_no_file_costs_a_worker_time_and_no_more(tmp_path, monkeypatch, variable):
    (tmp_path / "file").touch()
    monkeypatch.setenv(variable, str(tmp_path / "file" / "folder"))
    (planned,) = plan_points([configuration(tmp_path)])
    record = measure(planned)
    assert (record.status, record.error) == ("ok", None)
    assert record.results["pixels_wrong"] == 0
