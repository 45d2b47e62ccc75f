"""The program of mutations: what it says of a toy project, and that its list fits ours."""

import subprocess
from pathlib import Path

import pytest

from tests.mutations import MUTATIONS
from tests.mutations.__main__ import main
from tests.mutations.mutation import ListError, Mutation
from tests.mutations.running import check_list

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
LARGER = Mutation("larger", "toy.py", "a > b", "a < b", "the smaller is taken", ("test_toy.py::test_larger",))
HALF = Mutation(
    "half", "toy.py", "a / 2", "a / 3", "a third is taken", ("test_toy.py::test_half", "test_toy.py::test_half_of_more")
)


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """A project of one file and its tests, where pytest starts at once, without the plugins that are installed here."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    root = tmp_path / "toy"
    root.mkdir()
    (root / "toy.py").write_text(SOURCE)
    (root / "test_toy.py").write_text(TESTS)
    (root / "pytest.ini").write_text("[pytest]\nmarkers = slow\n")
    subprocess.run(["git", "init", "-q"], cwd=root, check=True)
    return root


def test_a_caught_mutation_is_named_with_its_tests_and_the_project_stays_as_it_was(toy, tmp_path, capsys):
    table = tmp_path / "table.md"
    assert main(["--table", str(table)], toy, [LARGER]) == 0
    assert "1 of 1 mutations were caught by fast tests" in capsys.readouterr().out
    row = "| larger | `toy.py` | the smaller is taken | `test_toy.py::test_larger` (2 cases) |"
    assert row in table.read_text().splitlines()
    assert (toy / "toy.py").read_text() == SOURCE


@pytest.mark.parametrize(("which", "code", "said"), [
    ((), 1, "half: survived"), (("--all-tests",), 0, "`test_toy.py::test_half_of_more`"),
])  # fmt: skip
def test_a_mutation_that_only_slow_tests_catch_survives_the_fast_ones(which, code, said, toy, tmp_path, capsys):
    assert main(["--folder", str(tmp_path / "kept"), *which], toy, [HALF]) == code
    assert said in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "kept").iterdir()] == ["unmutated"]


def test_tests_that_take_too_long_catch_nothing_and_those_that_fail_without_a_mutation_judge_nothing(toy, capsys):
    assert main(["--timeout", "0.001"], toy, [LARGER]) == 1
    assert "larger: timed out" in capsys.readouterr().out
    assert main(["--only", "smaller"], toy, [LARGER]) == 2
    assert "unknown mutation 'smaller'" in capsys.readouterr().err
    (toy / "toy.py").write_text(SOURCE.replace("a if", "b if"))
    assert main([], toy, [LARGER]) == 2
    assert "they must pass, and did not" in capsys.readouterr().err


@pytest.mark.parametrize(("old", "count"), [("a < b", 0), ("a", 7)])
def test_text_that_is_missing_or_ambiguous_is_refused_before_any_test_runs(old, count, toy, capsys):
    unfit = Mutation("unfit", "toy.py", old, "x", "nothing", ("test_toy.py::test_half",))
    assert main([], toy, [LARGER, unfit]) == 2
    said = capsys.readouterr()
    assert f"mutation unfit: toy.py holds {old!r} {count} times, expected once" in said.err
    assert not said.out


@pytest.mark.parametrize(("fields", "message"), [
    ({"name": "Two Words"}, "a mutation is called 'Two Words'"),
    ({"new": "a > b"}, "it replaces 'a > b' by 'a > b'"),
    ({"caught_by": ("test_toy.py",)}, "caught_by is"),
])  # fmt: skip
def test_an_entry_that_cannot_be_is_refused(fields, message):
    with pytest.raises(ListError, match=message):
        Mutation(**(vars(LARGER) | fields))


def test_every_mutation_of_the_list_fits_the_code_and_names_tests_that_are_there():
    check_list(ROOT, MUTATIONS)
    for mutation in MUTATIONS:
        for test in mutation.caught_by:
            path, _, name = test.partition("::")
            assert f"def {name.partition('[')[0]}(" in (ROOT / path).read_text(encoding="utf-8"), test
