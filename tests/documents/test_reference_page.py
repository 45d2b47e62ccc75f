"""docs/reference.md is what `python -m experiments.reference` makes of the code, and says what everything means."""

from __future__ import annotations

import re
from functools import cache

import pytest

import atra
from experiments.reference.page import PAGE, reference
from experiments.results.table import columns


@cache
def sections():
    _, *parts = re.split(r"^## (.*)$", reference(), flags=re.M)
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_stored_reference_is_the_one_that_the_code_makes():
    assert PAGE.read_text(encoding="utf-8") == reference(), "run: python -m experiments.reference"


def test_every_public_name_is_in_the_reference():
    names = sections()["Public names"]
    for name in atra.__all__:
        assert f"#### `atra.{name}`\n" in names


@pytest.mark.parametrize("section", ["Command line", "Configuration keys", "Table columns"])
def test_every_option_key_and_column_says_what_it_means(section):
    rows = [line for line in sections()[section].splitlines() if line.startswith("| `")]
    assert len(rows) > 10
    assert [row for row in rows if not row.split("|")[-2].strip()] == []


def test_every_column_of_a_result_table_is_in_the_reference():
    """As a column, or as the key of the same name."""
    listed = set(
        re.findall(r"^\| `(?:\w+\.)?(\w+)`", sections()["Configuration keys"] + sections()["Table columns"], re.M)
    )
    assert set(columns()) <= listed
