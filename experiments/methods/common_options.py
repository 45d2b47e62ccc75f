"""Options that several methods have, and what rows are called that were measured with them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from atra.errors import InputError
from experiments.harness.options import option

PACKET_WIDTHS = (1, 4, 8, 16)

WATERTIGHT = {"robust": True}
"""What is shown to people, unlike what is measured, is traced with."""


def robust_option() -> Any:
    """The field `robust` of a method of ours. It is off unless a sweep asks for it: what the paper measured, and what
    all tables without the column were measured with, is Embree's fast setting."""
    return option(False, "no ray slips through between two triangles; off: Embree's fast setting, as in the paper")


def say_robust(row: Mapping[str, Any]) -> list[str]:
    """What a row is called that was measured with it: nothing where it was not, or is older than the option."""
    return ["robust"] if row.get("robust") in (True,) else []


def check_packet_width(width: int | None) -> None:
    """Raise InputError for a width Embree has no packets of; whether it is native is asked later."""
    if width is not None and width not in PACKET_WIDTHS:
        widths = ", ".join(str(width) for width in PACKET_WIDTHS)
        raise InputError(f"method.packet_width is {width}, expected one of {widths} or null")
