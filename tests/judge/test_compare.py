"""Each verdict on a scene made for it, and no verdict where it would excuse a bug."""

from dataclasses import replace

import numpy as np
import pytest

from atra.alignment import rounding
from atra.alignment.aligned import AlignedTracer
from atra.errors import InputError
from atra.geometry.camera import Camera
from atra.geometry.mesh import Mesh
from atra.geometry.orthographic import OrthographicCamera
from atra.geometry.ray_space import ray_axes, to_ray_space
from atra.hits import Hits
from atra.judge.compare import Agreement, DepthErrors, Verdict, compare
from atra.packets.pixel import PixelTracer
from atra.prim_ids import MISS
from atra.tracing.rays import image_ray_grid
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box
from tests.judge.reference import brute_force
from tests.meshes import boards, random_triangles

# Both look along -z from the origin: camera (X, Y, Z) = world (x, -y, -z).
CAMERA = Camera(eye=(0, 0, 0), target=(0, 0, -1), fov_y_degrees=90.0, width=8, height=8)
PARALLEL = OrthographicCamera(eye=(0, 0, 0), target=(0, 0, -1), view_height=2.0, width=8, height=8)
both_cameras = pytest.mark.parametrize("camera", [CAMERA, PARALLEL], ids=["pinhole", "parallel"])


def seen_at(camera, x, y, depth):
    """The world point of this depth on the ray through (x, y) on the image plane."""
    reach = 1.0 if camera.is_parallel else depth
    return x * reach, -y * reach, -depth


def triangle(depth, shift=None, camera=CAMERA):
    """A large triangle facing the eye; all rays hit it well inside. `shift` puts its left edge there on the image."""
    left = -20.0 if shift is None else shift
    return [seen_at(camera, x, y, depth) for x, y in ((left, 60.0), (60.0, 0.0), (left, -60.0))]


def scene(*triangles):
    return Mesh(np.concatenate(triangles), np.arange(3 * len(triangles)).reshape(-1, 3))


def image(mesh, prim_id=0, depth=1.0, camera=CAMERA, offset=(0.5, 0.5)):
    shape = (camera.height, camera.width)
    return Hits(np.full(shape, depth, np.float32), np.full(shape, prim_id, np.uint32), offset, mesh, camera)


def verdict_at_centre(mesh, first, second, camera=CAMERA):
    """The verdict on the centre pixel of two images that name (prim_id, depth) everywhere; it must be symmetric."""
    a, b = image(mesh, *first, camera=camera), image(mesh, *second, camera=camera)
    there, back = compare(a, b), compare(b, a)
    row, column = camera.height // 2, camera.width // 2
    assert np.array_equal(there.verdict, back.verdict)
    return Verdict(there.verdict[row, column])


NOTHING = (MISS, np.inf)


def test_an_image_equals_itself():
    mesh = cornell_box()
    camera = Camera(**CORNELL_BOX_CAMERA, width=48, height=32)
    hits = brute_force(mesh, camera)
    found = compare(hits, hits)
    assert (found.pixels_equal, found.pixels_tied, found.pixels_edge, found.pixels_wrong) == (48 * 32, 0, 0, 0)
    assert found.pixels == 48 * 32
    assert str(found) == "1536 of 1536 pixels equal, 0 tied, 0 edge, 0 wrong"


RIM = 0.125  # where the centre ray meets the image plane; pixels are 0.25 wide
JUST_BESIDE = RIM + 1e-7
EDGE, TIED, EQUAL, WRONG = Verdict.EDGE, Verdict.TIED, Verdict.EQUAL, Verdict.WRONG


