"""Names of points in words, the same on the terminal, in figures and on the page; and forms of the aligned geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.style import BLUE, PURPLE, TIMES, VERMILLION
from experiments.harness.options import plain_options
from experiments.methods import METHODS, find_method
from experiments.methods.aligned import ALIGNED

Row = Mapping[str, Any]
"""A row of the table, or of a point."""


def say_series(name: str, packet_width: int | None) -> str:
    """A method, with the width of its packets where that is known and ours to choose."""
    method = find_method(name)
    if method.words is not None:
        return method.words(packet_width)
    if not method.has_packets or packet_width is None:
        return method.label
    return f"{method.label}, single rays" if packet_width == 1 else f"{method.label}, packets of {packet_width}"


def say_variant(row: Row) -> str:
    """What distinguishes a row of its method but split and packets: "culling on", "instanced"; "" for most methods."""
    return find_method(str(row["method"])).variant(_known(row))


def say_split(row: Row) -> str:
    """The split of a row and what is unusual about its geometry; "" for a method without cells."""
    method, known = find_method(str(row["method"])), _known(row)
    if not method.has_cells or "split_x" not in known or "split_y" not in known:
        return ""
    words = [f"{known['split_x']} {TIMES} {known['split_y']}"]
    variant = method.variant(known)
    is_usual = variant in ("", method.variant(plain_options(method.options())))
    return ", ".join(words if is_usual else [*words, variant])


def say_kind(row: Row) -> str:
    """The method of a row with what distinguishes it but split and packets: "aligned, culling on"; one ray per pixel
    with its packets and what is unusual about it."""
    method, width = find_method(str(row["method"])), _known(row).get("packet_width")
    if not method.has_cells:
        # Their rows are told with the settings that vary, as those of other methods are.
        return ", ".join(filter(None, [say_series(method.name, width), say_variant({**row, "packet_rows": None})]))
    words = [method.label, say_variant(row), "single rays" if width == 1 else ""]
    return ", ".join(filter(None, words))


def say_point(row: Row) -> str:
    """A point among those of its scene: "aligned, packets of 16, 128 × 1, culling on"."""
    known = _known(row)
    method = find_method(str(row["method"]))
    words = [say_series(method.name, known.get("packet_width"))]
    if method.has_cells and "split_x" in known:
        words.append(f"{known['split_x']} {TIMES} {known['split_y']}")
    return ", ".join(filter(None, [*words, say_variant(row)]))


def best_of() -> tuple[str, ...]:
    """The options of methods of which a figure shows the best; packets and versions of programs are told apart."""
    names = (name for method in METHODS for name in plain_options(method.options()))
    return tuple(dict.fromkeys(name for name in names if not name.startswith(("packet_", "program_"))))


def _known(row: Row) -> dict[str, Any]:
    return {str(name): value for name, value in row.items() if not is_missing(value)}


def is_missing(value: Any) -> bool:
    """Whether a value of a row is that of a column that was not measured."""
    return not isinstance(value, list | tuple) and bool(pd.isna(value))


FORM_OPTIONS = ("geometry", "culling")
"""Options that make a form of the aligned geometry."""

COPIED_OFF, COPIED_ON, INSTANCED = "aligned, culling off", "aligned, culling on", "aligned, instanced"
FORM_STYLES: dict[str, dict[str, Any]] = {
    COPIED_OFF: {"color": VERMILLION, "marker": "s"},
    COPIED_ON: {"color": BLUE, "marker": "o"},
    INSTANCED: {"color": PURPLE, "marker": "^"},
}
"""The three forms of the aligned geometry, by their labels, in the order of the legends."""


def aligned_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of this method."""
    return table[table["method"].eq(ALIGNED.name).fillna(False).astype(bool)]


def aligned_forms(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The aligned rows by the label of their geometry's form (`FORM_STYLES`); forms without rows are left out."""
    rows = aligned_rows(table)
    forms = _form_of_each(rows)
    return {form: rows[forms == form] for form in FORM_STYLES if (forms == form).any()}


def _form_of_each(rows: pd.DataFrame) -> NDArray[np.object_]:
    """(N,) the label of every aligned row."""
    telling = rows[["method", *(field.name for field in fields(ALIGNED.options) if field.name in rows)]]
    said = [say_variant({**row, "reference": None}) for row in telling.to_dict("records")]
    return np.array([f"{ALIGNED.label}, {variant}" for variant in said], dtype=object)


def expected_forms(table: pd.DataFrame) -> tuple[str, ...]:
    """The forms that a figure of these rows has or misses: copies with and without culling, which belong together,
    and whatever else there is."""
    present = set(_form_of_each(aligned_rows(table)))
    copied = not present or COPIED_OFF in present or COPIED_ON in present
    return tuple(form for form in FORM_STYLES if form in present or (copied and form != INSTANCED))
