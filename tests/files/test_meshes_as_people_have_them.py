"""Mesh files that are valid but unusual: read right, or refused for the true reason. Expected values are by hand."""

import base64
import struct
import sys
import zipfile

import numpy as np
import pytest

import atra
from atra.errors import InputError
from tests.files.samples import (
    ARROWHEAD,
    CORNERS,
    FORMS,
    QUADS,
    SQUARE,
    TRIANGLES,
    L,
    area,
    corners_of,
    gltf,
    obj,
    ply,
    quiet,
    three_mf,
    volume,
    written,
)


def is_a_solid_box(mesh, low):
    """Whether a box of side 1 from `low` is entered through its bottom and left through its top."""
    low = np.asarray(low, float)
    with atra.RayScene(mesh) as scene:
        inside = scene.contains([low + 0.5, low + 1.5]).tolist() == [True, False]
        hits = scene.all_hits([low + (0.4, 0.5, -1)], [(0, 0, 1)])
        return inside and hits.normals[:, 2].tolist() == [-1, 1] and hits.leaving.tolist() == [False, True]


@pytest.mark.parametrize("form", ["gltf", "3mf"])
def test_a_mirrored_part_is_as_solid_as_its_copy(form, tmp_path):
    if form == "gltf":
        nodes = [{"mesh": 0, "translation": [3, 0, 0]}, {"mesh": 0, "scale": [-1, 1, 1]}]
        path, lone = (written(tmp_path, f"{len(some)}.gltf", gltf(some)) for some in (nodes, nodes[1:]))
    else:
        items = ["1 0 0 0 1 0 0 0 1 3 0 0", "-1 0 0 0 1 0 0 0 1 0 0 0"]
        path, lone = (three_mf(tmp_path / f"{len(some)}.3mf", some) for some in (items, items[1:]))
    mesh = quiet(lone)
    assert volume(mesh) == pytest.approx(1.0)
    assert is_a_solid_box(mesh, (-1, 0, 0))
    assert volume(quiet(path)) == pytest.approx(2.0)


def test_two_mirrors_of_nested_nodes_are_none(tmp_path):
    nodes = [{"scale": [-1, 1, 1], "children": [1]}, {"mesh": 0, "scale": [1, -1, 1]}]
    path = written(tmp_path, "nested.gltf", gltf(nodes, scenes=[{"nodes": [0]}]))
    assert volume(quiet(path)) == pytest.approx(1.0)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "shape", [L, L[::-1], ARROWHEAD, ARROWHEAD[::-1]], ids=["L", "turned L", "arrow", "turned arrow"]
)
def test_a_concave_polygon_has_its_area_in_one_layer_from_any_first_corner(form, shape, tmp_path):
    expected = 3.0 if len(shape) == 6 else 0.21
    for first in range(len(shape)):
        corners = np.roll(shape, first, axis=0).tolist()
        mesh = quiet(written(tmp_path, f"shape.{form}", FORMS[form](corners, [range(len(shape))])))
        a, b, c = corners_of(mesh).transpose(1, 0, 2)
        assert area(mesh) == pytest.approx(expected)
        signed = np.cross(b - a, c - a)[:, 2].sum() / 2
        assert signed == pytest.approx(expected if shape in (L, ARROWHEAD) else -expected)


def test_a_concave_polygon_in_a_tilted_plane_has_its_area(tmp_path):
    turn = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation
    mesh = quiet(written(tmp_path, "tilted.obj", obj((np.array(L) @ turn.T + 5).tolist(), [range(6)])))
    assert area(mesh) == pytest.approx(3.0, rel=1e-5)


STAR = [(np.cos(k * 4 * np.pi / 5), np.sin(k * 4 * np.pi / 5), 0.0) for k in range(5)]


@pytest.mark.parametrize(("corners", "told"), [
    ([(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 2, 0)], "cross themselves"),
    ([(0, 0, 0), (2, 2, 0), (2, 0, 0), (0, 1, 0)], "cross themselves"), (STAR, "cross themselves"),
    ([(0, 0, 0), (1, 0, 0), (1, 1, 0.5), (0, 1, 0)], "do not lie in a plane"),
], ids=["bow tie", "uneven bow tie", "star", "bent"])  # fmt: skip
def test_a_polygon_that_crosses_itself_or_is_bent_is_named_in_one_warning(corners, told, tmp_path):
    text = obj(corners, [(0, 1, 2), range(len(corners)), range(len(corners))])
    expected = rf"shape\.obj: 2 of 3 faces are polygons that {told}.*first: face 1"
    with pytest.warns(UserWarning, match=expected) as warned:
        mesh = atra.load_mesh(written(tmp_path, "shape.obj", text))
    assert len(warned) == len(mesh.notes) == 1
    assert mesh.triangle_count == 1 + 2 * (len(corners) - 2)


