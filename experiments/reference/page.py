"""Pages of the reference: the command line, configuration keys, and columns of result tables."""

from __future__ import annotations

import re
from argparse import SUPPRESS, ArgumentParser
from collections.abc import Callable, Iterator, Sequence
from dataclasses import Field, fields, is_dataclass
from typing import Any, get_type_hints

from omegaconf import OmegaConf

from atra.command.baking import add_bake
from atra.command.render import add_render
from atra.command.viewing import add_view
from experiments.harness.column import TEXT, Column, option_columns
from experiments.harness.configuration import CONFIGURATION, Configuration
from experiments.harness.method import Method
from experiments.harness.point import Workload
from experiments.methods import METHODS
from experiments.reference.names import (
    choices_of,
    code,
    help_of,
    say_default,
    say_type,
    say_value,
    table,
)
from experiments.results.table import columns
from experiments.workloads import WORKLOADS

_KEYS = ("key", "type", "default", "choices", "unit", "meaning")
_OPTIONS = ("option", "type", "default", "choices", "meaning")
_COLUMNS = ("column", "type", "unit", "meaning")


def command_line() -> str:
    """The verbs of the harness, and the options of those of the library that have no keys."""
    verbs = [(code(verb), what) for verb, what in _said_of_verbs()]
    return "\n".join(
        [
            "## Command line\n",
            "`atra VERB key=value …`, or in a clone `python run.py VERB key=value …`. Without a verb it measures.\n",
            table(("verb", "what it does"), verbs),
            *_options("render", add_render, "Writes what every view of a mesh sees, or a picture in full light."),
            *_options("view", add_view, "Shows a mesh with its materials and lights on a page of the browser."),
            *_options("bake", add_bake, "Makes a lightmap of a mesh with its materials and lights."),
        ]
    )


def _options(verb: str, add: Callable[[ArgumentParser], None], what: str) -> tuple[str, str, str]:
    """A verb of the library with a table of its options."""
    parser = ArgumentParser()
    add(parser)
    rows = [
        (
            " ".join(map(code, action.option_strings)) or code(action.dest),
            code(getattr(action.type, "__name__", "str")) if action.nargs in (None, "+", 2) else "",
            "required" if action.required else code("" if action.default is None else say_value(action.default)),
            ", ".join(map(code, map(str, action.choices or ()))),
            action.help or "",
        )
        for action in parser._actions
        if action.default != SUPPRESS
    ]
    return f"### `atra {verb} MESH`\n", f"{what} It needs the library alone.\n", table(_OPTIONS, rows)


def _said_of_verbs() -> Iterator[tuple[str, str]]:
    """Verbs and what they do, by the help of the command line."""
    header = OmegaConf.load(CONFIGURATION / "config.yaml").hydra.help.header
    yield from re.findall(r"^python run\.py ([a-z][a-z-]*) (?:.*?\S)?  +(\S.*)$", header, re.MULTILINE)


def configuration_keys() -> str:
    """A table for the keys that every run has, and one for each method and workload."""
    parts = [
        "## Configuration keys\n",
        "Set on the command line as `key=value`. An unknown key is an error. A list needs brackets: "
        "`'scene.eye=[0,1,3]'`.\n",
        table(_KEYS, _rows(Configuration, "")),
    ]
    for group, kinds in (("method", METHODS), ("workload", WORKLOADS)):
        for kind in kinds:
            rows = list(_rows(kind.options, f"{group}."))
            parts += [f"### `{group}={kind.name}`\n", table(_KEYS, rows) or "No keys of its own.\n"]
    return "\n".join(parts)


def _rows(kind: type, path: str) -> Iterator[Sequence[str]]:
    hints = get_type_hints(kind)
    for spec in fields(kind):
        if is_dataclass(spec.default_factory):
            yield from _rows(spec.default_factory, f"{path}{spec.name}.")  # type: ignore[arg-type]
            continue
        choices = choices_of(hints[spec.name], spec)
        groups: dict[str, Sequence[Method | Workload]] = {"method": METHODS, "workload": WORKLOADS}
        group = groups.get(f"{path}{spec.name}")
        yield (
            code(f"{path}{spec.name}"),
            "" if choices or group else code(say_type(spec.type)),
            _configured(say_default(spec)),
            ", ".join(map(code, [of.name for of in group] if group else choices)),
            _unit(spec),
            help_of(kind, spec),
        )


def _configured(default: str) -> str:
    """A default as YAML has it."""
    yaml = {"None": "null", "True": "true", "False": "false"}.get(default, default)
    return yaml if yaml == "required" else code(re.sub(r"^'(.*)'$", r"\1", yaml))


def _unit(field: Field[Any]) -> str:
    """What its metadata say, or the ending of its name."""
    return field.metadata.get("unit") or Column(field.name, TEXT).unit


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
            parts.append(f"### {title}\n\n{table(_COLUMNS, map(_column, first))}")
    point = [column for name, column in left.items() if name not in options]
    return "\n".join(
        [
            "## Table columns\n",
            "A row of `table.parquet` is a point; a row of `processes.parquet` is a process that measured it. Every\n"
            "key of a method or workload above is a column of the same name. A column that several workloads or\n"
            "methods share stands with the first of them. What was not measured is missing, never zero.\n",
            f"### Columns of every point\n\n{table(_COLUMNS, map(_column, point))}",
            *parts,
        ]
    )


def _column(column: Column) -> Sequence[str]:
    types = {"string": "text", "Int64": "whole number", "Float64": "number", "boolean": "true or false"}
    return code(column.name), types[column.dtype], column.unit, column.help
