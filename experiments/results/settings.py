"""Settings: what points of a scene may differ in beside their method. No figure draws those that do as one line."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import fields
from typing import Any

import numpy as np
import pandas as pd

from experiments.methods import METHODS
from experiments.workloads import WORKLOADS

_FIRST = ("subdivided", "copies", "mesh_sha256", "view", "eye", "target", "up", "fov_y_degrees", "width", "height")
_LAST = ("threads", "build_quality", "ties", "instruction_set")

NUMBER = re.compile(r"\d+(?:[.,]\d+)*")


def settings() -> tuple[str, ...]:
    """Columns of the table that points of a scene may differ in beside their method and workload, what explains others
    before them: another view has another eye, too."""
    options = [
        *(field.name for workload in WORKLOADS for field in fields(workload.options)),
        *(field.name for method in METHODS for field in fields(method.options)),
    ]
    return tuple(dict.fromkeys([*_FIRST, *options, *_LAST]))


def settings_that_vary(table: pd.DataFrame, besides: Collection[str] = ()) -> list[str]:
    """The settings, in their order, that tell rows of one scene apart which those before them do not.

    besides: settings that the reader sees anyway; they tell nothing apart here.
    """
    chosen = ["scene"]
    for name in settings():
        # Most settings have one value at most, which is seen without groups.
        varies = name not in besides and name in table and table[name].nunique() > 1
        if varies and table.groupby(chosen, dropna=False)[name].nunique().max() > 1:
            chosen.append(name)
    return chosen[1:]


def say_setting(name: str, value: Any) -> str:
    """A setting and its value in words: "culling on", "packet width 8", "no culling" for a method without that."""
    if pd.isna(value):
        return f"no {name.replace('_', ' ')}"
    if isinstance(value, bool | np.bool_):
        return f"{name.replace('_', ' ')} {'on' if value else 'off'}"
    if name == "geometry":
        return f"{value} geometry"
    if name == "instruction_set":
        return "every instruction set" if value == "none" else f"instructions up to {value}"
    if name == "build_quality":
        return f"{value} build quality"
    if name in ("eye", "target", "up"):
        return f"{name} {', '.join(f'{float(part):.6g}' for part in str(value).split(','))}"
    if name.endswith("_sha256"):
        return f"{name.removesuffix('_sha256')} {value[:8]}"
    return f"{name.replace('_', ' ')} {value}"


def without_numbers(text: str) -> str:
    """A text in which "#" stands for every number: errors and warnings that differ in nothing else are one kind."""
    return NUMBER.sub("#", text)