def test_faces_and_materials_come_in_the_order_of_the_file_however_many_corners_they_have(tmp_path):
    text = obj([*SQUARE, *((x, y, 5) for x, y, _ in L)], [range(4, 10), (0, 1, 2, 3), (0, 1, 2)])
    text = text.replace("f 1 2 3 4\n", "usemtl a\nf 1 2 3 4\nusemtl b\n")
    sources = atra.load_face_sources(written(tmp_path, "mixed.obj", text))
    assert sources.face.tolist() == [0, 0, 0, 0, 1, 1, 2]
    assert sources.material.tolist() == [-1] * 4 + [0, 0, 1]
    mesh = quiet(tmp_path / "mixed.obj")
    assert mesh.faces[4:].tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]
    assert (corners_of(mesh)[:4, :, 2] == 5).all()


def box_of_cells(path, *cells):
    """A file of cells between the corners of a box."""
    meshio = pytest.importorskip("meshio")
    cells = [(kind, np.array(rows)) for kind, rows in cells]
    meshio.Mesh(np.array(CORNERS, float), cells).write(path)
    return path


@pytest.mark.parametrize("suffix", ["vtk", "vtu", "msh", "inp", "mesh", "bdf"])
def test_what_meshio_writes_with_mixed_cells_has_all_its_faces(suffix, tmp_path):
    path = tmp_path / f"box.{suffix}"
    mesh = quiet(box_of_cells(path, ("triangle", TRIANGLES[:2]), ("quad", QUADS[1:])))
    assert (mesh.triangle_count, area(mesh), volume(mesh)) == (12, pytest.approx(6), pytest.approx(1))


def test_cells_that_are_no_faces_are_named(tmp_path):
    with pytest.warns(UserWarning, match="1 cells of the kind line are left out"):
        mesh = atra.load_mesh(box_of_cells(tmp_path / "box.vtk", ("line", [(0, 1)]), ("quad", QUADS)))
    assert (mesh.triangle_count, volume(mesh)) == (12, pytest.approx(1))
    with pytest.raises(InputError, match=r"holds no triangles .1 cells of the kind tetra are left out"):
        atra.load_mesh(box_of_cells(tmp_path / "solid.vtk", ("tetra", [(0, 1, 2, 4)])))


@pytest.mark.parametrize("change", [
    lambda text: text.replace("v ", "v\t"), lambda text: text.replace("v ", "  v  "),
    lambda text: "\ufeff" + text, lambda text: text.replace(" ", "\t"), lambda text: text.replace("\n", "\r"),
    lambda text: text.replace("\n", "\r\n"), lambda text: text.replace("v 0", "v \\\n 0").replace("f 1", "f \\\r\n 1"),
    lambda text: text.replace("\nf", " # comment\nf"), lambda text: text.replace("\nv", " 0.5 0.5 0.5\nv"),
    lambda text: text.replace("\nv", "e+0\nv"), lambda text: text.replace("\nf", "\nvt 0 0\nvn 0 0 1\nvp 9 9 9\nf"),
    lambda text: text.rstrip("\n"),
], ids=["tab", "blanks", "mark", "tabs", "old Mac", "Windows", "continued", "comment", "colours", "exponent", "others",
        "no end"])  # fmt: skip
def test_unusual_lines_of_an_obj_are_what_they_say(change, tmp_path):
    mesh = quiet(written(tmp_path, "box.obj", change(obj(CORNERS, TRIANGLES))))
    assert mesh.vertices.tolist() == np.array(CORNERS, float).tolist()
    assert mesh.faces.tolist() == [list(one) for one in TRIANGLES]


def test_a_vertex_line_that_is_none_is_named(tmp_path):
    with pytest.raises(InputError, match=r"box\.obj.*line 3, 'v 0 1 x', has no three numbers"):
        atra.load_mesh(written(tmp_path, "box.obj", obj(CORNERS, TRIANGLES).replace("v 0 1 0", "v 0 1 x")))


@pytest.mark.parametrize("text", [
    "vt 0 0\nvt 1 0\nvt 0 1\nv 9 9 9\nf 1/1 2/2 3/3\n", "f 1/1/1 2/2/2 3/3/3\n", "f 1//1 2//2 3//3\n", "f 1/ 2/ 3/\n",
    "vt 0 0\nf 1/1 2/1 3/1\nf 1 2 3\n", "f -4 -3 -2\n", "f 1 -3 3\n", "f +1 02 3\n",
], ids=["unused", "no vt", "normals", "slashes", "some", "relative", "mixed", "signs"])  # fmt: skip
def test_texture_coordinates_and_relative_indices_disturb_no_face(text, tmp_path):
    mesh = quiet(written(tmp_path, "square.obj", obj(SQUARE, []) + text))
    assert mesh.faces[0].tolist() == [0, 1, 2]
    assert mesh.vertices[:4].tolist() == np.array(SQUARE, float).tolist()


