"""Pages of the reference that Sphinx cannot make of docstrings: command line, configuration keys, columns of tables."""

from __future__ import annotations

from argparse import ArgumentParser, HelpFormatter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, fields, is_dataclass
from functools import partial

from omegaconf import OmegaConf

from atra.command.baking import add_bake
from atra.command.render import add_render
from atra.command.viewing import add_view
from experiments.harness.column import TEXT, Column, default_of, option_columns
from experiments.harness.configuration import CONFIGURATION, Configuration
from experiments.harness.options import say_option, say_type, types_of
from experiments.methods import METHODS
from experiments.results.table import columns
from experiments.workloads import WORKLOADS


def command_line() -> str:
    """The verbs of the harness, and the help of those of the library that have no keys."""
    helps = [OmegaConf.load(CONFIGURATION / "config.yaml").hydra.help.header]
    helps += [parser.format_help() for parser in parsers()]
    return "\n".join(["## Command line\n", *(f"```text\n{text.strip()}\n```\n" for text in helps)])


def parsers() -> Iterator[ArgumentParser]:
    """What reads the options of the library's verbs."""
    for verb, add in (("render", add_render), ("view", add_view), ("bake", add_bake)):
        parser = ArgumentParser(f"atra {verb}", formatter_class=partial(HelpFormatter, width=100))
        add(parser)
        yield parser


def configuration_keys() -> str:
    """A table for the keys that every run has, and one for each method and workload."""
    parts = [
        "## Configuration keys\n",
        "Set on the command line as `key=value`. An unknown key is an error. A list needs brackets: "
        "`'scene.eye=[0,1,3]'`.\n",
        _key_table(Configuration, ""),
    ]
    for group, kinds in (("method", METHODS), ("workload", WORKLOADS)):
        parts += [f"### `{group}={kind.name}`\n\n{_key_table(kind.options, f'{group}.')}" for kind in kinds]
    return "\n".join(parts)


def _key_table(kind: type, path: str) -> str:
    rows = list(_keys(kind, path))
    return _table(("key", "type", "default", "meaning"), rows) if rows else "No keys of its own.\n"


def _keys(kind: type, path: str) -> Iterator[Sequence[str]]:
    for spec in fields(kind):
        default = default_of(spec)
        if is_dataclass(default):
            yield from _keys(type(default), f"{path}{spec.name}.")
            continue
        known = default not in (MISSING, "???")
        given = f"`{OmegaConf.to_yaml([default]).strip().removeprefix('- ')}`" if known else "required"
        yield f"`{path}{spec.name}`", say_type(types_of(kind)[spec.name]), given, say_option(spec)


def table_columns() -> str:
    """The columns of `table.parquet`: what was measured, by workload and method, and what describes the point."""
    options = {
        column.name
        for kinds, section in ((METHODS, "method_options"), (WORKLOADS, "workload_options"))
        for kind in kinds
        for column in option_columns(kind.options, section)
    }
    left = dict(columns())
    measured = [(f"Measured by `workload={kind.name}`", kind.columns) for kind in WORKLOADS]
    counted = [(f"Counted by `method={kind.name}`", kind.counters) for kind in METHODS]
    own = {
        title: [column for column in its if left.pop(column.name, None) is not None]
        for title, its in (*measured, *counted)
    }
    point = [column for name, column in left.items() if name not in options]
    return "\n".join(
        [
            "## Table columns\n",
            "A row of `table.parquet` is a point; a row of `processes.parquet` is a process that measured it. Every\n"
            "key of a method or workload above is a column of the same name. A column that several workloads or\n"
            "methods share stands with the first of them. What was not measured is missing, never zero.\n",
            f"### Columns of every point\n\n{_columns(point)}",
            *(f"### {title}\n\n{_columns(first)}" for title, first in own.items() if first),
        ]
    )


def _columns(some: Iterable[Column]) -> str:
    types = {TEXT: "text", "Int64": "whole number", "Float64": "number", "boolean": "true or false"}
    rows = ((f"`{column.name}`", types[column.dtype], column.unit, column.help) for column in some)
    return _table(("column", "type", "unit", "meaning"), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [" | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) for row in rows]
    return "\n".join(f"| {line} |" for line in [" | ".join(head), " | ".join("---" for _ in head), *lines]) + "\n"
