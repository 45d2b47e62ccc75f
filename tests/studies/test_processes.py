"""Studies: processes and the tables they add to, this version against another, and how a study is asked for."""

import builtins
import dis
import inspect
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from atra.errors import InputError
from experiments.studies.__main__ import STUDIES, run
from experiments.studies.first_image import first_answers
from experiments.studies.lens_speed import timed
from experiments.studies.paired import frames, ratios
from experiments.studies.processes import HERE, Turn, add_rows, in_processes


def who(asked, variable="HOME"):
    import os

    return [{"pid": os.getpid(), "asked": asked, "variable": os.environ.get(variable)}]


def broken():
    raise ValueError("the lamp is out")


def test_every_row_is_of_a_process_of_its_own_and_turns_change_their_order():
    turns = [Turn({"asked": name}, {"version": name.upper()}, environment={"HOME": "/nowhere"}) for name in "ab"]
    rows = in_processes(who, 2, *turns)
    assert rows["pid"].nunique() == 4
    assert rows["process"].tolist() == [0, 0, 1, 1]
    assert rows["asked"].tolist() == ["a", "b", "b", "a"]
    assert rows["version"].tolist() == ["A", "B", "B", "A"]
    assert set(rows["variable"]) == {"/nowhere"}
    assert {"processor", "cores", "commit"} <= set(rows)


def test_a_process_that_fails_says_which_function_and_why():
    with pytest.raises(RuntimeError, match=r"(?s)broken failed in .*the lamp is out"):
        in_processes(broken, 1)


def globals_of(code):
    """Names that it and the functions in it look up outside of themselves."""
    names = {step.argval for step in dis.get_instructions(code) if step.opname == "LOAD_GLOBAL"}
    return names.union(*(globals_of(inner) for inner in code.co_consts if inspect.iscode(inner)))


@pytest.mark.parametrize("function", [first_answers, frames, timed], ids=lambda function: function.__name__)
def test_what_a_study_runs_elsewhere_imports_all_that_it_uses(function):
    assert globals_of(function.__code__) <= {*dir(builtins), "json", "sys"}


@pytest.mark.parametrize("name", ["table.csv", "table.parquet"])
def test_rows_are_added_to_those_that_a_table_has(tmp_path, name):
    first, second = pd.DataFrame([{"ms": 1.5, "run": 0}]), pd.DataFrame([{"ms": 2.5, "run": 1}])
    assert add_rows(tmp_path / "new" / name, first)["ms"].tolist() == [1.5]
    assert add_rows(tmp_path / "new" / name, second)["ms"].tolist() == [1.5, 2.5]


def test_every_study_is_a_file_of_its_own():
    files = {path.stem for path in (HERE / "experiments" / "studies").glob("[!_]*.py")} - {"processes"}
    assert files == {path.rpartition(".")[2] for path in STUDIES.values() if path.startswith("experiments.studies")}


@pytest.mark.parametrize(("given", "told"), [
    ([], "expected one of candidates, first_image"), (["roofline"], "expected one of candidates, first_image"),
    (["paired", "other", "table.parquet", "scenez=box"], "paired: got an unexpected keyword argument 'scenez'"),
])  # fmt: skip
def test_a_study_or_an_option_that_there_is_not_is_refused(given, told):
    with pytest.raises(InputError, match=told):
        run(given)


CLONE = Path(__file__).resolve().parents[2]


def _rows(other_ms, this_ms, digests=("a", "a")):
    same = {"instruction_set": "native", "threads": 1, "what": "image", "scene": "box"}
    return pd.DataFrame([
        {**same, "version": version, "process": process, "median_ms": ms, "least_ms": 0.5 * ms, "digest": digest}
        for version, times, digest in (("other", other_ms, digests[0]), ("this", this_ms, digests[1]))
        for process, ms in enumerate(times)
    ])  # fmt: skip


def test_a_ratio_is_the_mean_of_the_ratios_of_processes_that_took_turns():
    # The machine was twice as slow in the second turn, for both.
    found = ratios(_rows([2.0, 4.0, 2.0], [1.0, 2.0, 1.0]))
    assert found["ratio"].tolist() == ["2.000 [2.000, 2.000]"]
    assert found["ratio_of_least"].tolist() == [2.0]


def test_an_interval_comes_from_the_spread_of_the_processes():
    # Logarithms -1, 0, 1 in units of log 2: standard error 1 / sqrt(3), Student's 4.303 with two degrees of freedom.
    found = ratios(_rows([0.5, 1.0, 2.0], [1.0, 1.0, 1.0]))["ratio"].item()
    half = 2 ** (4.302653 / 3**0.5)
    assert found == f"1.000 [{1 / half:.3f}, {half:.3f}]"


def test_different_images_are_said_and_a_version_without_its_rival_has_no_ratio():
    assert ratios(_rows([1.0] * 3, [1.0] * 3, ("a", "b")))["same"].tolist() == ["no"]
    rows = _rows([1.0] * 3, [1.0] * 3)
    assert ratios(rows)["same"].tolist() == ["yes"]
    assert ratios(rows[rows["version"] == "this"]).empty


@pytest.mark.slow
def test_a_clone_beside_itself_draws_the_same_images(tmp_path):
    other = tmp_path / "other"
    (other / ".venv" / "bin").mkdir(parents=True)
    (other / ".venv" / "bin" / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    (other / ".venv" / "bin" / "python").chmod(0o755)
    (other / "atra").symlink_to(CLONE / "atra")
    table = tmp_path / "table.parquet"
    command = [sys.executable, "-m", "experiments.studies", "paired", str(other), str(table), "processes=3"]
    chosen = ["scenes=cornell_box,", "source=procedural", "asked=image,packets", "size=64", "count=2"]
    told = subprocess.run([*command, *chosen], cwd=CLONE, capture_output=True, text=True, check=True)
    rows = pd.read_parquet(table)
    assert len(rows) == 2 * 2 * 3
    assert set(rows["what"]) == {"image", "packets"}
    assert rows.groupby("what")["digest"].nunique().tolist() == [1, 1]
    assert told.stdout.count("yes") == 2