@both_cameras
@pytest.mark.parametrize(("triangles", "first", "second", "expected"), [
    ([(2.0,)], NOTHING, NOTHING, EQUAL),
    ([(2.0,), (2.0,)], (0, 2.0), (1, 2.0), TIED),
    ([(2.0,), (3.0,)], (0, 2.0), (1, 3.0), WRONG),  # hidden, in place of the visible one
    ([(2.0,)], (0, 2.0), NOTHING, WRONG),  # a hole
    # At the rim either is right; 3e-3 is 5e-5 barycentric but a hundredth of a pixel.
    *(([(2.0, RIM + way * beside)], (0, 2.0), NOTHING, expected) for way in (1, -1)
      for beside, expected in ((1e-7, EDGE), (2e-4, EDGE), (3e-3, WRONG), (0.1, WRONG))),
    # A rim in front excuses seeing what is behind; one behind does not excuse losing what is in front.
    ([(2.0, JUST_BESIDE), (3.0,)], (0, 2.0), (1, 3.0), EDGE),
    ([(2.0,), (3.0, JUST_BESIDE)], (0, 2.0), (1, 3.0), WRONG),
    # The second is surely missed, and behind the eye.
    ([(2.0, JUST_BESIDE), (1.0, 0.5)], (0, 2.0), (1, 1.0), WRONG),
    ([(2.0, JUST_BESIDE), (3.0, 0.5)], (0, 2.0), (1, 3.0), WRONG),
    ([(2.0,), (-2.0,)], (0, 2.0), (1, 2.0), WRONG),
    # Depths are judged though the triangles agree, tie or miss.
    ([(2.0,)], (0, 2.0), (0, 2.0), EQUAL), ([(2.0,)], (0, 2.0), (0, 2.0 * (1 + 1e-6)), EQUAL),
    ([(2.0,)], (0, 2.0), (0, 2.0 * (1 + 1e-5)), WRONG), ([(2.0,)], (0, 2.01), (0, 2.01), WRONG),
    ([(2.0,)], (0, 2.0), (0, np.nan), WRONG), ([(2.0,)], (0, 2.0), (0, np.inf), WRONG),
    ([(2.0,), (2.0,)], (0, 2.0), (1, 2.1), WRONG),
    *(([(2.0,)], NOTHING, (MISS, depth), WRONG) for depth in (5.0, np.nan, -np.inf)),
])  # fmt: skip
def test_the_verdict_on_triangles_facing_the_eye(camera, triangles, first, second, expected):
    mesh = scene(*(triangle(*one, camera=camera) for one in triangles))
    assert verdict_at_centre(mesh, first, second, camera) == expected


def edge_on(y, camera):
    """A triangle from depth 1 to 3 that is a line on the image, at the height `y` of the image plane."""
    return [seen_at(camera, x, y, depth) for x, depth in ((-5.0, 1.0), (5.0, 1.0), (0.0, 3.0))]


@both_cameras
@pytest.mark.parametrize(("y", "depth", "expected"), [
    (RIM, 2.0, EDGE), (0.3, 2.0, WRONG), (RIM, 7.0, EDGE), (RIM, -1.0, WRONG),
])  # fmt: skip
def test_an_edge_on_triangle_has_any_depth_on_its_line_and_none_elsewhere_or_behind_the_eye(camera, y, depth, expected):
    mesh = scene(triangle(9.0, camera=camera), edge_on(y, camera))
    assert verdict_at_centre(mesh, (0, 9.0), (1, depth), camera) == expected


def small(depth, size=2.0):
    """A triangle facing the eye, about as large as it is far away."""
    return [(-size, -size, -depth), (size, -size, -depth), (0.25, size, -depth)]


def test_triangles_too_close_for_float32_to_order_are_edge_and_clearly_apart_wrong():
    for apart, expected in ((3e-7, EDGE), (3e-5, WRONG)):
        mesh = scene(small(2.0), small(2.0 * (1 + apart)))
        assert verdict_at_centre(mesh, (0, 2.0), (1, 2.0)) == expected


def test_the_closer_the_eye_is_to_a_plane_the_less_float32_can_order_unless_it_lies_along_an_axis():
    # Planes at a distance of 1e-3 whose corners are two thousand times as far away; the second pair is tilted.
    for tilt, apart, expected in (
        (0.0, 1e-6, EDGE), (0.0, 1e-4, WRONG), (0.3, 1e-4, EDGE), (0.3, 2e-2, WRONG),
    ):  # fmt: skip
        planes = []
        for height in (1e-3, 1e-3 * (1 + apart)):
            # Z = height + tilt (X - Z / 8), so that the ray (1/8, 1/8) meets it at this height.
            points = ((-2.0, -2.0), (2.0, -2.0), (0.5, 2.0))
            planes.append([(x, -y, -(height + tilt * x) / (1 + tilt / 8)) for x, y in points])
        assert verdict_at_centre(scene(*planes), (0, 1e-3), (1, 1e-3 * (1 + apart))) == expected


def test_a_triangle_without_area_is_edge_on_its_line_and_wrong_elsewhere():
    on_ray = [(-1.0, -0.25, -2.0), (1.0, -0.25, -2.0), (0.0, -0.25, -2.0)]
    off_ray = [(-1.0, -0.9, -2.0), (1.0, -0.9, -2.0), (0.0, -0.9, -2.0)]
    mesh = scene(triangle(4.0), on_ray, off_ray)
    assert verdict_at_centre(mesh, (0, 4.0), (1, 2.0)) == EDGE
    assert verdict_at_centre(mesh, (0, 4.0), (2, 2.0)) == WRONG


def test_a_rim_is_found_on_triangles_much_smaller_than_a_pixel():
    # A hundredth of a pixel wide, its rim a two-thousandth of a pixel beside the ray: 5 % of its size.
    camera = Camera(eye=(0, 0, 0), target=(0, 0, -1), fov_y_degrees=0.9, width=8, height=8)
    pixel = camera.pixel_pitch
    centre, size = 0.5 * pixel, 0.01 * pixel
    left = centre + 5e-4 * pixel
    tiny = [(left, -centre + size, -1.0), (left, -centre - size, -1.0), (left + size, -centre, -1.0)]
    assert verdict_at_centre(scene(triangle(4.0), tiny), (0, 4.0), (1, 1.0), camera) == EDGE


