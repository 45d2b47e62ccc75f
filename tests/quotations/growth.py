"""What the pages quote of sweep=growth."""

from __future__ import annotations

from experiments.workloads.frame.growth import Growth, Panel, fitted_slope, growth_panels, growths
from tests.quotations.quotation import Kept, Quoted, digits, table_row

_WORDS = {"subdivided": "subdivided", "copies": "copies as one mesh", "pixels": "larger images"}
_METHODS = ("pixel", "visible_first", "raster")


def growth_of_methods(kept: Kept) -> Quoted:
    """What grows and how far, the exponents of time, and visible-first and the rasteriser over packets at both ends."""
    rows = []
    for panel in growth_panels(kept.points):
        of_method = {one.method: one for one in growths(panel)}
        assert set(of_method) == set(_METHODS), f"{panel.title} has {sorted(of_method)}"
        exponents = []
        for name in _METHODS:
            exponent = fitted_slope(of_method[name].sizes, of_method[name].time_s)
            assert exponent is not None
            exponents.append(f"{exponent:.2f}")
        what = f"`{panel.scene}`, {_WORDS[panel.axis]}"
        over = (_both_ends(of_method[name]) for name in ("visible_first", "raster"))
        rows.append(table_row(what, _sizes(panel, of_method["raster"]), *exponents, *over))
    return Quoted(rows=tuple(rows))


def both_ends_of_the_rasteriser(kept: Kept, *scenes: str) -> list[str]:
    """ "`sponza`, subdivided: 4.55 to 2.23" for what grows of these scenes, as speed over packets."""
    return [
        f"`{panel.scene}`, {_WORDS[panel.axis]}: {_both_ends(one)}"
        for panel in growth_panels(kept.points)
        for one in growths(panel)
        if one.method == "raster" and panel.scene in scenes and panel.axis != "copies"
    ]


def _sizes(panel: Panel, one: Growth) -> str:
    return f"{one.sizes[0]:,.0f} to {one.sizes[-1]:,.0f} {panel.unit}"


def _both_ends(one: Growth) -> str:
    return f"{digits(one.over_packets[0])} to {digits(one.over_packets[-1])}"
