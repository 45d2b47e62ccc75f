"""The reference of the code: it is complete, says what everything means, and its examples print what they say."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
import runpy
import sys
from types import ModuleType

import numpy as np
import pytest

import atra
from atra import light
from experiments.reference import command_line, configuration_keys, parsers, table_columns
from experiments.results.table import columns
from tests.folders import ROOT


@pytest.fixture
def parts(monkeypatch):
    """docs/site_parts.py, without Sphinx's gallery."""
    scrapers = ModuleType("sphinx_gallery.scrapers")
    scrapers.figure_rst = None
    monkeypatch.setitem(sys.modules, "sphinx_gallery", ModuleType("sphinx_gallery"))
    monkeypatch.setitem(sys.modules, "sphinx_gallery.scrapers", scrapers)
    return runpy.run_path(str(ROOT / "docs" / "site_parts.py"))


def test_every_public_name_stands_on_one_page_of_the_reference(parts):
    pages = parts["PUBLIC_NAMES"].values()
    for package in ("atra", "atra.light"):
        listed = [name for _, of, names in pages if of == package for name in names.split()]
        assert sorted(listed) == sorted(importlib.import_module(package).__all__)


def test_every_example_is_run_for_the_gallery(parts):
    examples = {path.stem for path in (ROOT / "examples").glob("*.py") if "\ndef main(" in path.read_text("utf-8")}
    assert set(parts["_ARGUMENTS"]) == examples


def test_links_to_files_outside_of_the_pages_become_their_names(parts):
    source = ["[table](../reports/reference/rays), [all](../reports/reference/tables.md#rays), [rays](rays.md)"]
    parts["link_to_the_repository"](None, "methods", source)
    assert source == ["table (`reports/reference/rays`), [all](reference/tables.md#rays), [rays](rays.md)"]


def test_every_option_key_and_column_says_what_it_means_in_a_phrase_that_stands_alone():
    rows = [line for text in (configuration_keys(), table_columns()) for line in text.splitlines() if line[:3] == "| `"]
    options = [action.help or "" for parser in parsers() for action in parser._actions]
    helps = [*(row.split("|")[-2].strip() for row in rows), *options]
    assert len(rows) > 400
    assert len(options) > 40
    assert all(helps)
    leaning = re.compile(r"(of|and|these|those|that|the same|what it|until|finding|making|theirs|ours|its|their)\b")
    assert [text for text in helps if leaning.match(text)] == []


def test_the_command_line_is_the_help_of_every_verb():
    page = command_line()
    for told in ("python run.py report sweep=horizontal", "usage: atra render", "usage: atra view", "usage: atra bake"):
        assert told in page


def test_every_column_of_a_result_table_is_in_the_reference():
    """As a column, or as the key of the same name."""
    listed = set(re.findall(r"^\| `(?:\w+\.)?(\w+)`", configuration_keys() + table_columns(), re.M))
    assert set(columns()) <= listed


NAMES = {name: getattr(package, name) for package in (atra, light) for name in package.__all__}
EXAMPLES = {name: found for name, found in NAMES.items() if ">>> " in (inspect.getdoc(found) or "")}


def test_most_public_functions_have_an_example():
    functions = [name for name, found in NAMES.items() if inspect.isfunction(found)]
    assert len(set(functions) & set(EXAMPLES)) > len(functions) / 2


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_example_of_a_docstring_prints_what_it_says(name, capsys):
    (example,) = doctest.DocTestFinder(recurse=False).find(EXAMPLES[name], name, globs={"np": np})
    failed, tried = doctest.DocTestRunner().run(example)
    assert tried > 0
    assert failed == 0, capsys.readouterr().out
