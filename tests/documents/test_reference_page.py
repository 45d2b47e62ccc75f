"""docs/reference.md is what `python -m experiments.reference` makes of the code, and says what everything means."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import Enum

import pytest

import atra
from experiments.reference.page import PAGE, reference
from experiments.reference.writing import choices_of, help_of, say_type, table
from experiments.results.table import columns


class Colour(Enum):
    """What it looks like."""

    red = "red"
    blue = "blue"


@dataclass
class Paint:
    """width, height: millimetres. weight: grams, of 1: light. Raises ValueError for none."""

    width: int
    height: int
    weight: float = field(default=1.0)
    colour: Colour = Colour.red
    layers: int = field(default=2, metadata={"help": "coats", "choices": (1, 2)})


def sections():
    _, *parts = re.split(r"^## (.*)$", reference(), flags=re.M)
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_stored_reference_is_the_one_that_the_code_makes():
    assert PAGE.read_text(encoding="utf-8") == reference(), "run: python -m experiments.reference"


def test_every_public_name_is_in_the_reference():
    for name in atra.__all__:
        assert f"#### `atra.{name}`\n" in sections()["Public names"]


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


def test_a_meaning_comes_from_metadata_docstring_or_enum():
    of = {name: help_of(Paint, one) for name, one in Paint.__dataclass_fields__.items()}
    assert of == {
        "width": "millimetres.",
        "height": "millimetres.",
        "weight": "grams, of 1: light.",
        "colour": "What it looks like.",
        "layers": "coats",
    }


def test_choices_come_from_metadata_or_from_an_enum():
    assert choices_of(int, Paint.__dataclass_fields__["layers"]) == ("1", "2")
    assert choices_of(Colour | None) == ("red", "blue")
    assert choices_of(int) == ()


def test_types_are_written_without_the_modules_they_come_from():
    assert say_type("atra.geometry.mesh.Mesh | None") == "Mesh or None"
    assert say_type("NDArray[np.float64]") == "NDArray[np.float64]"


def test_a_bar_in_a_cell_does_not_end_it():
    assert table(("a",), [("x|y",)]) == "| a |\n|---|\n| x\\|y |\n"
