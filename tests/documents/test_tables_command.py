"""`python run.py tables`: rows below their marks are written anew, and a check says what differs."""

import pytest

from atra.errors import InputError
from experiments.documents import writing
from experiments.documents.quotation import mark

PAGE = f"text\n\n{mark('speeds')}\n| scene | speed |\n|---|---:|\n| box | 1.00 |\n\nIt is 1.00 times as fast.\n"


class Quoted:
    page, sweep, name = "page.md", "methods", "speeds"

    def rows_and_phrases(self):
        return ["| box | 2.00 |"], ["It is 2.00 times as fast"]


@pytest.fixture
def page(tmp_path, monkeypatch):
    monkeypatch.setattr(writing, "ROOT", tmp_path)
    monkeypatch.setattr(writing, "QUOTATIONS", (Quoted(),))
    monkeypatch.setattr(writing, "folders", list)
    path = tmp_path / "page.md"
    path.write_text(PAGE, encoding="utf-8")
    return path


def test_rows_are_written_and_phrases_that_a_page_lacks_are_told(page, capsys):
    writing.run_tables([])
    assert page.read_text(encoding="utf-8") == PAGE.replace("| 1.00 |", "| 2.00 |")
    told = capsys.readouterr().out
    assert "page.md: rows of speeds" in told
    assert "page.md, from methods, does not say: It is 2.00 times as fast" in told


def test_a_check_writes_nothing_and_fails_where_a_number_differs(page):
    with pytest.raises(InputError, match=r"2 of the tables' numbers stand otherwise; run: python run.py tables"):
        writing.run_tables(["check=true"])
    assert page.read_text(encoding="utf-8") == PAGE
    page.write_text(PAGE.replace("1.00", "2.00"), encoding="utf-8")
    writing.run_tables(["check=true"])


def test_another_argument_is_refused(page):
    with pytest.raises(InputError, match="tables takes check=true alone, not check; usage"):
        writing.run_tables(["check"])
