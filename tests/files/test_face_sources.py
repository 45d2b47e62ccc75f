"""Which face, material and node of a file each triangle is of: its corners must be corners of that face."""

import json

import numpy as np
import pytest
import trimesh

import atra
from atra.errors import InputError
from tests.files.samples import CORNERS, FORMS, QUADS, obj, written

MIXED = [(0, 1, 3, 2), (4, 6, 7), (0, 4, 5, 1, 3), (2, 3, 7, 6), (0, 2, 6), (1, 5, 7, 3, 2, 0)]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("faces", [[MIXED[1]] * 3, [MIXED[2]] * 3, QUADS, MIXED])
@pytest.mark.filterwarnings("ignore:.*do not lie in a plane", "ignore:.*that cross themselves")
def test_every_triangle_lies_in_the_face_that_it_is_said_to_be_of_in_the_order_of_the_file(form, faces, tmp_path):
    path = written(tmp_path, f"box.{form}", FORMS[form](CORNERS, faces))
    mesh, sources = atra.load_mesh(path), atra.load_face_sources(path)
    assert sources.face.tolist() == [number for number, face in enumerate(faces) for _ in face[2:]]
    places = np.array(CORNERS, float)
    for corners, face in zip(mesh.triangles(np.arange(mesh.triangle_count)), sources.face, strict=True):
        own = {tuple(places[corner]) for corner in faces[face]}
        assert {tuple(corner) for corner in corners} <= own


def test_the_materials_of_an_obj_are_those_of_its_lines(tmp_path):
    lines = iter(obj(CORNERS, MIXED).splitlines())
    rows = ["mtllib none.mtl", *(next(lines) for _ in CORNERS)]
    for number, face in enumerate(lines):
        rows += [f"usemtl {'red' if number % 3 else 'blue sky'}"] * (number > 0) + [face]
    sources = atra.load_face_sources(written(tmp_path, "box.obj", "\n".join(rows)))
    assert sources.materials == ("red", "blue sky")
    expected = np.array([-1, 0, 0, 1, 0, 0])
    np.testing.assert_array_equal(sources.material, expected[sources.face])
    assert (sources.node == -1).all()


def test_nodes_and_materials_of_a_gltf_are_found_where_meshes_have_several_primitives(tmp_path):
    scene, places = trimesh.Scene(), [(0, 0, 0), (10, 0, 0), (0, 20, 0)]
    for size, (name, place) in enumerate(zip("abc", places, strict=True), 1):
        box = trimesh.creation.box([size] * 3)
        box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name=f"paint {name}"))
        scene.add_geometry(box, node_name=f"node {name}", transform=trimesh.transformations.translation_matrix(place))
    scene.export(tmp_path / "scene.gltf")
    for path in tmp_path.glob("*.gltf"):
        tree = json.loads(path.read_text(encoding="utf-8"))
    # The first mesh gets the primitives of all three: their nodes are then made by us.
    tree["meshes"][0]["primitives"] += [one["primitives"][0] for one in tree["meshes"][1:]]
    (tmp_path / "scene.gltf").write_text(json.dumps(tree), encoding="utf-8")
    mesh, sources = atra.load_mesh(tmp_path / "scene.gltf"), atra.load_face_sources(tmp_path / "scene.gltf")
    assert mesh.triangle_count == len(sources.face) == 5 * 12
    corners = mesh.triangles(np.arange(60))
    shift = np.round(corners.mean(axis=1) / 10)
    for name, place in zip("abc", places, strict=True):
        of_node = sources.node == sources.nodes.index(f"node {name}")
        assert of_node.sum() == (36 if name == "a" else 12)
        assert (shift[of_node] == np.array(place) / 10).all()
    sizes = np.round(np.ptp(corners, axis=1).max(axis=1)).astype(int)  # a box is as wide as its paint says
    assert [sources.materials[one] for one in sources.material] == [f"paint {' abc'[size]}" for size in sizes]
    assert sources.face.reshape(5, 12).tolist() == [list(range(12))] * 5


def test_an_stl_counts_its_triangles(tmp_path):
    box = trimesh.creation.box()
    box.export(tmp_path / "box.stl")
    assert atra.load_face_sources(tmp_path / "box.stl").face.tolist() == list(range(12))


def test_a_mesh_of_trimesh_keeps_its_faces_and_anything_else_is_refused():
    box = trimesh.creation.box()
    mesh = atra.Mesh.from_trimesh(box, "a box")
    np.testing.assert_array_equal(mesh.faces, box.faces)
    np.testing.assert_array_equal(mesh.vertices, box.vertices.astype(np.float32))
    assert mesh.name == "a box"
    with pytest.raises(InputError, match=r"mesh is a Scene, expected a trimesh\.Trimesh"):
        atra.Mesh.from_trimesh(trimesh.Scene(box))