def test_relative_indices_count_from_where_they_stand(tmp_path):
    text = obj(SQUARE[:3], []) + "f -3 -2 -1\n" + obj(L[:3], []) + "f -3 -2 -1\n"
    assert quiet(written(tmp_path, "twice.obj", text)).faces.tolist() == [[0, 1, 2], [3, 4, 5]]


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_triangles_and_quads_mixed_in_a_ply_are_read(kind, tmp_path):
    mesh = quiet(written(tmp_path, "box.ply", ply(CORNERS, [*TRIANGLES[:2], *QUADS[1:]], kind)))
    assert (mesh.triangle_count, volume(mesh)) == (12, pytest.approx(1))
    assert atra.load_face_sources(tmp_path / "box.ply").face.tolist() == [0, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6]


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("faces", [TRIANGLES, [*TRIANGLES[:2], *QUADS[1:]]], ids=["alike", "mixed"])
def test_other_properties_of_a_face_in_a_ply_are_passed_over(order, faces, tmp_path):
    content = ply(CORNERS, faces, f"binary_{order}_endian", "property int label\n", "property int part\n")
    assert volume(quiet(written(tmp_path, "box.ply", content))) == pytest.approx(1)


def binary_stl(triangles, header=b"a box"):
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(one), 0) for one in triangles)
    return header.ljust(80) + struct.pack("<I", len(triangles)) + rows


BOX = np.array(CORNERS, float)[np.array(TRIANGLES)]


@pytest.mark.parametrize("header", [b"a box", b"solid box"])
def test_bytes_after_a_binary_stl_are_named_and_it_is_read(header, tmp_path):
    with pytest.warns(UserWarning, match=r"box\.stl: 1 bytes after its 12 facets are left out"):
        mesh = atra.load_mesh(written(tmp_path, "box.stl", binary_stl(BOX, header) + b"\n"))
    assert (mesh.triangle_count, volume(mesh)) == (12, pytest.approx(1))
    with pytest.raises(InputError, match="promises 12 facets, but has only 683 bytes; it seems cut short"):
        atra.load_mesh(written(tmp_path, "box.stl", binary_stl(BOX, header)[:-1]))


@pytest.mark.parametrize("form", FORMS)
def test_a_vertex_that_is_no_number_may_stand_unused_but_not_used(form, tmp_path):
    vertices = [*CORNERS, (float("nan"), 0, 0), (0, float("inf"), 0)]
    with pytest.warns(UserWarning, match="2 vertices that no face uses are not finite"):
        mesh = atra.load_mesh(written(tmp_path, f"box.{form}", FORMS[form](vertices, QUADS)))
    assert volume(mesh) == pytest.approx(1)
    assert np.isfinite(mesh.vertices).all()
    with pytest.raises(InputError, match=r"vertex 8 is \(nan, 0\.0, 0\.0\), expected finite numbers"):
        atra.load_mesh(written(tmp_path, f"bad.{form}", FORMS[form](vertices, [*QUADS, (0, 1, 8)])))


def test_the_names_of_microsoft_for_no_number_are_read(tmp_path):
    text = obj(SQUARE, [(0, 1, 2)]) + "v -1.#IND 1.#QNAN 1.#INF\nv nan(ind) -inf Infinity\n"
    with pytest.warns(UserWarning, match="2 vertices that no face uses"):
        assert atra.load_mesh(written(tmp_path, "square.obj", text)).triangle_count == 1


def test_a_3mf_has_the_unit_that_it_states_and_millimetres_if_none(tmp_path):
    inches = three_mf(tmp_path / "inch.3mf", ["1 0 0 0 1 0 0 0 1 0 0 0"], "inch")
    mesh = quiet(inches)
    assert (mesh.units, mesh.bounds[1].tolist()) == ("inch", [1, 1, 1])
    in_mm = quiet(inches, scale=25.4)
    assert in_mm.units is None
    assert in_mm.bounds[1] == pytest.approx([25.4] * 3)
    plain = written(tmp_path, "box.obj", obj(CORNERS, QUADS))
    assert quiet(plain).units is None
    assert quiet(written(tmp_path, "box.gltf", gltf([{"mesh": 0}]))).units == "meter"
    for wrong in (0, -1, float("nan"), "x"):
        with pytest.raises(InputError, match=r"scale is .*, expected a number above 0"):
            atra.load_mesh(plain, scale=wrong)


