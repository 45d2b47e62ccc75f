"""Whole numbers: what counts as one when a person hands it in."""

from __future__ import annotations

from typing import TypeGuard

import numpy as np


def is_whole_number(value: object) -> TypeGuard[int]:
    """Whether `value` is an int, Python's or NumPy's, and no bool.

    Take int(value) to go on with: small integers of NumPy's overflow silently.
    """
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)
