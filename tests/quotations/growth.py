"""What the pages quote of sweep=growth."""

from experiments.workloads.frame.growth import fitted_slope, growth_panels, growths
from tests.quotations.quotation import digits, table_row

_WORDS = {"subdivided": "subdivided", "copies": "copies as one mesh", "pixels": "larger images"}
_METHODS = ("pixel", "visible_first", "raster")


def growth_of_methods(kept):
    """What grows and how far, the exponents of time, and visible-first and the rasteriser over packets at both ends."""
    for panel in growth_panels(kept.points):
        of_method = {one.method: one for one in growths(panel)}
        assert set(of_method) == set(_METHODS), f"{panel.title} has {sorted(of_method)}"
        exponents = [fitted_slope(of_method[name].sizes, of_method[name].time_s) for name in _METHODS]
        sizes = of_method["raster"].sizes
        yield table_row(
            f"`{panel.scene}`, {_WORDS[panel.axis]}",
            f"{sizes[0]:,.0f} to {sizes[-1]:,.0f} {panel.unit}",
            *(f"{exponent:.2f}" for exponent in exponents),
            *(_both_ends(of_method[name]) for name in ("visible_first", "raster")),
        )


def both_ends_of_the_rasteriser(kept, *scenes):
    """ "`sponza`, subdivided: 4.55 to 2.23" for what grows of these scenes, as speed over packets."""
    for panel in growth_panels(kept.points):
        for one in growths(panel):
            if one.method == "raster" and panel.scene in scenes and panel.axis != "copies":
                yield f"`{panel.scene}`, {_WORDS[panel.axis]}: {_both_ends(one)}"


def _both_ends(one):
    return f"{digits(one.over_packets[0])} to {digits(one.over_packets[-1])}"
