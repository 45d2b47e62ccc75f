"""Every method that makes images, and what two images of one view must agree in."""

import numpy as np

import atra


def nothing_seen(mesh, camera):
    """A probe that leaves everything to the second pass."""
    size = camera.height, camera.width
    return atra.Hits(np.zeros(size, np.float32), np.zeros(size, np.uint32), (0.5, 0.5), mesh, camera)


def unprobed(mesh, camera, split, **options):
    return atra.VisibleFirstTracer(mesh, camera, split, nothing_seen(mesh, camera), **options)


METHODS = {
    "pixels": (atra.PixelTracer, {}),
    "aligned": (atra.AlignedTracer, {}),
    "unculled": (atra.AlignedTracer, {"culling": False}),
    "instanced": (atra.AlignedTracer, {"culling": False, "geometry": "instanced"}),
    "visible_first": (atra.VisibleFirstTracer, {}),
    "unprobed": (unprobed, {}),
}
CELLS = tuple(method for method in METHODS if method != "pixels")
PARALLEL = ("pixels", "aligned", "unculled", "instanced")
"""Methods that also take parallel rays."""
SHEARED = ("aligned", "instanced", "visible_first")


def make_tracer(method, mesh, camera, split=(1, 1), **options):
    """One thread unless `options` say otherwise; pixels have no split."""
    kind, own = METHODS[method]
    cells = {} if kind is atra.PixelTracer else {"split": split}
    return kind(mesh, camera, **cells, **{"threads": 1, **own, **options})


def trace(method, mesh, camera, split=(1, 1), offset=(0.5, 0.5), **options):
    with make_tracer(method, mesh, camera, split, **options) as tracer:
        return tracer.trace(offset)


def trace_pixels(mesh, camera, offset=(0.5, 0.5), **options):
    """One ray per pixel, single rays unless `options` say otherwise."""
    return trace("pixels", mesh, camera, offset=offset, **{"packet_width": 1, **options})


def draw(mesh, camera, offset=(0.5, 0.5), **options):
    """The rasteriser's image."""
    with atra.RasterTracer(mesh, camera, **{"threads": 1, **options}) as tracer:
        return tracer.trace(offset)


def assert_no_pixel_wrong(mesh, camera, hits, reference):
    agreement = atra.compare(hits, reference)
    assert agreement.pixels_wrong == 0, str(agreement)
    return agreement


def assert_equal_images(mesh, camera, hits, reference):
    """No pixel is wrong, and excuses are for single pixels, not for half an image."""
    agreement = assert_no_pixel_wrong(mesh, camera, hits, reference)
    assert agreement.pixels_equal >= 0.98 * agreement.pixels, str(agreement)


def assert_same_bits(hits, others):
    assert hits.prim_id.tobytes() == others.prim_id.tobytes()
    assert hits.depth.tobytes() == others.depth.tobytes()
