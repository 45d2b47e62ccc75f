"""The page: public names, the command line, configuration keys, and columns of result tables."""

from __future__ import annotations

from pathlib import Path

from experiments.reference.names import public_names
from experiments.reference.settings import command_line, configuration_keys, table_columns

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference.md"

_BEGINNING = """\
# Reference

This page is generated from the code: `python -m experiments.reference` writes it. Do not edit it.
It lists the [public names](#public-names), the [options of the command line](#command-line), the
[keys of the configuration](#configuration-keys) and the [columns of result tables](#table-columns).
A unit stands at the end of a name: `_s` is seconds, `_bytes` bytes, `_gib` GiB, `_degrees` degrees.
"""


def reference() -> str:
    """The page as text."""
    parts = (_BEGINNING, public_names(), command_line(), configuration_keys(), table_columns())
    return "\n".join(parts)
