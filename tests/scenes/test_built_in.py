"""The scenes made by code, the stand-ins for the paper's among them, their shapes, and views of scenes."""

import numpy as np
import pytest
import trimesh

import atra
from atra import light
from atra.errors import InputError, MemoryBudgetError
from atra.geometry.camera import Camera
from atra.packets.pixel import PixelTracer
from experiments.harness.points import plan_points
from experiments.workloads.rounds import load_mesh
from scenes import shapes
from scenes.built_in import BUILT_IN, make_scene
from scenes.cornell_box import CORNELL_BOX_CAMERA, cornell_box, cornell_box_boxes, cornell_box_walls
from scenes.lit.weekend import WEEKEND_CAMERA, weekend
from scenes.loading import enlarged
from scenes.manifest import read_manifest
from scenes.scene import Scene
from scenes.views import VIEWS, view_fields
from tests.judge.reference import brute_force
from tests.meshes import cornell_camera
from tests.points import configured
from tests.shown import traced

STAND_INS = [name for name, made in BUILT_IN.items() if made.stands_for]
MADE = ["cornell_box", *STAND_INS]


@pytest.fixture(scope="module")
def meshes():
    return {name: BUILT_IN[name].make() for name in MADE}


@pytest.mark.parametrize("name", MADE)
def test_a_built_in_scene_has_the_papers_triangle_count_none_degenerate_and_is_the_same_every_time(name, meshes):
    mesh, again = meshes[name], BUILT_IN[name].make()
    assert mesh.triangle_count == read_manifest().scene(BUILT_IN[name].stands_for or name).triangles
    assert mesh.name == name
    assert np.array_equal(again.vertices, mesh.vertices)
    assert np.array_equal(again.faces, mesh.faces)
    corners = mesh.triangles(np.arange(mesh.triangle_count))
    assert np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).min() > 2e-6


@pytest.mark.parametrize("name", STAND_INS)
def test_no_ray_of_a_stand_ins_camera_leaves_through_a_hole_and_detail_fills_part_of_the_image(name, meshes):
    camera = Camera(**BUILT_IN[name].camera, width=128, height=128)
    with PixelTracer(meshes[name], camera, packet_width=1, threads=1) as tracer:
        hits = tracer.trace()
    assert hits.hit.all()
    assert len(np.unique(hits.prim_id)) > 1000


@pytest.mark.slow
@pytest.mark.parametrize(("name", "stated"), [("material_ball", 2.5), ("living_room", 2.9), ("atrium", 6.4)])
def test_the_depth_complexity_is_the_one_the_docstring_states(name, stated, meshes):
    assert f"crosses {stated} triangles" in BUILT_IN[name].make.__doc__
    camera = Camera(**BUILT_IN[name].camera, width=32, height=32)
    assert crossings(meshes[name], camera).mean() == pytest.approx(stated, abs=0.05)


def crossings(mesh, camera):
    """How many triangles each ray crosses: signs of its products with the planes through the eye and the edges."""
    a, b, c = np.moveaxis(camera.to_camera_space(mesh.vertices)[mesh.faces], 1, 0)
    seen = (a[:, 2] > 0) | (b[:, 2] > 0) | (c[:, 2] > 0)
    a, b, c = a[seen], b[seen], c[seen]
    planes = np.concatenate([np.cross(a, b), np.cross(b, c), np.cross(c, a)])
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    counts = []
    for direction in camera.rays(x.ravel(), y.ravel())[1]:
        sides = (planes @ direction).reshape(3, -1)
        inside = (sides > 0).all(axis=0) | (sides < 0).all(axis=0)
        counts.append(np.count_nonzero(volume[inside] * sides[0, inside] > 0))
    return np.array(counts)


@pytest.mark.parametrize(("make", "of_boxes"), [(cornell_box_walls, 24), (cornell_box_boxes, 1100)])
def test_other_layouts_of_the_box_have_as_many_triangles_in_the_same_room_and_no_hole(make, of_boxes):
    mesh, plain = make(), cornell_box()
    assert mesh.triangle_count == plain.triangle_count
    assert np.allclose(mesh.bounds, plain.bounds)
    corners = mesh.triangles(np.arange(mesh.triangle_count)).astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normals, axis=1)
    first = mesh.triangle_count - of_boxes
    room, boxes = area[:first].sum(), area[first:].sum()
    assert room == pytest.approx(2 * 4 + 3 * 2 * 1.59 + 0.48**2, rel=1e-6)
    assert boxes == pytest.approx(4 * 0.56**2 + 4 * 0.56 * (0.6 + 1.1), rel=1e-6)
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))[first:].sum() / 6
    assert volume == pytest.approx(0.56**2 * (0.6 + 1.1), rel=1e-6)  # closed, and normals point outwards


