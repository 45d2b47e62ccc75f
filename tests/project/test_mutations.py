"""The tests' own programs: mutations and what they say of a toy project, and coverage that compiles untraced."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from tests.mutations import __main__ as program
from tests.mutations.__main__ import MUTATIONS, Mutation, main

pytestmark = pytest.mark.uncovered


ROOT = Path(__file__).resolve().parents[2]
SOURCE = "def larger(a, b):\n    return a if a > b else b\n\n\ndef half(a):\n    return a / 2\n"
TESTS = """
import pytest
from toy import half, larger

@pytest.mark.parametrize("pair", [(1, 2), (2, 1)])
def test_larger(pair):
    assert larger(*pair) == 2

def test_half():
    assert half(0) == 0

@pytest.mark.slow
def test_half_of_more():
    assert half(4) == 2
"""
LARGER = Mutation("larger", "toy.py", "a > b", "a < b", "the smaller is taken", ["test_toy.py::test_larger"])
HALF = Mutation("half", "toy.py", "a / 2", "a / 3", "a third is taken", ["test_toy.py"
                "::test_half", "test_toy.py::test_half_of_more"])  # fmt: skip


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A project of one file and its tests, where pytest starts at once, without the plugins that are installed here."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    for name, text in {"toy.py": SOURCE, "test_toy.py": TESTS, "pytest.ini": "[pytest]\nmarkers = slow\n"}.items():
        (tmp_path / name).write_text(text)
    subprocess.run("git init -q && git add .", cwd=tmp_path, check=True, shell=True)
    return tmp_path


@pytest.mark.parametrize(("options", "code", "told"), [
    ([], 1, ["larger: caught", "test_toy.py::test_larger[pair1]", "half: survived", "1 of 2 mutations were caught"]),
    (["--all-tests"], 0, ["half: caught", "test_toy.py::test_half_of_more", "2 of 2"]),
    (["--list"], 0, ["half: a third is taken (toy.py)"]),
])  # fmt: skip
def test_mutations_are_told_with_the_tests_that_caught_them_and_files_stay_as_they_were(
    options, code, told, toy, capsys
):
    assert main(options, toy, [LARGER, HALF]) == code
    said = capsys.readouterr().out
    assert [text for text in told if text not in said] == []
    assert (toy / "toy.py").read_text() == SOURCE


def test_tests_that_take_too_long_catch_nothing_and_those_that_fail_without_a_mutation_judge_nothing(
    toy, capsys, monkeypatch
):
    (toy / "toy.py").write_text(SOURCE.replace("a if", "b if"))
    assert main([], toy, [LARGER]) == 2
    assert "its tests must pass, and did not" in capsys.readouterr().err
    monkeypatch.setattr(program, "LIMIT_S", 0.001)
    assert not program.judge(toy, LARGER, SOURCE, [])
    assert "larger: timed out" in capsys.readouterr().out


@pytest.mark.parametrize(("fields", "message"), [
    ({"name": "Two Words"}, "its name is not of small letters"),
    ({"new": "a > b"}, "it changes nothing"),
    ({"caught_by": ["test_toy.py"]}, "caught_by names no test"),
    ({"old": "b > a"}, "toy.py holds 'b > a' 0 times, expected once"),
    ({"old": "a"}, "toy.py holds 'a' 7 times, expected once"),
])  # fmt: skip
def test_an_entry_that_does_not_fit_is_refused_before_any_test_runs(fields, message, toy, capsys):
    assert main([], toy, [LARGER, replace(LARGER, **fields)]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert not said.out


def test_every_mutation_of_the_list_fits_the_code_and_names_tests_that_are_there():
    assert len({mutation.name for mutation in MUTATIONS}) == len(MUTATIONS)
    for mutation in MUTATIONS:
        assert mutation.applied(ROOT)
        for test in mutation.caught_by:
            path, _, name = test.partition("::")
            assert f"def {name.partition('[')[0]}(" in (ROOT / path).read_text(encoding="utf-8"), test


PROGRAM = """\
import sys
from numba import njit
from numba.core.compiler import CompilerBase
seen, compile_ir = [], CompilerBase.compile_extra
def spied(*given):
    seen.append(sys.gettrace())
    return compile_ir(*given)
CompilerBase.compile_extra = spied
@njit
def double(x):
    return 2 * x
def called(x):
    if x > 2:
        x = -x
    return double(x)
import colorsys  # as a file of ours that is run after Numba was imported
print([called(x) for x in (1, 2, 3)], seen == [None], sys.gettrace() is not None)
"""


def test_lines_after_numba_has_compiled_are_counted_as_those_before(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM, encoding="utf-8")
    (tmp_path / ".coveragerc").write_text("[run]\nbranch = true\nplugins = tests.untraced\n", encoding="utf-8")
    variables = {name: value for name, value in os.environ.items() if not name.startswith("COV")}

    def coverage(*arguments):
        command = [sys.executable, "-m", "coverage", *arguments]
        variables["PYTHONPATH"] = str(ROOT)
        return subprocess.run(command, cwd=tmp_path, env=variables, capture_output=True, text=True, check=True).stdout

    assert coverage("run", "--include=program.py", "program.py") == "[2, 4, -6] True True\n"
    coverage("json", "-q", "-o", "found.json")
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))["files"]["program.py"]
    missing = [PROGRAM.splitlines()[number - 1].strip() for number in found["missing_lines"]]
    assert missing == ["seen.append(sys.gettrace())", "return compile_ir(*given)", "return 2 * x"]
    assert found["missing_branches"] == []


def test_what_is_marked_uncovered_runs_without_a_tracer_and_so_do_its_processes():
    assert sys.gettrace() is None
    code = "import sys; print(sys.gettrace(), 'coverage' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "None False\n"
