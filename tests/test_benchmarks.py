"""The regression benchmark's verdict, by hand; nothing is timed here."""

from __future__ import annotations

import pytest

from benchmarks.regression import Ratio, verdict


@pytest.mark.parametrize(
    ("now", "told"),
    [
        (Ratio(1.5, 1.4, 1.6), "slower"),
        (Ratio(1.75, 1.6, 1.79), "no difference shown"),  # intervals apart, but two processes may be
        (Ratio(1.5, 1.2, 1.9), "no difference shown"),  # far apart, but uncertain
        (Ratio(2.5, 2.3, 2.7), "faster"),
    ],
)
def test_only_a_large_and_certain_move_is_a_change(now: Ratio, told: str) -> None:
    assert verdict(now, Ratio(2.0, 1.8, 2.2)) == told
