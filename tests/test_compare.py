"""Each verdict on a scene made for it, and no verdict where it would excuse a bug."""

import numpy as np
import pytest

from atra.camera import Camera
from atra.compare import Agreement, Verdict, compare
from atra.errors import InputError
from atra.hits import MISS, Hits
from atra.mesh import Mesh
from atra.reference import brute_force
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box

CAMERA = Camera(eye=(0, 0, 0), target=(0, 0, -1), fov_y_degrees=90.0, width=8, height=8)
CENTRE = (4, 4)  # row, column: direction (1/8, 1/8, 1)


def triangle(depth, shift=0.0):
    """A large triangle facing the eye; all rays hit it well inside. `shift` moves its left edge to X = shift * Z."""
    left = -20.0 * depth if not shift else shift * depth
    return [(left, -60.0 * depth, -depth), (60.0 * depth, 0.0, -depth), (left, 60.0 * depth, -depth)]


def scene(*triangles):
    return Mesh(np.concatenate(triangles), np.arange(3 * len(triangles)).reshape(-1, 3))


def image(mesh, prim_id=0, depth=1.0, camera=CAMERA, offset=(0.5, 0.5)):
    shape = (camera.height, camera.width)
    return Hits(np.full(shape, depth, np.float32), np.full(shape, prim_id, np.uint32), offset, mesh, camera)


def verdict_at_centre(mesh, first, second, camera=CAMERA):
    """The verdict on the centre pixel of two images that name (prim_id, depth) everywhere; it must be symmetric."""
    a, b = image(mesh, *first, camera=camera), image(mesh, *second, camera=camera)
    there, back = compare(mesh, camera, a, b), compare(mesh, camera, b, a)
    row, column = camera.height // 2, camera.width // 2
    assert np.array_equal(there.verdict, back.verdict)
    return Verdict(there.verdict[row, column])


NOTHING = (MISS, np.inf)


def test_an_image_equals_itself():
    mesh = cornell_box()
    camera = Camera(**CORNELL_BOX_CAMERA, width=48, height=32)
    hits = brute_force(mesh, camera)
    found = compare(mesh, camera, hits, hits)
    assert (found.pixels_equal, found.pixels_tied, found.pixels_edge, found.pixels_wrong) == (48 * 32, 0, 0, 0)
    assert found.pixels == 48 * 32
    assert str(found) == "1536 of 1536 pixels equal, 0 tied, 0 edge, 0 wrong"


def test_two_misses_are_equal():
    assert verdict_at_centre(scene(triangle(2.0)), NOTHING, NOTHING) == Verdict.EQUAL


def test_equally_deep_triangles_are_tied():
    mesh = scene(triangle(2.0), triangle(2.0))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 2.0)) == Verdict.TIED


def test_triangles_a_millionth_apart_are_not_tied():
    mesh = scene(triangle(2.0), triangle(2.0 * (1 + 1e-6)))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 2.0)) == Verdict.WRONG


def test_a_hidden_triangle_in_place_of_the_visible_one_is_wrong():
    mesh = scene(triangle(2.0), triangle(3.0))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 3.0)) == Verdict.WRONG


def test_a_hole_in_a_triangle_is_wrong():
    assert verdict_at_centre(scene(triangle(2.0)), (0, 2.0), NOTHING) == Verdict.WRONG


@pytest.mark.parametrize("beside", [1e-7, -1e-7, 3e-3, -3e-3])  # 3e-3 is 5e-5 barycentric but a hundredth of a pixel
def test_hit_and_miss_at_the_rim_is_edge(beside):
    mesh = scene(triangle(2.0, shift=0.125 + beside))
    assert verdict_at_centre(mesh, (0, 2.0), NOTHING) == Verdict.EDGE


@pytest.mark.parametrize("beside", [0.1, -0.1])
def test_hit_and_miss_away_from_the_rim_is_wrong(beside):
    mesh = scene(triangle(2.0, shift=0.125 + beside))
    assert verdict_at_centre(mesh, (0, 2.0), NOTHING) == Verdict.WRONG