@both_cameras
def test_an_edge_that_passes_behind_the_eye_still_has_an_outline(camera):
    # A needle from Z = 6 to Z = -2 in camera space, through the ray at Z = 2; without area, so only its outline counts.
    origin, direction = camera.rays(np.array(4), np.array(4))
    on_ray = origin + 2.0 * direction
    needle = on_ray + np.array([(0.0, 1.0, 4.0), (0.0, 0.5, 2.0), (0.0, -1.0, -4.0)])
    for aside, expected in ((0.0, EDGE), (0.1, WRONG)):
        mesh = scene(triangle(9.0, camera=camera), np.subtract(needle, (aside, 0.0, 0.0)) * (1, -1, -1))
        assert verdict_at_centre(mesh, (0, 9.0), (1, 2.0), camera) == expected


def test_float32_cannot_say_whether_a_tilted_plane_through_the_eye_is_in_front_of_it():
    # 1e-9 before an eye whose triangle is a few units large; a thousandth is another matter, and so is a plane along an
    # axis, whose place float32 knows.
    for tilt, depth, expected in ((0.3, 1e-9, EDGE), (0.3, 1e-3, WRONG), (0.0, 1e-9, WRONG)):
        points = ((-2.0, -2.0), (2.0, -2.0), (0.5, 2.0))
        mesh = scene([(x, -y, -(depth + tilt * x) / (1 + tilt / 8)) for x, y in points])
        assert verdict_at_centre(mesh, (0, depth), NOTHING) == expected


def test_in_a_very_narrow_view_float32_is_coarser_than_pixels():
    # 1e-7 of the distance is a twentieth of a pixel here; the triangle is some forty pixels large.
    camera = Camera(eye=(0, 0, 0), target=(0, 0, -1), fov_y_degrees=0.01, width=64, height=64)
    pixel = camera.pixel_pitch
    for beside, expected in ((0.03, EDGE), (1.0, WRONG)):
        left = (0.5 - beside) * pixel
        mesh = scene([(left, -20 * pixel, -1.0), (left + 40 * pixel, 0.0, -1.0), (left, 20 * pixel, -1.0)])
        assert verdict_at_centre(mesh, (0, 1.0), NOTHING, camera) == expected


