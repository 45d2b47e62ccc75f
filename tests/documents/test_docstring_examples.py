"""Examples in docstrings of public names run and print what they say."""

from __future__ import annotations

import doctest
import inspect

import numpy as np
import pytest

import atra
from atra import light

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