def test_components_of_a_3mf_are_placed_inside_of_items_and_none_contains_itself(tmp_path):
    twice = '<object id="2"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'
    twice += '<component objectid="1"/></components></object>'
    path = three_mf(tmp_path / "two.3mf", ['2 0 0 0 2 0 0 0 2 0 0 0" objectid="2"'[:-1]], more=twice)
    content = zipfile.ZipFile(path).read("3D/3dmodel.model").decode().replace('<item objectid="1" ', "<item ")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", content)
    mesh = quiet(path)
    assert volume(mesh) == pytest.approx(16)
    assert mesh.bounds.tolist() == [[0, 0, 0], [12, 2, 2]]
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", content.replace('<component objectid="1"/>', '<component objectid="2"/>'))
    with pytest.raises(InputError, match="nested deeper than 100, or contains itself"):
        atra.load_mesh(path)


def test_a_draco_gltf_is_read_with_its_package_and_names_it_without(tmp_path, monkeypatch):
    draco = pytest.importorskip("DracoPy")
    coded = draco.encode(np.array(CORNERS, np.float32), np.array(TRIANGLES, np.uint32), quantization_bits=14)
    name = "KHR_draco_mesh_compression"
    primitive = {
        "attributes": {"POSITION": 0}, "indices": 1,
        "extensions": {name: {"bufferView": 0, "attributes": {"POSITION": 0}}},
    }  # fmt: skip
    text = gltf(
        [{"mesh": 0}],
        buffers=[{"byteLength": len(coded), "uri": "data:;base64," + base64.b64encode(coded).decode()}],
        bufferViews=[{"buffer": 0, "byteLength": len(coded)}],
        accessors=[{"componentType": 5126, "count": 8, "type": "VEC3"},
                   {"componentType": 5123, "count": 36, "type": "SCALAR"}],
        meshes=[{"primitives": [primitive]}], extensionsUsed=[name], extensionsRequired=[name],
    )  # fmt: skip
    path = written(tmp_path, "box.gltf", text)
    mesh = quiet(path)
    assert (mesh.triangle_count, volume(mesh)) == (12, pytest.approx(1, abs=1e-3))
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(InputError, match=f"compressed by {name}, which the package DracoPy reads: pip install DracoPy"):
        atra.load_mesh(path)


def test_sparse_normalized_and_strip_geometry_of_a_gltf_is_read(tmp_path):
    """A strip of four corners at 0 and 1, the last of which a sparse accessor moves from (1, 1, 0) to (1, 1, 1)."""
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], "u1") * 255
    content = np.hstack([corners, np.zeros((4, 1), "u1")]).tobytes() + bytes([3, 0, 0, 0, 255, 255, 255, 0])
    accessor = {
        "bufferView": 0, "componentType": 5121, "normalized": True, "count": 4, "type": "VEC3",
        "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121},
                   "values": {"bufferView": 1, "byteOffset": 4}},
    }  # fmt: skip
    text = gltf(
        [{"mesh": 0}], accessors=[accessor], meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 5}]}],
        buffers=[{"byteLength": 24, "uri": "data:;base64," + base64.b64encode(content).decode()}],
        bufferViews=[{"buffer": 0, "byteLength": 16, "byteStride": 4},
                     {"buffer": 0, "byteOffset": 16, "byteLength": 8}],
        extensionsRequired=["KHR_mesh_quantization"],
    )  # fmt: skip
    mesh = quiet(written(tmp_path, "strip.gltf", text))
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]]
    assert mesh.faces.tolist() == [[0, 1, 2], [1, 3, 2]]


@pytest.mark.parametrize("text", [
    "OFF3 1 0\n{}", "OFF 3 1 0\n{}", "OFF\n\n# a comment\n3 1 0\n\n{}", "3 1\n{}", "COFF\n3 1 0\n{}",
], ids=["ModelNet", "one line", "comments", "no word", "colours"])  # fmt: skip
def test_the_ways_to_begin_an_off_are_all_read(text, tmp_path):
    rows = "0 0 0 255 0 0 255\n1 0 0 255 0 0 255 # red\n\n0 1 0 255 0 0 255\n3 0 1 2 0.5 0.5 0.5\n"
    assert area(quiet(written(tmp_path, "one.off", text.format(rows)))) == pytest.approx(0.5)


@pytest.mark.parametrize(("suffix", "package"), [("vtk", "meshio"), ("dae", "pycollada"), ("step", "cascadio")])
def test_a_format_whose_package_is_missing_names_it(suffix, package, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio", None)
    from trimesh.exchange.load import mesh_loaders

    monkeypatch.delitem(mesh_loaders, suffix, raising=False)
    with pytest.raises(InputError, match=f"pip install {package}"):
        atra.load_mesh(written(tmp_path, f"a.{suffix}", ""))