def test_box_and_sphere_are_closed_solids_that_stand_apart_on_the_floor_of_a_room_whose_walls_face_inwards():
    mesh = cornell_box()
    assert np.allclose(mesh.bounds, [[-1, 0, -1], [1, 1.59, 1]])
    walls = mesh.triangles(np.arange(12))
    normals = np.cross(walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0])
    assert ((np.array([0, 0.8, 0]) - walls[:, 0]) * normals).sum(axis=1).min() > 0
    for part, volume in (((12, 24), 0.56 * 0.6 * 0.56), ((24, 1112), 4 / 3 * np.pi * 0.4**3)):
        solid = trimesh.Trimesh(mesh.vertices, mesh.faces[slice(*part)].astype(np.int64), process=False)
        assert solid.is_watertight
        assert solid.volume == pytest.approx(volume, rel=0.02)  # negative if fronts are inside
    box, sphere = (mesh.triangles(np.arange(*part)).reshape(-1, 3) for part in ((12, 24), (24, 1112)))
    for part in (box, sphere):
        assert part[:, 1].min() == pytest.approx(0.0, abs=1e-6)
        assert np.abs(part[:, [0, 2]]).max() < 1.0
        assert part[:, 1].max() < 1.5
    centre = sphere.min(axis=0) / 2 + sphere.max(axis=0) / 2
    assert np.allclose(np.linalg.norm(sphere - centre, axis=1), 0.4, atol=1e-6)
    footprint = box[:, [0, 2]]
    assert np.linalg.norm(footprint[:, None] - centre[[0, 2]], axis=-1).min() > 0.4


def test_the_default_camera_sees_walls_light_box_and_sphere():
    hits = brute_force(cornell_box(), Camera(**CORNELL_BOX_CAMERA, width=48, height=48))
    assert hits.hit.mean() > 0.9
    counts, _ = np.histogram(hits.prim_id[hits.hit], [0, 2, 4, 6, 8, 10, 12, 24, 1112])
    assert counts.all(), counts


@pytest.mark.parametrize(("part", "triangles", "volume"), [
    (shapes.ball(2.0, 64, 48), 64 * 94, 4 / 3 * np.pi * 8),
    (shapes.box(1.0, 2.0, 3.0), 12, 6.0),
    (shapes.ring(2.0, 0.5, 64, 48), 2 * 64 * 48, 2 * np.pi**2 * 2.0 * 0.25),
    (shapes.lathe([(0, 0), (1, 0), (1, 2), (0, 2)], 90), 90 * 4, 2 * np.pi),
    (shapes.lathe([(0, 2), (1, 2), (1, 0), (0, 0)], 90), 90 * 4, 2 * np.pi),
    (shapes.cushion(1.0, 1.0, 1.0, 4, 0.0), 12 * 16, 1.0),
    (shapes.cloth(1, 1, 7, 5, 2, 0.1), 70, None),
    (shapes.leaf(1, 0.2, 8, 0.7), 28, None),
    (shapes.tube([(0, 0, 0), (1, 0, 0), (2, 1, 0)], 0.1, 6, (0, 0, 1)), 24, None),
    (shapes.blades(np.zeros((9, 3)), 0.1, 1.0), 9, None),
])  # fmt: skip
def test_a_shape_has_its_triangle_count_and_a_closed_one_its_volume_with_fronts_outside(part, triangles, volume):
    assert part.triangle_count == triangles
    solid = trimesh.Trimesh(part.vertices, part.faces, process=False)
    assert volume is None or solid.volume == pytest.approx(volume, rel=0.01)


def test_copies_are_leant_then_turned_then_moved():
    arrow = shapes.Part(np.array([[0.0, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2]]))
    placed = shapes.copies(arrow, [(5, 0, 0), (0, 7, 0)], shapes.frames([90, 0], [0, 90], [1, 2]))
    assert np.allclose(placed.vertices[:3], [(5, 0, 0), (5, 1, 0), (6, 0, 0)])
    assert np.allclose(placed.vertices[3:], [(0, 7, 0), (0, 7, 2), (0, 5, 0)])
    assert placed.faces.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_shows_the_scene_from_a_place_of_its_own(view):
    mesh = cornell_box()
    fields = view_fields(mesh, CORNELL_BOX_CAMERA, view)
    camera = atra.Camera(**fields, width=16, height=16)
    assert fields == view_fields(mesh, CORNELL_BOX_CAMERA, view)
    with atra.PixelTracer(mesh, camera, packet_width=1) as tracer:
        assert np.isfinite(tracer.trace().depth).mean() > 0.2
    others = [view_fields(mesh, CORNELL_BOX_CAMERA, other) for other in VIEWS if other != view]
    assert fields not in others


