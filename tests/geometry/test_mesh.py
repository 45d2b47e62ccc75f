"""The mesh keeps what it is given, in order, and refuses what cannot be traced."""

import copy
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

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


@NEEDS_SCENES
@pytest.mark.parametrize(("name", "count"), [*zip(PAPER_SCENES, (1112, 61600, 143163, 262267), strict=True)])
def test_a_scene_of_the_paper_keeps_all_its_triangles(name, count):
    path = Path(os.environ["ATRA_SCENES"]).expanduser() / f"{name}.ply"
    if not path.is_file():
        pytest.skip(f"{path} is not there")
    assert load_mesh(path).triangle_count == count
