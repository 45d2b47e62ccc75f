"""Options of one ray per pixel: whatever an expert chooses, the image stays as right as that of single rays."""

import numpy as np
import pytest

from atra.tracing.rays import pixel_tiles
from tests.images import assert_equal_images, trace, trace_pixels
from tests.machine import WIDTHS
from tests.meshes import cornell_box, cornell_camera, random_triangles

SHAPES = [(width, 1 << k) for width in WIDTHS for k in range(width.bit_length())]
QUICK_SHAPES = [(1, 1), (WIDTHS[-1], 1), (WIDTHS[-1], WIDTHS[-1])]
"""Each shape is compiled for itself; the squarest ones are those of all other tests."""
MESHES = {"cornell_box": cornell_box(), "random": random_triangles(300, 1)}


@pytest.mark.parametrize("options", [
    {"coherent": False}, {"compact": True}, {"robust": False}, {"compact": True, "robust": False, "coherent": False},
    {"build_quality": "low"}, {"build_quality": "high"}, {"tile_order": "rows"}, {"tile_order": "morton"},
    *(
        pytest.param(
            {"packet_width": width, "packet_rows": rows},
            marks=() if (width, rows) in QUICK_SHAPES else pytest.mark.slow,
        )
        for width, rows in SHAPES
    ),
], ids=str)  # fmt: skip
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_no_choice_makes_a_pixel_wrong(mesh, options):
    camera = cornell_camera(67, 45)  # whole packets and tiles end beside its borders
    hits = trace("pixels", mesh, camera, threads=2, **options)
    assert_equal_images(mesh, camera, hits, trace_pixels(mesh, camera))


@pytest.mark.parametrize("order", ["blocks", "rows", "morton"])
@pytest.mark.parametrize("size", [(1, 1), (32, 16), (67, 45), (200, 3)])
def test_tiles_cover_every_pixel_once(order, size):
    width, height = size
    tiles = pixel_tiles(width, height, order)
    count = np.zeros((height, width), np.int64)
    for x, y in tiles.corners:
        count[y : y + tiles.height, x : x + tiles.width] += 1
    assert (count == 1).all()
    assert tiles.width % 16 == tiles.height % 16 == 0  # whole packets of every shape


def test_a_morton_curve_goes_through_four_tiles_before_it_leaves_them():
    tiles = pixel_tiles(64, 64, "morton")
    order = [(int(x) // 16, int(y) // 16) for x, y in tiles.corners]
    assert order[:8] == [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, 0), (2, 1), (3, 1)]
