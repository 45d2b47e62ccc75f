"""The mesh keeps what it is given, in order, and refuses what cannot be traced."""

import copy
import json
import os
import pickle
from pathlib import Path

import numpy as np
import pytest
import trimesh

from atra.errors import InputError
from atra.files.meshes.loading import load_mesh
from atra.geometry.mesh import Mesh
from scenes.directory import PAPER_SCENES
from tests.folders import NEEDS_SCENES

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
TWO_FACES = np.array([[0, 1, 2], [0, 2, 3]])


def test_arrays_are_private_contiguous_copies_that_cannot_be_written():
    vertices, faces = np.asfortranarray(SQUARE), TWO_FACES.copy()
    mesh = Mesh(vertices, faces)
    vertices[0] = faces[0] = 3
    assert mesh.vertices[0].tolist() == [0, 0, 0]
    assert mesh.faces[0].tolist() == [0, 1, 2]
    assert mesh.vertices.dtype == np.float32
    assert mesh.faces.dtype == np.uint32
    assert mesh.vertices.flags.c_contiguous
    for array in (mesh.vertices, mesh.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("again", [copy.deepcopy, copy.copy, lambda mesh: pickle.loads(pickle.dumps(mesh))])
def test_copied_and_unpickled_meshes_cannot_be_written_either(again):
    mesh = Mesh(SQUARE, TWO_FACES, "square")
    assert mesh.bounds.any()
    same = again(mesh)
    assert same.name == "square"
    assert np.array_equal(same.bounds, mesh.bounds)
    for array, original in ((same.vertices, mesh.vertices), (same.faces, mesh.faces)):
        assert np.array_equal(array, original)
        assert array.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39, 2e12])
def test_a_vertex_that_cannot_be_traced_is_refused_naming_its_index_and_value(value):
    vertices = SQUARE.astype(np.float64)
    vertices[2, 1] = value
    vertices[3, 0] = np.nan
    with pytest.raises(InputError, match="vertex 2 is ") as caught:
        Mesh(vertices, TWO_FACES)
    assert str(float(value)) in str(caught.value)


@pytest.mark.parametrize(("vertices", "faces", "message"), [
    *((SQUARE, [[0, 1, 2], [0, 1, index]], f"face 1 names vertex {index}, but the mesh has 4 vertices")
      for index in (4, -1, 2**32)),
    (SQUARE, TWO_FACES.astype(np.float64), "float64"),
    *((vertices, TWO_FACES, "vertices have dtype") for vertices in (SQUARE + 1j, SQUARE.astype(str), SQUARE > 0)),
    ([], [], "at least one triangle"), (np.empty((0, 3)), np.empty((0, 3), int), "at least one triangle"),
    (SQUARE, [], "at least one triangle"), (SQUARE[:, :2], TWO_FACES, r"vertices have shape \(4, 2\)"),
    (SQUARE, [[0, 1, 2, 3]], r"faces have shape \(1, 4\)"),
    ([[0, 0, 0], [1]], TWO_FACES, "cannot be read as an array"),
])  # fmt: skip
def test_arrays_that_are_no_mesh_are_refused_naming_what_is_wrong(vertices, faces, message):
    assert Mesh(SQUARE.tolist(), [[0, 0, 0], [0, 1, 2]]).faces.tolist() == [[0, 0, 0], [0, 1, 2]]  # one without area is
    with pytest.raises(InputError, match=message):
        Mesh(vertices, faces)


def test_bounds_ignore_vertices_no_face_uses():
    mesh = Mesh([[9, 9, 9], *SQUARE.tolist()], TWO_FACES + 1)
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]
    assert mesh.bounds.dtype == np.float64


def test_triangles_gives_the_corners_of_the_named_faces_only():
    corners = Mesh(SQUARE, TWO_FACES).triangles(np.array([1, 1], np.uint32))
    assert corners.shape == (2, 3, 3)
    assert corners.dtype == np.float64
    assert corners[0].tolist() == [[0, 0, 0], [1, 1, 0], [0, 1, 0]]
    with pytest.raises(InputError, match="prim_id 4294967295 is not in 'mesh', which has 2 triangles"):
        Mesh(SQUARE, TWO_FACES).triangles(np.array([0, 0xFFFFFFFF], np.uint32))


def ply(faces, declared=None):
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {declared or len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(str(int(c)) for c in v) for v in SQUARE]
    rows += [" ".join(map(str, [len(f), *f])) for f in faces]
    return head + "\n".join(rows) + "\n"


def written(tmp_path, name, text):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_file_keeps_order_duplicates_and_degenerate_faces(tmp_path):
    faces = [[2, 1, 0], [0, 0, 1], [0, 1, 2], [0, 1, 2]]
    mesh = load_mesh(written(tmp_path, "square.ply", ply(faces)))
    assert mesh.faces.tolist() == faces
    assert np.array_equal(mesh.vertices, SQUARE)
    assert mesh.name == "square"


