"""Which face, material and node of a file each triangle is of: its corners must be corners of that face."""

import json

import numpy as np
import pytest
import trimesh

import atra
from atra.errors import InputError

QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
MIXED = [(0, 1, 3, 2), (4, 6, 7), (0, 4, 5, 1, 3), (2, 3, 7, 6), (0, 2, 6), (1, 5, 7, 3, 2, 0)]
CORNERS = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]


def write(kind, faces, folder):
    """The corners of a box and these faces, as a file."""
    lines = "".join(" ".join(map(str, row)) + "\n" for row in (*CORNERS, *((len(face), *face) for face in faces)))
    header = "element vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    path = folder / f"box.{kind.removeprefix('binary ')}"
    if kind == "ply":
        path.write_text(f"ply\nformat ascii 1.0\n{header}{lines}", encoding="utf-8")
    elif kind == "binary ply":
        rows = b"".join(np.uint8(len(face)).tobytes() + np.array(face, "<i4").tobytes() for face in faces)
        header = f"ply\nformat binary_little_endian 1.0\n{header}".encode()
        path.write_bytes(header + np.array(CORNERS, "<f4").tobytes() + rows)
    elif kind == "off":
        path.write_text(f"OFF # a box\n8 {len(faces)} 0\n{lines}", encoding="utf-8")
    else:
        rows = ["mtllib none.mtl", *(f"v {x} {y} {z}" for x, y, z in CORNERS)]
        for number, face in enumerate(faces):
            rows += [f"usemtl {'red' if number % 3 else 'blue sky'}"] * (number > 0)
            rows.append("f " + " ".join(f"{corner + 1}" for corner in face))
        path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


KINDS = ("ply", "binary ply", "off", "obj")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("faces", [*([face] * 3 for face in MIXED[:3]), QUADS, MIXED])
@pytest.mark.filterwarnings("ignore:.*do not lie in a plane")
def test_every_triangle_lies_in_the_face_that_it_is_said_to_be_of(kind, faces, tmp_path):
    path = write(kind, faces, tmp_path)
    mesh, sources = atra.load_mesh(path), atra.load_face_sources(path)
    assert np.bincount(sources.face, minlength=len(faces)).tolist() == [len(face) - 2 for face in faces]
    places = np.array(CORNERS, float)
    for corners, face in zip(mesh.triangles(np.arange(mesh.triangle_count)), sources.face, strict=True):
        own = {tuple(places[corner]) for corner in faces[face]}
        assert {tuple(corner) for corner in corners} <= own


@pytest.mark.parametrize("kind", KINDS)
def test_both_halves_of_a_quad_come_one_after_the_other(kind, tmp_path):
    face = atra.load_face_sources(write(kind, QUADS, tmp_path)).face
    assert face.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]


def test_the_materials_of_an_obj_are_those_of_its_lines(tmp_path):
    sources = atra.load_face_sources(write("obj", MIXED, tmp_path))
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
