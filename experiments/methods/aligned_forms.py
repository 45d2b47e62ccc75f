"""Forms of the aligned geometry in tables and figures: copies with and without culling, instances."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.drawing.style import BLUE, PURPLE, VERMILLION
from experiments.methods.aligned import ALIGNED
from experiments.methods.naming import say_variant

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
    found = set(_form_of_each(aligned_rows(table)))
    copied = not found or COPIED_OFF in found or COPIED_ON in found
    return tuple(form for form in FORM_STYLES if form in found or (copied and form != INSTANCED))
