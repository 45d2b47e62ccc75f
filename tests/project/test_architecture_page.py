"""docs/architecture.md names rooms, files and folders that are there, and every room of the library."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.uncovered

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")


def test_every_place_that_the_page_names_is_there():
    named = re.findall(r"`((?:atra|experiments|conf|scenes|tests|reports)/[\w/.]*)`", PAGE)
    assert len(named) > 15
    assert [one for one in named if not (ROOT / one).exists()] == []


def test_the_diagram_has_every_room_of_the_library_and_no_other():
    drawn = set(re.findall(r'\b(\w+)\["(\w+)', PAGE))
    there = {path.parent.name for path in (ROOT / "atra").glob("*/__init__.py")}
    assert {room for _, room in drawn} == there