def test_a_view_moved_in_stands_nearer_by_four_tenths_of_what_it_looked_at_and_an_unknown_one_is_refused():
    eye = np.asarray(CORNELL_BOX_CAMERA["eye"])
    moved = np.asarray(view_fields(cornell_box(), CORNELL_BOX_CAMERA, "near")["eye"])
    with atra.PixelTracer(cornell_box(), cornell_camera(1, 1), packet_width=1) as tracer:
        assert np.linalg.norm(moved - eye) == pytest.approx(0.4 * float(tracer.trace().depth[0, 0]))
    with pytest.raises(InputError, match=r"scene\.view is 'behind'"):
        view_fields(cornell_box(), CORNELL_BOX_CAMERA, "behind")


def test_the_weekend_is_the_book_s():
    scene = weekend(segments=8)
    corners = scene.mesh.triangles(np.arange(scene.mesh.triangle_count))
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inner = scene.normals[scene.mesh.faces].astype(float).sum(axis=1)
    assert ((across * inner).sum(axis=1) > 0).all()  # fronts are outside
    count = len(scene.materials) - 4 - 3
    assert 470 <= count <= 484
    kinds = [type(material) for material in scene.materials[4 : 4 + count]]
    assert abs(kinds.count(light.Lambertian) / count - 0.8) < 0.05
    assert abs(kinds.count(light.Metal) / count - 0.15) < 0.05
    camera = atra.Camera(**WEEKEND_CAMERA, width=30, height=20)
    image = traced(scene, camera, 8)
    assert np.ptp(image.mean(axis=2)) > 0.5
    np.testing.assert_allclose(image[0, :, 2], 1.0, atol=0.2)  # the sky is blue


def area(mesh):
    a, b, c = np.moveaxis(mesh.triangles(np.arange(mesh.triangle_count)), 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def test_a_subdivided_triangle_becomes_four_of_a_quarter_of_its_area_in_its_place():
    scene = make_scene("cornell_box")
    cut = enlarged(scene, 2, 1)
    assert cut.mesh.triangle_count == 16 * scene.mesh.triangle_count
    quarters = area(cut.mesh).reshape(-1, 16)
    np.testing.assert_allclose(quarters.sum(axis=1), area(scene.mesh), rtol=1e-4)
    np.testing.assert_allclose(quarters, np.repeat(area(scene.mesh)[:, None] / 16, 16, axis=1), rtol=1e-2)
    assert (cut.camera, cut.name) == (scene.camera, scene.name)


def test_neighbours_share_the_vertices_in_the_middle_of_their_edges():
    faces = np.array([(0, 1, 2), (2, 1, 3)], np.uint32)
    mesh = atra.Mesh(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.3)], np.float32), faces)
    assert len(enlarged(Scene("square", mesh, {}), 1, 1).mesh.vertices) == 4 + 5


@pytest.mark.parametrize("copies", [2, 4, 7])
def test_copies_lie_side_by_side_and_the_first_where_the_scene_is(copies):
    scene = make_scene("cornell_box")
    many = enlarged(scene, 0, copies).mesh
    corners = many.triangles(np.arange(many.triangle_count)).reshape(copies, -1, 3, 3)
    np.testing.assert_array_equal(corners[0], scene.mesh.triangles(np.arange(scene.mesh.triangle_count)))
    boxes = [(one.min(axis=(0, 1)), one.max(axis=(0, 1))) for one in corners]
    for place, (low, high) in enumerate(boxes):
        np.testing.assert_allclose(high - low, np.ptp(scene.mesh.bounds, axis=0), rtol=1e-5)
        assert all((low > other_high).any() or (high < other_low).any() for other_low, other_high in boxes[:place])


@pytest.mark.parametrize(("subdivided", "copies"), [(9, 1), (10**9, 1), (0, 10**9)])
def test_more_triangles_than_can_be_meant_are_refused(subdivided, copies):
    with pytest.raises(InputError, match=f"scene.subdivided={subdivided} and scene.copies={copies} make"):
        enlarged(make_scene("cornell_box"), subdivided, copies)


def configuration(memory_budget_gib=None, **scene):
    return configured("raster", "frame", (16, 16), scene, {"memory_budget_gib": memory_budget_gib})


def test_points_know_their_enlarged_mesh_and_the_worker_loads_it():
    given = [configuration(), configuration(subdivided=1, copies=2), configuration()]
    points = [one.point for one in plan_points(given)]
    assert [one.triangles for one in points] == [1112, 8896, 1112]
    assert points[0] == points[2]
    assert points[0].mesh_sha256 != points[1].mesh_sha256
    assert load_mesh(points[1]).triangle_count == 8896


def test_a_point_whose_baselines_do_not_fit_has_the_reason_as_its_problem():
    few, many = plan_points([configuration(1e-3), configuration(1e-3, subdivided=3)])
    assert few.problem is None
    assert isinstance(many.problem, MemoryBudgetError)
    assert "baselines of 71,168 triangles and 256 pixels each need about" in str(many.problem)
