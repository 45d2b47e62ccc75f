"""Images of single rays, and what two images of one view must agree in."""

import atra


def trace_pixels(mesh, camera, offset=(0.5, 0.5), **options):
    """One ray per pixel, single rays unless `options` say otherwise."""
    with atra.PixelTracer(mesh, camera, **{"packet_width": 1, "threads": 1, **options}) as tracer:
        return tracer.trace(offset)


def assert_equal_images(mesh, camera, hits, reference):
    """No pixel is wrong, and excuses are for single pixels, not for half an image."""
    agreement = atra.compare(mesh, camera, hits, reference)
    assert agreement.pixels_wrong == 0, str(agreement)
    assert agreement.pixels_equal >= 0.98 * agreement.pixels, str(agreement)