def test_a_rim_in_front_excuses_seeing_what_is_behind():
    mesh = scene(triangle(2.0, shift=0.125 + 1e-7), triangle(3.0))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 3.0)) == Verdict.EDGE


def test_a_rim_behind_does_not_excuse_losing_what_is_in_front():
    mesh = scene(triangle(2.0), triangle(3.0, shift=0.125 + 1e-7))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 3.0)) == Verdict.WRONG


@pytest.mark.parametrize("depth", [1.0, 3.0])
def test_a_triangle_the_ray_surely_misses_is_not_excused_by_a_rim(depth):
    mesh = scene(triangle(2.0, shift=0.125 + 1e-7), triangle(depth, shift=0.5))
    assert verdict_at_centre(mesh, (0, 2.0), (1, depth)) == Verdict.WRONG


def test_a_triangle_behind_the_eye_is_wrong():
    mesh = scene(triangle(2.0), triangle(-2.0))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 2.0)) == Verdict.WRONG


def edge_on(direction_y):
    """A triangle in the plane Y = direction_y * Z, from depth 1 to 3: a line on the image at that height."""
    return [(x * z, -direction_y * z, -z) for x, z in ((-5.0, 1.0), (5.0, 1.0), (0.0, 3.0))]


def test_an_edge_on_triangle_is_edge_on_its_line_and_wrong_elsewhere():
    mesh = scene(triangle(4.0), edge_on(0.125), edge_on(0.3))
    assert verdict_at_centre(mesh, (0, 4.0), (1, 2.0)) == Verdict.EDGE
    assert verdict_at_centre(mesh, (0, 4.0), (2, 2.0)) == Verdict.WRONG


def test_an_edge_on_triangle_with_a_depth_beyond_its_corners_is_wrong():
    mesh = scene(triangle(9.0), edge_on(0.125))
    assert verdict_at_centre(mesh, (0, 9.0), (1, 7.0)) == Verdict.WRONG


def test_a_triangle_without_area_is_edge_on_its_line_and_wrong_elsewhere():
    on_ray = [(-1.0, -0.25, -2.0), (1.0, -0.25, -2.0), (0.0, -0.25, -2.0)]
    off_ray = [(-1.0, -0.9, -2.0), (1.0, -0.9, -2.0), (0.0, -0.9, -2.0)]
    mesh = scene(triangle(4.0), on_ray, off_ray)
    assert verdict_at_centre(mesh, (0, 4.0), (1, 2.0)) == Verdict.EDGE
    assert verdict_at_centre(mesh, (0, 4.0), (2, 2.0)) == Verdict.WRONG


def test_a_rim_is_found_on_triangles_much_smaller_than_a_pixel():
    # A hundredth of a pixel wide, its rim a two-thousandth of a pixel beside the ray: 5 % of its size.
    camera = Camera(eye=(0, 0, 0), target=(0, 0, -1), fov_y_degrees=90.0, width=1000, height=1000)
    pixel = camera.pixel_pitch
    centre, size = 0.5 * pixel, 0.01 * pixel
    left = centre + 5e-4 * pixel
    tiny = [(left, -centre + size, -1.0), (left, -centre - size, -1.0), (left + size, -centre, -1.0)]
    assert verdict_at_centre(scene(triangle(4.0), tiny), (0, 4.0), (1, 1.0), camera) == Verdict.EDGE


def test_an_edge_that_passes_behind_the_eye_still_has_an_outline():
    # A needle from Z = 6 to Z = -2 in camera space, through the ray at Z = 2; without area, so only its outline counts.
    on_ray = CAMERA.directions(np.array(4), np.array(4)) * 2.0
    needle = on_ray + np.array([(0.0, 1.0, 4.0), (0.0, 0.5, 2.0), (0.0, -1.0, -4.0)])
    for aside, expected in ((0.0, Verdict.EDGE), (0.1, Verdict.WRONG)):
        mesh = scene(triangle(9.0), np.subtract(needle, (aside, 0.0, 0.0)) * (1, -1, -1))
        assert verdict_at_centre(mesh, (0, 9.0), (1, 2.0)) == expected


