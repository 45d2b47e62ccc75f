"""Processes of studies, tables that they add to, and how a study is asked for."""

import builtins
import dis
import inspect

import pandas as pd
import pytest

from atra.errors import InputError
from experiments.studies.__main__ import STUDIES, run
from experiments.studies.first_image import first_answers
from experiments.studies.lens_speed import timed
from experiments.studies.paired import frames
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


@pytest.mark.parametrize("given", [(), ("roofline",)])
def test_a_study_that_there_is_not_is_refused_with_those_that_there_are(given):
    with pytest.raises(InputError, match="expected one of candidates, first_image"):
        run(given)


def test_an_option_that_a_study_has_not_is_refused_by_name():
    with pytest.raises(InputError, match="paired: got an unexpected keyword argument 'scenez'"):
        run(["paired", "other", "table.parquet", "scenez=box"])
