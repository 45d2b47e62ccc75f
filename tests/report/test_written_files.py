"""The files beside a table are made of that table: what was made of an earlier one goes, all are written or none."""

import errno
import os
import tempfile
from html import escape
from shutil import rmtree

import pytest

from atra.errors import StorageError
from experiments.harness.configuration import results_folder
from experiments.harness.points import measure, plan_points
from experiments.harness.records import write_record
from experiments.report.writing import rewrite_report, write_results
from experiments.results.table import make_tables, read_tables
from experiments.sweep import run_sweep
from tests.sweeps import Runner, configuration, files, grid

pytestmark = pytest.mark.usefixtures("figures_unsaved")

TABLES = {"command.txt", "processes.parquet", "table.csv", "table.parquet"}
FIGURE = {"figure5.png", "figure5.svg"}
PAGE = {"report.html", "claims.json", "claims.csv"}


DRAWN = {"figures": {"figure5": ["one"]}}


def sweep(folder, *splits, **fields):
    return run_sweep(grid(folder, *splits, **fields), command="run.py sweep=one", run=Runner())


def test_figures_claims_and_page_of_an_earlier_table_are_gone_and_not_told_as_results(tmp_path, capsys):
    sweep(tmp_path, 1, 2, report=True, **DRAWN)
    assert set(files(tmp_path / "one")) == TABLES | FIGURE | PAGE
    capsys.readouterr()
    sweep(tmp_path, 1, 4)
    assert set(files(tmp_path / "one")) == TABLES
    told = capsys.readouterr().out
    assert not [name for name in FIGURE | PAGE if name in told]
    sweep(tmp_path, 1, 4, **DRAWN)
    assert set(files(tmp_path / "one")) == TABLES | FIGURE


OLD = (
    "report.html", "claims.csv", "bake_claims.json", "predictions/claims.csv", "figure5.svg", "peers.png",
    "figure5_packets_of_8.png", "figure5_single_rays.svg", "disagreements.csv", "disagreements_box_own_64x64.png",
    "break_even.svg", "rays_trimesh.png",
)  # fmt: skip
OWN = ("notes.txt", "figure5_mine.png", "my_report.html", "figure5.pdf", "claims_of_mine.csv", "predictions/mine.csv")


def test_what_any_earlier_version_left_goes_and_files_of_the_user_s_own_stay(tmp_path):
    folder = tmp_path / "one"
    for name in (*OLD, *OWN):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("old")
    sweep(tmp_path, 1)
    assert set(files(folder)) == TABLES | set(OWN)


@pytest.mark.parametrize("with_records", [True, False])
def test_a_report_written_later_is_of_the_table_alone_and_tells_its_machine_and_software(tmp_path, with_records):
    table = sweep(tmp_path, 1, 2, **DRAWN)
    (tmp_path / "one" / "figure5_packets_of_99.png").write_text("old")
    if not with_records:
        rmtree(tmp_path / "records")
    one = configuration(tmp_path)
    one.sweep.figures = {}
    page = rewrite_report(one).read_text(encoding="utf-8")
    found = files(tmp_path / "one")
    assert set(found) >= TABLES | FIGURE | PAGE
    assert "figure5_packets_of_99.png" not in found
    assert "unknown versions" not in page
    for said in (escape(table["cpu"][0]), f"Embree {table['embree_version'][0]}", f"Numba {table['numba_version'][0]}"):
        assert said in page


@pytest.fixture
def pass_of(tmp_path):
    """Writes the results of the first points of a sweep, as it may after each of its passes."""
    configurations = [one.configuration for one in grid(tmp_path, 1, 2, 4, report=True, **DRAWN)]
    records = [measure(planned, Runner()) for planned in plan_points(configurations)]

    def write(count):
        for record in records[:count]:
            write_record(tmp_path / "records", record)
        grids = {record.point_id: ["one"] for record in records}
        return write_results(configurations[0], make_tables(records[:count], grids), "run.py sweep=one")

    write.folder = results_folder(configurations[0])
    return write


def test_results_may_be_written_after_every_pass(pass_of):
    for count in (1, 2, 3):
        assert pass_of(count) == f"report: {pass_of.folder / 'report.html'}"
        assert len(read_tables(pass_of.folder).points) == count
        assert set(files(pass_of.folder)) == TABLES | FIGURE | PAGE


@pytest.mark.parametrize("name", ["table.csv", "table.parquet", "figure5.svg", "report.html", "command.txt"])
def test_a_disk_that_fills_up_between_two_passes_leaves_the_results_of_the_first_and_says_so(
    pass_of, tmp_path, monkeypatch, name
):
    pass_of(1)
    before = files(pass_of.folder)
    make = tempfile.mkstemp

    def full(prefix, **given):
        if prefix == f".{name}.":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return make(prefix=prefix, **given)

    with monkeypatch.context() as filled:
        filled.setattr(tempfile, "mkstemp", full)
        with pytest.raises(StorageError, match=f"{name} cannot be written: No space left on device; its old content"):
            pass_of(2)
    assert files(pass_of.folder) == before
    assert len(list((tmp_path / "records").glob("*.json"))) == 2
    pass_of(2)
    assert len(read_tables(pass_of.folder).points) == 2
