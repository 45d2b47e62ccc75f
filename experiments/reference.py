"""Pages of the reference that Sphinx cannot make of docstrings: command line, configuration keys, columns of tables."""

from __future__ import annotations

import re
from argparse import SUPPRESS, ArgumentParser
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from typing import Any

from omegaconf import OmegaConf

from atra.command.baking import add_bake
from atra.command.render import add_render
from atra.command.viewing import add_view
from experiments.harness.column import TEXT, Column, default_of, option_columns
from experiments.harness.configuration import CONFIGURATION, Configuration
from experiments.harness.options import types_of
from experiments.methods import METHODS
from experiments.results.table import columns
from experiments.workloads import WORKLOADS


def command_line() -> str:
    """The verbs of the harness, and the options of those of the library that have no keys."""
    header = OmegaConf.load(CONFIGURATION / "config.yaml").hydra.help.header
    verbs = re.findall(r"^python run\.py ([a-z][a-z-]*) (?:.*?\S)?  +(\S.*)$", header, re.MULTILINE)
    parts = [
        "## Command line\n",
        "`atra VERB key=value …`, or in a clone `python run.py VERB key=value …`. Without a verb it measures.\n",
        _table(("verb", "what it does"), ((_code(verb), what) for verb, what in verbs)),
    ]
    for verb, add, what in (
        ("render", add_render, "Writes what every view of a mesh sees, or a picture in full light."),
        ("view", add_view, "Shows a mesh with its materials and lights on a page of the browser."),
        ("bake", add_bake, "Makes a lightmap of a mesh with its materials and lights."),
    ):
        parser = ArgumentParser()
        add(parser)
        rows = [
            (
                " ".join(map(_code, action.option_strings)) or _code(action.dest),
                "required" if action.required else _code("" if action.default is None else str(action.default)),
                _with_choices(action.help or "", action.choices),
            )
            for action in parser._actions
            if action.default != SUPPRESS
        ]
        parts += [f"### `atra {verb} MESH`\n", f"{what} It needs the library alone.\n"]
        parts.append(_table(("option", "default", "meaning"), rows))
    return "\n".join(parts)


def configuration_keys() -> str:
    """A table for the keys that every run has, and one for each method and workload."""
    head = ("key", "type", "default", "meaning")
    parts = [
        "## Configuration keys\n",
        "Set on the command line as `key=value`. An unknown key is an error. A list needs brackets: "
        "`'scene.eye=[0,1,3]'`.\n",
        _table(head, _keys(Configuration, "")),
    ]
    for group, kinds in (("method", METHODS), ("workload", WORKLOADS)):
        for kind in kinds:
            keys = list(_keys(kind.options, f"{group}."))
            parts += [f"### `{group}={kind.name}`\n", _table(head, keys) if keys else "No keys of its own.\n"]
    return "\n".join(parts)


def _keys(kind: type, path: str) -> Iterator[Sequence[str]]:
    for spec in fields(kind):
        if is_dataclass(spec.default_factory):
            yield from _keys(spec.default_factory, f"{path}{spec.name}.")  # type: ignore[arg-type]
            continue
        hint, told = types_of(kind)[spec.name], spec.metadata
        is_enum = isinstance(hint, type) and issubclass(hint, Enum)
        choices = [member.value for member in hint] if is_enum else told.get("choices")
        default = default_of(spec)
        given = "required" if default in (MISSING, "???") else OmegaConf.to_yaml([default]).strip().removeprefix("- ")
        yield (
            _code(f"{path}{spec.name}"),
            "" if is_enum else _code(str(spec.type).replace(" | ", " or ")),
            given if given == "required" else _code(given),
            _with_choices(told.get("help", ""), choices, told.get("unit")),
        )


def table_columns() -> str:
    """The columns of `table.parquet`: what was measured, by workload and method, and what describes the point."""
    options = {
        column.name
        for kinds, section in ((METHODS, "method_options"), (WORKLOADS, "workload_options"))
        for kind in kinds
        for column in option_columns(kind.options, section)
    }
    left = dict(columns())
    parts = []
    measured = [(f"Measured by `workload={kind.name}`", kind.columns) for kind in WORKLOADS]
    counted = [(f"Counted by `method={kind.name}`", kind.counters) for kind in METHODS]
    for title, own in (*measured, *counted):
        first = [column for column in own if left.pop(column.name, None) is not None]
        if first:
            parts.append(f"### {title}\n\n{_columns(first)}")
    point = [column for name, column in left.items() if name not in options]
    return "\n".join(
        [
            "## Table columns\n",
            "A row of `table.parquet` is a point; a row of `processes.parquet` is a process that measured it. Every\n"
            "key of a method or workload above is a column of the same name. A column that several workloads or\n"
            "methods share stands with the first of them. What was not measured is missing, never zero.\n",
            f"### Columns of every point\n\n{_columns(point)}",
            *parts,
        ]
    )


def _columns(some: Iterable[Column]) -> str:
    types = {TEXT: "text", "Int64": "whole number", "Float64": "number", "boolean": "true or false"}
    rows = ((_code(column.name), types[column.dtype], column.unit, column.help) for column in some)
    return _table(("column", "type", "unit", "meaning"), rows)


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|").replace("\n", " ") for cell in row) + " |" for row in rows]
    return "\n".join([f"| {' | '.join(head)} |", "|---" * len(head) + "|", *lines]) + "\n"


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


def _with_choices(meaning: str, choices: Iterable[Any] | None, unit: str | None = None) -> str:
    listed = ", ".join(_code(str(choice)) for choice in choices or ())
    return "; ".join([meaning, *([f"one of {listed}"] if listed else []), *([unit] if unit else [])])
