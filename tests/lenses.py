"""Cameras with random lenses, of which some fold over inside the image."""

import atra

SIZES = (0.25, 0.08, 0.004, 0.004, 0.03, 0.15, 0.04, 0.01, 0.004, 0.002, 0.004, 0.002, 0.04, 0.04)
"""Usual sizes of OpenCV's coefficients, in its order."""


def random_lens(random):
    """A lens of any model."""
    kind = random.integers(5)
    if kind < 2:
        return atra.OpenCVLens.of((random.normal(size=14) * SIZES)[: random.choice([4, 5, 8, 12, 14])])
    if kind == 2:
        return atra.FisheyeLens.of(random.normal(size=4) * [0.1, 0.05, 0.01, 0.005])
    if kind == 3:
        return atra.FisheyeLens(*random.normal(size=8) * [0.1, 0.05, 0.01, 0.005, 0.002, 0.002, 0.002, 0.002])
    return atra.FovLens(random.uniform(0.2, 2.0))


def lens_camera(lens, placed, width=96, height=72, focal=0.6):
    """A camera with a lens at the eye of another. focal: of the width; panoramas have their own."""
    if isinstance(lens, atra.EquirectangularLens):
        return atra.LensCamera.panorama(placed.eye, placed.target, placed.up, width)
    pitch = 1.0 / (focal * width)
    sensor = atra.ImagePlane(pitch, pitch, 0.48 * width, 0.53 * height)
    return atra.LensCamera(placed.eye, placed.target, placed.up, width, height, lens=lens, sensor=sensor)