def test_polygons_are_cut_into_triangles_of_the_same_area(tmp_path):
    mesh = load_mesh(written(tmp_path, "quad.ply", ply([[0, 1, 2, 3]])))
    corners = mesh.triangles(np.arange(mesh.triangle_count))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert mesh.triangle_count == 2
    assert area.sum() == pytest.approx(1.0)


OBJ_VERTICES = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in SQUARE)


def test_obj_groups_and_materials_do_not_reorder_faces(tmp_path):
    text = "mtllib absent.mtl\n" + OBJ_VERTICES + "usemtl b\nf 1 2 3\nusemtl a\nf 2 3 4\no x\nusemtl b\nf 3 2 1\n"
    mesh = load_mesh(written(tmp_path, "groups.obj", text))
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 2, 3], [2, 1, 0]]


def test_a_scene_graph_is_flattened_with_its_transforms(tmp_path):
    scene = trimesh.Scene()
    part = trimesh.Trimesh(SQUARE, TWO_FACES, process=False)
    for shift in ((5, 0, 0), (0, 7, 0)):
        scene.add_geometry(part, transform=trimesh.transformations.translation_matrix(shift))
    scene.export(tmp_path / "twice.glb")
    mesh = load_mesh(tmp_path / "twice.glb")
    assert mesh.triangle_count == 4
    assert mesh.bounds.tolist() == [[0, 0, 0], [6, 8, 0]]


def test_a_gltf_may_not_name_a_file_outside_its_folder(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    files = trimesh.Scene(trimesh.Trimesh(SQUARE, TWO_FACES, process=False)).export(file_type="gltf")
    for name, content in files.items():
        (inside / name).write_bytes(content)
    assert load_mesh(inside / "model.gltf").triangle_count == 2
    tree = json.loads((inside / "model.gltf").read_text())
    for buffer in tree["buffers"]:
        (inside / buffer["uri"]).rename(tmp_path / ("outside_" + buffer["uri"]))
        buffer["uri"] = "../outside_" + buffer["uri"]
    (inside / "model.gltf").write_text(json.dumps(tree))
    with pytest.raises(InputError, match=r"model\.gltf cannot be read"):
        load_mesh(inside / "model.gltf")


@pytest.mark.parametrize(("name", "text", "message"), [
    ("relative.obj", OBJ_VERTICES + "f -5 -2 -1\n", "line 5, 'f -5 -2 -1', names vertex -5, expected"),
    ("zero.obj", OBJ_VERTICES + "f 1 2 3\\\n  4\nf 0/1 1/2 2/3\n", "line 7, 'f 0/1 1/2 2/3', names vertex 0,"),
    ("zero.obj", "\r".join((*OBJ_VERTICES.split("\n"), "f 1 2 +00")), r"line 6, 'f 1 2 \+00', names vertex \+00,"),
    ("short.ply", ply([[0, 1, 2]], declared=5), "promises 5 rows of the element face, but"),
    ("points.xyz", "0 0 0\n1 1 1\n", "holds no triangles"),
    ("points.obj", OBJ_VERTICES, "holds no triangles"),
    ("line.obj", OBJ_VERTICES + "l 1 2\n", "holds no triangles"),
    ("empty.ply", "", "cannot be read as ply"),
    ("noise.glb", "noise", "cannot be read as glb"),
    ("scene.foo", "", "unknown format 'foo', expected one of .*ply"),
    ("scene", "", "unknown format ''"),
    ("scene.zip", "", "unpack an archive first"),
    ("nan.obj", OBJ_VERTICES + "v nan 0 0\nf 1 2 5\n", "vertex 4 is .nan"),
    ("range.ply", ply([[0, 1, 7]]), "names .*7.* there are 4 vertices"),
    ("range.obj", OBJ_VERTICES + "f 1 2 9\n", "line 5, 'f 1 2 9', names vertex 9, expected 1 to 4"),
])  # fmt: skip
def test_a_file_that_cannot_be_used_is_refused_naming_it(tmp_path, name, text, message):
    path = written(tmp_path, name, text)
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused_naming_them(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.ply does not exist"):
        load_mesh(tmp_path / "nowhere.ply")
    with pytest.raises(InputError, match="is a folder"):
        load_mesh(tmp_path)


@NEEDS_SCENES
@pytest.mark.parametrize(("name", "count"), [*zip(PAPER_SCENES, (1112, 61600, 143163, 262267), strict=True)])
def test_a_scene_of_the_paper_keeps_all_its_triangles(name, count):
    path = Path(os.environ["ATRA_SCENES"]).expanduser() / f"{name}.ply"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    assert load_mesh(path).triangle_count == count