def test_a_wrong_depth_is_wrong_though_the_triangles_agree():
    mesh = scene(triangle(2.0))
    assert verdict_at_centre(mesh, (0, 2.0), (0, 2.0)) == Verdict.EQUAL
    assert verdict_at_centre(mesh, (0, 2.0), (0, 2.0 * (1 + 5e-4))) == Verdict.EQUAL
    assert verdict_at_centre(mesh, (0, 2.0), (0, 2.01)) == Verdict.WRONG
    assert verdict_at_centre(mesh, (0, 2.01), (0, 2.01)) == Verdict.WRONG
    assert verdict_at_centre(mesh, (0, 2.0), (0, np.nan)) == Verdict.WRONG
    assert verdict_at_centre(mesh, (0, 2.0), (0, np.inf)) == Verdict.WRONG


def test_a_wrong_depth_is_wrong_though_the_triangles_tie():
    mesh = scene(triangle(2.0), triangle(2.0))
    assert verdict_at_centre(mesh, (0, 2.0), (1, 2.1)) == Verdict.WRONG


def test_a_miss_with_a_depth_is_wrong():
    assert verdict_at_centre(scene(triangle(2.0)), NOTHING, (MISS, 5.0)) == Verdict.WRONG


def test_a_grazing_plane_may_be_as_deep_as_within_a_hundredth_of_a_pixel():
    # The plane Y = rise + (0.125 - rise) Z meets the ray Y = 0.125 Z at Z = 1, sinking away from it slowly.
    rise = 0.1
    plane = [(x, -(rise + z * (0.125 - rise)), -z) for x, z in ((-900, 0), (900, 0), (0, 900))]
    depth_per_shift = 0.01 * CAMERA.pixel_pitch / rise
    assert 0.02 < depth_per_shift < 0.03
    mesh = scene(plane)
    assert verdict_at_centre(mesh, (0, 1.0), (0, 1.0 + 0.9 * depth_per_shift)) == Verdict.EQUAL
    assert verdict_at_centre(mesh, (0, 1.0), (0, 1.0 + 1.2 * depth_per_shift)) == Verdict.WRONG


def test_images_of_another_size_or_offset_are_refused_with_both_values():
    mesh = scene(triangle(2.0))
    small = Camera(eye=(0, 0, 0), target=(0, 0, -1), width=4, height=8)
    with pytest.raises(InputError, match=r"hits has prim_id of shape \(8, 4\).*\(8, 8\)"):
        compare(mesh, CAMERA, image(mesh, camera=small), image(mesh))
    with pytest.raises(InputError, match=r"reference has prim_id of shape \(8, 4\).*\(8, 8\)"):
        compare(mesh, CAMERA, image(mesh), image(mesh, camera=small))
    with pytest.raises(InputError, match=r"\(0.25, 0.5\).*\(0.5, 0.5\)"):
        compare(mesh, CAMERA, image(mesh, offset=(0.25, 0.5)), image(mesh))


def test_a_prim_id_the_mesh_does_not_have_is_refused():
    mesh = scene(triangle(2.0))
    with pytest.raises(InputError, match="prim_id 1 is not in"):
        compare(mesh, CAMERA, image(mesh, 1, 2.0), image(mesh, 1, 2.0))


def test_agreement_counts_its_codes_and_refuses_others():
    found = Agreement(np.array([[0, 1, 1], [2, 3, 3]], np.uint8))
    assert (found.pixels_equal, found.pixels_tied, found.pixels_edge, found.pixels_wrong) == (1, 2, 1, 2)
    with pytest.raises(InputError, match="code 4"):
        Agreement(np.array([[4]], np.uint8))
    with pytest.raises(InputError, match="int64"):
        Agreement(np.array([[0]]))