def planes_past_the_eye(distance, seed):
    """Large triangles whose planes all pass the origin at this distance."""
    random = np.random.default_rng(seed)
    normals = random.normal(size=(40, 1, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    corners = random.normal(0, 5, (40, 3, 3))
    corners -= ((corners * normals).sum(axis=2, keepdims=True) - distance) * normals
    return Mesh(corners.reshape(-1, 3), np.arange(120).reshape(-1, 3))


def float32_image(mesh, camera, vertex_bits=24):
    """The nearest hits by Möller and Trumbore's test in float32, as plain as a tracer can be.

    vertex_bits: significant bits that the vertices keep when the eye has been subtracted.
    """
    mantissa, exponent = np.frexp(to_ray_space(camera, mesh.vertices))
    vertices = np.ldexp(np.round(np.ldexp(mantissa, vertex_bits)), exponent - vertex_bits).astype(np.float32)
    y, x = np.divmod(np.arange(camera.width * camera.height), camera.width)
    columns, rows = image_ray_grid(camera, (0.5, 0.5))
    rays, same = (columns[:, x] + rows[:, y]).T, np.zeros((len(x), 3), np.float32)
    origins, directions = (rays, same + ray_axes(camera)[2].astype(np.float32)) if camera.is_parallel else (same, rays)
    depth, prim_id = np.full(len(x), np.inf, np.float32), np.full(len(x), MISS, np.uint32)
    for i, (a, b, c) in enumerate(vertices[mesh.traced_faces]):
        normal, to_origin = np.cross(b - a, c - a), origins - a
        with np.errstate(divide="ignore", invalid="ignore"):
            facing = directions @ normal
            u = -(np.cross(directions, c - a) * to_origin).sum(axis=1) / facing
            v = (np.cross(directions, b - a) * to_origin).sum(axis=1) / facing
            t = -(to_origin @ normal) / facing
        nearer = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < depth)
        depth[nearer], prim_id[nearer] = t[nearer], i
    shape = (camera.height, camera.width)
    return Hits(depth.reshape(shape), prim_id.reshape(shape), (0.5, 0.5), mesh, camera)


HARD_SCENES = {
    "around the eye": random_triangles(60, 3),
    "a hundredth from the eye": planes_past_the_eye(1e-2, 5),
    "a ten thousandth from the eye": planes_past_the_eye(1e-4, 5),
}
ASLANT = {"eye": (0, 0, 0), "target": (1, 2, 3), "width": 64, "height": 64}
HARD_CAMERAS = {
    "60 degrees": Camera(**ASLANT, fov_y_degrees=60.0),
    "170 degrees": Camera(**ASLANT, fov_y_degrees=170.0),
    "parallel": OrthographicCamera(**ASLANT, view_height=6.0),
}


@pytest.mark.parametrize("camera", HARD_CAMERAS.values(), ids=HARD_CAMERAS)
@pytest.mark.parametrize("mesh", HARD_SCENES.values(), ids=HARD_SCENES)
def test_a_plain_float32_tracer_is_never_wrong_and_a_coarser_one_is(mesh, camera):
    reference, traced = brute_force(mesh, camera), float32_image(mesh, camera)
    found = compare(traced, reference)
    assert traced.hit.any()
    assert found.pixels_wrong == 0
    assert found.pixels_edge < 0.02 * found.pixels
    assert compare(float32_image(mesh, camera, vertex_bits=10), reference).pixels_wrong > 0


def test_the_judge_knows_of_depths_that_sheared_copies_of_needles_would_get_wrong(monkeypatch):
    # As they were traced before: with copies of everything.
    monkeypatch.setattr(rounding, "COPY_MULTIPLE", np.inf)
    mesh, camera = boards(), Camera((0, 0, 0), (0, -0.2, -1), fov_y_degrees=60.0, width=64, height=64)
    with AlignedTracer(mesh, camera, (16, 16), threads=1) as tracer:
        hits = tracer.trace()
    with PixelTracer(mesh, camera, packet_width=1, threads=1) as tracer:
        reference = tracer.trace()
    found = compare(hits, reference)
    assert compare(reference, reference).pixels_wrong == 0
    assert found.pixels_wrong > 0.2 * hits.hit.sum()
    assert found.depth_errors.largest > 20 * found.reference_depth_errors.largest


def test_depth_errors_are_the_largest_and_what_all_but_a_thousandth_stay_below():
    errors = DepthErrors.of(np.array([np.inf, np.nan, *np.linspace(0, 1e-3, 1001)]))
    assert errors == DepthErrors(1e-3, pytest.approx(0.999e-3))
    assert DepthErrors.of(np.array([np.inf])) == DepthErrors(0.0, 0.0)


def test_images_of_another_mesh_camera_size_or_offset_are_refused_with_both_values():
    mesh, farther = scene(triangle(2.0)), replace(CAMERA, eye=(0, 0, 1))
    whole = image(mesh)
    assert compare(whole, image(scene(triangle(2.0)))).pixels_wrong == whole.depth.size  # an equal mesh, read again
    for hits, reference, message in (
        (image(scene(triangle(3.0), triangle(2.0))), whole, "2 triangles.* the reference Mesh.*1 triangles"),
        (image(scene(triangle(3.0))), whole, "expected equal meshes"),
        (image(mesh, camera=farther), whole, r"eye=\(0.0, 0.0, 1.0\).*eye=\(0.0, 0.0, 0.0\)"),
        (image(mesh, offset=(0.25, 0.5)), whole, r"\(0.25, 0.5\).*\(0.5, 0.5\)"),
        (image(mesh, offset=(0.5, 0.75)), whole, r"\(0.5, 0.75\).*\(0.5, 0.5\)"),
        *((replace(whole, depth=np.ones((rows, 8), np.float32)), whole, rf"depth of shape \({rows}, 8\)")
          for rows in (7, 9)),
        *((whole, replace(whole, prim_id=np.zeros((rows, 8), np.uint32)), rf"prim_id of shape \({rows}, 8\)")
          for rows in (7, 9)),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            compare(hits, reference)


def test_a_prim_id_the_mesh_does_not_have_is_refused():
    mesh = scene(triangle(2.0))
    for prim_id in (1, 7):
        with pytest.raises(InputError, match=f"prim_id {prim_id} is not in"):
            compare(image(mesh, prim_id, 2.0), image(mesh, prim_id, 2.0))


def test_agreement_counts_its_codes_and_refuses_others():
    found = Agreement(np.array([[0, 1, 1], [2, 3, 3]], np.uint8))
    assert (found.pixels_equal, found.pixels_tied, found.pixels_edge, found.pixels_wrong) == (1, 2, 1, 2)
    with pytest.raises(InputError, match="code 4"):
        Agreement(np.array([[4]], np.uint8))
    for verdict in (np.array([[0]]), np.array([[0]], np.int8), np.zeros(4, np.uint8), np.zeros((2, 2, 1), np.uint8)):
        with pytest.raises(InputError, match=rf"{verdict.dtype} of shape .*expected uint8 of shape \(H, W\)"):
            Agreement(verdict)
