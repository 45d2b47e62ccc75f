"""What the pages quote of sweep=growth."""

from experiments.workloads.frame.exponents import exponents
from experiments.workloads.frame.growth import growth_panels, growths
from tests.quotations.quotation import digits, of, table_row

_WORDS = {"subdivided": "subdivided", "copies": "copies as one mesh", "pixels": "larger images"}
_METHODS = ("pixel", "visible_first", "raster")


def growth_of_methods(kept):
    """What grows and how far, exponents of packets' time and of the others' over packets, and both ends of these."""
    found = {(panel.title, method): k for panel, method, k in exponents(kept.processes)}
    for panel in growth_panels(kept.points):
        of_method = {one.method: one for one in growths(panel)}
        assert set(of_method) == set(_METHODS), f"{panel.title} has {sorted(of_method)}"
        fitted = [found.get((panel.title, name)) for name in _METHODS]
        sizes = of_method["raster"].sizes
        yield table_row(
            f"`{panel.scene}`, {_WORDS[panel.axis]}",
            f"{sizes[0]:,.0f} to {sizes[-1]:,.0f} {panel.unit}",
            *("too few sizes" if k is None else f"{k.value:.2f} {k.interval()}" for k in fitted),
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


def holes_at_edges(kept):
    """The most holes that an image of each method has; those of single rays are counted in the same images."""
    points = kept.points
    most = [of(points, method=method)["pixels_hole"].max() for method in ("raster", "visible_first")]
    raster, visible_first, single = (f"{count:.0f}" for count in (*most, points["baseline_pixels_hole"].max()))
    yield f"The most holes in one image: rasteriser {raster}, visible-first {visible_first}, single rays {single}."
