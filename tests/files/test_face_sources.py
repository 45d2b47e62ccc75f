"""Which face, material and node of a file each triangle is of: its corners must be corners of that face."""

import json

import numpy as np
import pytest
import trimesh

import atra
from atra.errors import InputError
from tests.files.samples import CORNERS, FORMS, QUADS, gltf, obj, written

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
    np.testing.assert_array_equal(sources.material, np.array([-1, 0, 0, 1, 0, 0])[sources.face])
    assert (sources.node == -1).all()


def test_nodes_and_materials_of_a_gltf_are_found_where_meshes_have_several_primitives(tmp_path):
    """A mesh of three primitives and one of a single one, each of which two nodes place."""
    tree = json.loads(gltf([{"mesh": k % 2, "name": f"node {k}", "translation": [10 * k, 0, 0]} for k in range(4)]))
    (primitive,) = tree["meshes"][0]["primitives"]
    tree["meshes"] = [{"primitives": [{**primitive, "material": k} for k in (2, 0, 1)]}, {"primitives": [primitive]}]
    tree["materials"] = [{"name": "red"}, {}, {"name": "green"}]
    path = written(tmp_path, "scene.gltf", json.dumps(tree))
    mesh, sources = atra.load_mesh(path), atra.load_face_sources(path)
    assert sources.nodes == ("node 0", "node 1", "node 2", "node 3")
    assert sources.materials == ("red", "1", "green")
    parts = [(0, 2), (0, 0), (0, 1), (1, -1), (2, 2), (2, 0), (2, 1), (3, -1)]
    assert list(zip(sources.node[::12].tolist(), sources.material[::12].tolist(), strict=True)) == parts
    assert sources.face.reshape(8, 12).tolist() == [list(range(12))] * 8
    np.testing.assert_array_equal(mesh.triangles(np.arange(96)).mean(axis=1)[:, 0] // 10, sources.node)


def test_a_mesh_of_trimesh_keeps_its_faces_and_anything_else_is_refused():
    box = trimesh.creation.box()
    mesh = atra.Mesh.from_trimesh(box, "a box")
    np.testing.assert_array_equal(mesh.faces, box.faces)
    np.testing.assert_array_equal(mesh.vertices, box.vertices.astype(np.float32))
    assert mesh.name == "a box"
    with pytest.raises(InputError, match=r"mesh is a Scene, expected a trimesh\.Trimesh"):
        atra.Mesh.from_trimesh(trimesh.Scene(box))
