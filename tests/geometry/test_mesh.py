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


@pytest.mark.parametrize(
    "again", [lambda mesh: mesh, copy.deepcopy, copy.copy, lambda mesh: pickle.loads(pickle.dumps(mesh))]
)
def test_a_mesh_and_its_copies_hold_private_contiguous_arrays_that_cannot_be_written(again):
    vertices, faces = np.asfortranarray([[9, 9, 9], *SQUARE.tolist()], np.float32), TWO_FACES + 1
    mesh = Mesh(vertices, faces, "square")
    vertices[:] = faces[:] = 3
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 0]]  # without the vertex that no face uses
    same = again(mesh)
    assert (same.name, same.bounds.dtype) == ("square", np.float64)
    assert np.array_equal(same.bounds, mesh.bounds)
    for array, dtype, expected in ((same.vertices[1:], np.float32, SQUARE), (same.faces, np.uint32, TWO_FACES + 1)):
        assert np.array_equal(array, expected)
        assert array.dtype == dtype
        assert array.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    with pytest.raises(AttributeError, match="name cannot be set: a mesh does not change"):
        same.name = "another"


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


OBJ_VERTICES = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in SQUARE)


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
    ("points.obj", OBJ_VERTICES, "holds no triangles"),
    ("empty.ply", "", "cannot be read as ply"),
    ("noise.glb", "noise", "cannot be read as glb"),
    ("scene.foo", "", "unknown format 'foo', expected one of .*ply"),
    ("scene", "", "unknown format ''"),
    ("scene.zip", "", "unpack an archive first"),
    ("nan.obj", OBJ_VERTICES + "v nan 0 0\nf 1 2 5\n", "vertex 4 is .nan"),
    ("range.ply", ply([[0, 1, 7]]), "names .*7.* there are 4 vertices"),
    ("range.obj", OBJ_VERTICES + "f 1 2 9\n", "line 5, 'f 1 2 9', names vertex 9, expected 1 to 4"),
    ("nowhere.ply", None, "does not exist"),
    ("", None, "is a folder"),
])  # fmt: skip
def test_a_file_that_cannot_be_used_is_refused_naming_it(tmp_path, name, text, message):
    path = tmp_path / name if text is None else written(tmp_path, name, text)
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(path)
    assert str(path) in str(caught.value)


@NEEDS_SCENES
@pytest.mark.parametrize(("name", "count"), [*zip(PAPER_SCENES, (1112, 61600, 143163, 262267), strict=True)])
def test_a_scene_of_the_paper_keeps_all_its_triangles(name, count):
    path = Path(os.environ["ATRA_SCENES"]).expanduser() / f"{name}.ply"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    assert load_mesh(path).triangle_count == count
