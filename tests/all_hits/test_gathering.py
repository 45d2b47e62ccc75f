"""Gathering: all hits along rays, each exactly once, in every method the same."""

from itertools import product

import numpy as np
import pytest

import atra
from scenes.special import three_holes
from tests.all_hits.crossings import all_crossings
from tests.all_hits.plain import gather_plainly
from tests.closed_meshes import box, cornell_boxes, sphere, view_of
from tests.machine import FEW_LANES
from tests.meshes import EYE_AT_ORIGIN, beams, boards, joined, quads, random_triangles

EIGHTHS = atra.OrthographicCamera((0, 0, 4), (0, 0, 0), view_height=4.0, width=32, height=32)
"""Samples at offset (0, 0) lie on a grid of eighths."""


METHODS = {
    "packets": lambda mesh, camera: atra.PixelTracer(mesh, camera, threads=1),
    "aligned": lambda mesh, camera: atra.AlignedTracer(mesh, camera, (camera.width // 16, 1), threads=1),
    "raster": lambda mesh, camera: atra.RasterTracer(mesh, camera, threads=1),
}
OTHERS = {
    "single rays": lambda mesh, camera: atra.PixelTracer(mesh, camera, packet_width=1, threads=2),
    "unculled": lambda mesh, camera: atra.AlignedTracer(mesh, camera, (2, 2), culling=False, threads=2),
    "instanced": lambda mesh, camera: atra.AlignedTracer(
        mesh, camera, (camera.width // 16, 2), culling=False, geometry="instanced", threads=1
    ),
    "narrow vectors": lambda mesh, camera: atra.RasterTracer(mesh, camera, lanes=FEW_LANES, threads=2),
}

SLOW_TO_COMPILE = {"narrow vectors": pytest.mark.slow}
"""Methods whose kernels few tests need."""


def gathered(method, mesh, camera, what, offset=(0.5, 0.5)):
    with method(mesh, camera) as tracer:
        return tracer.gather(what, offset)


def assert_counts_are_exact(method, mesh, camera, offset=(0.5, 0.5)):
    wanted = gather_plainly(all_crossings(mesh, camera, offset), atra.Count())
    np.testing.assert_array_equal(gathered(method, mesh, camera, atra.Count(), offset).count, wanted.count)


@pytest.mark.core
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("mesh", [box(), sphere(), cornell_boxes()], ids=lambda mesh: mesh.name)
def test_a_closed_mesh_is_left_as_often_as_entered(mesh, method):
    for seed in range(4):
        count = gathered(method, mesh, view_of(mesh, seed), atra.Count()).count
        assert count.any()
        assert not (count % 2).any()


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_large_model_of_genus_three_is_left_as_often_as_entered(method):
    mesh = three_holes()
    assert mesh.triangle_count == 99_144
    count = gathered(method, mesh, view_of(mesh, 1, 160, 96), atra.Count()).count
    assert count.max() >= 4
    assert not (count % 2).any()


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
@pytest.mark.parametrize("mesh", [box(), joined(box(), box((-0.5, -1, -0.25), (0.75, 0, 0.5)))], ids=["box", "boxes"])
def test_rays_through_corners_and_along_edges_meet_each_surface_once(mesh, method):
    count = gathered(method, mesh, EIGHTHS, atra.Count(), (0.0, 0.0)).count
    assert not (count % 2).any()
    expected = np.zeros((32, 32), int)
    expected[8:24, 8:24] = 2  # of both borders the one that the moved samples are inside of
    if mesh.triangle_count > 12:
        expected[16:24, 12:22] += 2
    np.testing.assert_array_equal(count, expected)


@pytest.mark.parametrize(
    "method",
    [pytest.param(make, id=name, marks=SLOW_TO_COMPILE.get(name, ())) for name, make in (METHODS | OTHERS).items()],
)
def test_rays_through_the_corners_of_a_pinhole_view_meet_each_surface_once(method):
    camera = atra.Camera((0, 0, 4), (0, 0, 0), fov_y_degrees=2 * np.degrees(np.arctan(0.5)), width=32, height=32)
    assert_counts_are_exact(method, joined(box(), sphere(1)), camera, (0.0, 0.0))


CAMERAS = {
    "ordinary": atra.Camera(**EYE_AT_ORIGIN, width=48, height=30, fov_y_degrees=90),
    "wide": atra.Camera(**EYE_AT_ORIGIN, width=32, height=34, fov_y_degrees=170),
    "parallel": atra.OrthographicCamera((0.3, 0.2, -0.4), (1, 2, 3), view_height=5.0, width=48, height=30),
}


def of_every_camera(methods, slow=None):
    """Cases of cameras and methods. slow: the method whose kernel for parallel rays is compiled for this test alone."""

    def case(camera, method):
        marks = pytest.mark.slow if (camera, method) == ("parallel", slow) else SLOW_TO_COMPILE.get(method, ())
        return pytest.param(CAMERAS[camera], methods[method], id=f"{camera}-{method}", marks=marks)

    return pytest.mark.parametrize(("camera", "method"), [case(*one) for one in product(CAMERAS, methods)])


@of_every_camera(METHODS | OTHERS)
def test_counts_are_exact_whatever_lies_behind_around_and_through_the_eye(camera, method):
    for seed, mesh in enumerate(
        (random_triangles(60, 1), random_triangles(900, 2, 0.1), beams(3), boards(tilted=True))
    ):
        assert_counts_are_exact(method, mesh, camera, [(0.5, 0.5), (0.0, 0.0), (0.9, 0.3), (0.5, 0.5)][seed])


@pytest.mark.parametrize("method", ["aligned", "unculled", "instanced"])
def test_what_no_copy_may_show_is_counted_once(method):
    mesh, camera = beams(3), CAMERAS["ordinary"]
    with (METHODS | OTHERS)[method](mesh, camera) as tracer:
        assert tracer.counters["triangles_left_out"] > 0
        found = tracer.gather(atra.Count())
    np.testing.assert_array_equal(found.count, gather_plainly(all_crossings(mesh, camera), atra.Count()).count)


@of_every_camera(METHODS, slow="raster")
def test_transmittance_is_the_product_of_the_factors(camera, method):
    mesh = random_triangles(200, 4, 0.5)
    what = atra.Transmittance(np.random.default_rng(1).uniform(0.2, 1.0, 200))
    found, wanted = gathered(method, mesh, camera, what), gather_plainly(all_crossings(mesh, camera), what)
    np.testing.assert_allclose(found.transmittance, wanted.transmittance, rtol=1e-5)
    half = gathered(method, mesh, camera, atra.Transmittance(0.5)).transmittance
    np.testing.assert_array_equal(
        half, 0.5 ** gather_plainly(all_crossings(mesh, camera), atra.Count()).count.astype(np.float32)
    )


@pytest.mark.parametrize(
    "method",
    [pytest.param(METHODS[name], id=name, marks=pytest.mark.slow if name == "raster" else ()) for name in METHODS],
)
def test_the_thickness_of_a_box_along_parallel_rays_is_its_depth(method):
    found = gathered(method, box(), EIGHTHS, atra.Thickness(), (0.5, 0.5))
    expected = np.zeros((32, 32))
    expected[8:24, 8:24] = 2.0
    np.testing.assert_allclose(found.thickness, expected, atol=1e-5)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_the_thickness_of_a_sphere_is_its_chord(method):
    camera = atra.Camera((0, 0, 3), (0, 0, 0), width=64, height=48, fov_y_degrees=50)
    seen = gathered(method, sphere(5), camera, atra.Thickness())
    direction = camera.rays(np.arange(64), np.arange(48)[:, None])[1]
    cosine = direction[..., 2] / np.linalg.norm(direction, axis=-1)
    chord = 2.0 * np.sqrt(np.maximum(1.0 - 9.0 * (1.0 - cosine**2), 0.0))
    assert np.abs(seen.along_rays - chord)[chord > 0.5].max() < 5e-3
    assert seen.thickness.min() >= -1e-5


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_ray_that_starts_inside_is_as_long_as_its_way_out(method):
    camera = atra.Camera((0, 0, 0), (0, 0, -1), width=48, height=32, fov_y_degrees=60)
    found = gathered(method, box(), camera, atra.Thickness())
    assert (gathered(method, box(), camera, atra.Count()).count == 1).all()
    np.testing.assert_allclose(found.thickness, 1.0, rtol=1e-5)


@of_every_camera(METHODS, slow="raster")
def test_layers_are_the_nearest_hits_in_order_and_the_others_are_counted(camera, method):
    mesh = random_triangles(150, 6)
    found, wanted = (
        gathered(method, mesh, camera, atra.Layers(4)),
        gather_plainly(all_crossings(mesh, camera), atra.Layers(4)),
    )
    np.testing.assert_array_equal(found.count, wanted.count)
    assert (found.count > 4).any()
    np.testing.assert_array_equal(found.prim_id, wanted.prim_id)
    np.testing.assert_allclose(found.depth, wanted.depth, rtol=2e-5, atol=1e-5)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_layers_of_one_depth_are_in_the_order_of_their_triangles(method):
    wall = [[(-9, -9, 2), (9, -9, 2), (9, 9, 2), (-9, 9, 2)]]
    found = gathered(method, quads(wall * 3), CAMERAS["ordinary"], atra.Layers(2))
    assert (found.count == 3).all()
    assert (found.depth[1] == found.depth[0]).all()
    assert (found.prim_id[0] < 2).all()
    np.testing.assert_array_equal(found.prim_id[1], found.prim_id[0] + 2)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_an_earlier_result_is_overwritten_and_one_of_something_else_refused(method):
    mesh, camera = sphere(), CAMERAS["ordinary"]
    with method(mesh, camera) as tracer:
        first = tracer.gather(atra.Count(), (0.1, 0.2))
        again = tracer.gather(atra.Count(), out=first)
        assert again.count.ctypes.data == first.count.ctypes.data
        np.testing.assert_array_equal(again.count, tracer.gather(atra.Count()).count)
        with pytest.raises(atra.InputError, match="expected ThicknessResult of this tracer"):
            tracer.gather(atra.Thickness(), out=again)
        layers = tracer.gather(atra.Layers(2))
        with pytest.raises(atra.InputError, match=r"out has depth of \(2, 30, 48\), expected \(3, 30, 48\)"):
            tracer.gather(atra.Layers(3), out=layers)
        own = atra.CountResult(np.zeros((30, 48), np.uint32), (0.5, 0.5), mesh, camera)
        with pytest.raises(atra.InputError, match="not made for this tracer"):
            tracer.gather(atra.Count(), out=own)


@pytest.mark.parametrize(("given", "message"), [
    (lambda: atra.Transmittance(1.5), "transmittance is 1.5, expected a factor in"),
    (lambda: atra.Transmittance([0.5, -0.25]), "transmittance of triangle 1 is -0.25"),
    (lambda: atra.Transmittance([0.5, np.nan]), "transmittance of triangle 1 is nan"),
    (lambda: atra.Transmittance([[0.5]]), r"shape \(1, 1\)"),
    (lambda: atra.Transmittance("all"), "transmittance is 'all'"),
    (lambda: atra.Layers(0), "k is 0, expected a whole number of layers"),
    (lambda: atra.Layers(2.5), "k is 2.5"),
])  # fmt: skip
def test_what_cannot_be_gathered_is_named(given, message):
    with pytest.raises(atra.InputError, match=message):
        given()


def test_what_a_mesh_or_a_tracer_is_not_for_is_named():
    mesh, camera = sphere(1), CAMERAS["ordinary"]
    with atra.RasterTracer(mesh, camera) as tracer:
        with pytest.raises(atra.InputError, match="has 3 factors, expected one for each of the 80 triangles"):
            tracer.gather(atra.Transmittance([0.1, 0.2, 0.3]))
        with pytest.raises(atra.InputError, match="cannot gather 'count', expected"):
            tracer.gather("count")
    open_sphere = atra.Mesh(mesh.vertices, mesh.faces[1:])
    a, b, c = mesh.faces[0]
    turned = atra.Mesh(mesh.vertices, np.concatenate([[mesh.faces[0, ::-1]], mesh.faces[1:]]))
    for wrong in (open_sphere, turned):
        with atra.RasterTracer(wrong, camera) as tracer, pytest.raises(atra.InputError, match="3 open edges") as error:
            tracer.gather(atra.Thickness())
        assert all(
            f"{p}-{q}" in str(error.value) or f"{q}-{p}" in str(error.value) for p, q in ((a, b), (b, c), (c, a))
        )
    inside_out = atra.Mesh(mesh.vertices, mesh.faces[:, ::-1])
    with atra.RasterTracer(inside_out, camera) as tracer, pytest.raises(atra.InputError, match="inside out"):
        tracer.gather(atra.Thickness())
    with atra.PixelTracer(mesh, camera, build_quality="high") as tracer, pytest.raises(atra.InputError, match="'high'"):
        tracer.gather(atra.Count())


def test_an_edge_is_closed_by_position_not_by_number():
    mesh = sphere(1)
    apart = atra.Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * mesh.triangle_count).reshape(-1, 3))
    with atra.RasterTracer(apart, CAMERAS["ordinary"]) as tracer:
        tracer.gather(atra.Thickness())


def test_what_is_traced_is_the_same_before_and_after_gathering():
    mesh, camera = random_triangles(200, 8), CAMERAS["ordinary"]
    for method in METHODS.values():
        with method(mesh, camera) as tracer:
            before = tracer.trace()
            tracer.gather(atra.Count())
            after = tracer.trace()
            np.testing.assert_array_equal(after.prim_id, before.prim_id)
            np.testing.assert_array_equal(after.depth, before.depth)


def test_a_new_view_of_a_raster_tracer_is_gathered_from():
    mesh, camera = sphere(), CAMERAS["ordinary"]
    with atra.RasterTracer(mesh, EIGHTHS) as tracer:
        tracer.gather(atra.Count())
        tracer.look(camera)
        np.testing.assert_array_equal(
            tracer.gather(atra.Count()).count, gather_plainly(all_crossings(mesh, camera), atra.Count()).count
        )
