"""What a mesh file claims is checked against its bytes, and what it promises against what came of it."""

import json

import numpy as np
import pytest
import trimesh

from atra.errors import InputError
from atra.files.meshes.face_sources import load_face_sources
from atra.files.meshes.loading import load_mesh
from tests.files.samples import CORNERS, TRIANGLES, ply, written
from tests.meshes import strips_ply

BOX = trimesh.creation.box()


def exported(path, **options):
    content = BOX.export(file_type=path.suffix[1:], **options)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("suffix", ["obj", "stl", "off", "ply", "glb", "stl_ascii"])
def test_a_whole_file_keeps_its_promise(tmp_path, suffix):
    assert load_mesh(exported(tmp_path / f"box.{suffix}")).triangle_count == 12


@pytest.mark.parametrize(("name", "old", "new", "message"), [
    ("box.off", b"8 12 0", b"8 13 0", "promises 13 faces, but ends before"),
    ("box.off", b"OFF\n8 12 0", b"# OFF 1 1\nOFF # text\n8 99 0 # 1", "promises 99 faces, but ends before"),
    ("box.stl_ascii", b"vertex 0.5", b"vertex O.5", "is no vertex of three numbers"),
    ("box.stl_ascii", b"endsolid", b"end", "seems cut short"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 nan\n", "cannot be read as ply"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 1e300\n", "cannot be read as ply"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 one\n", "cannot be read as ply"),
])  # fmt: skip
def test_a_damaged_text_file_loses_no_face_silently(tmp_path, name, old, new, message):
    path = exported(tmp_path / name, **({"encoding": "ascii"} if name == "ascii.ply" else {}))
    assert old in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        load_mesh(path)


def test_a_face_of_two_corners_is_left_out_and_named(tmp_path):
    path = exported(tmp_path / "box.obj")
    path.write_bytes(path.read_bytes().replace(b"\nf 2 4 1", b"\nf 2 4", 1))
    with pytest.warns(UserWarning, match="1 of 12 faces have fewer than 3 corners and are left out"):
        assert load_mesh(path).triangle_count == 11


def glb_tree(content):
    length = int.from_bytes(content[12:16], "little")
    return json.loads(content[20 : 20 + length]), content[20 + length :]


def with_tree(path, change):
    """The box as GLB with its JSON changed in place."""
    tree, rest = glb_tree(exported(path).read_bytes())
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + np.array([2, 20 + len(text) + len(rest), len(text)], "<u4").tobytes() + b"JSON"
    path.write_bytes(head + text + rest)
    return path


def position(tree):
    return tree["accessors"][tree["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]


def indices(tree):
    return tree["accessors"][tree["meshes"][0]["primitives"][0]["indices"]]


@pytest.mark.parametrize(("change", "message"), [
    (lambda tree: position(tree).pop("bufferView"), "has no numbers, or compressed ones"),
    (lambda tree: indices(tree).pop("bufferView"), "accessor 0 has no numbers, or compressed ones"),
    (lambda tree: position(tree).update(sparse={"count": 1}), "cannot be read as glb: 'indices'"),
    (lambda tree: tree.update(extensionsRequired=["EXT_meshopt_compression"]), "requires the extension 'EXT_mesh"),
    (lambda tree: position(tree).update(count=2.5), r"has the count 2\.5"),
    (lambda tree: position(tree).update(count=-8), "has the count -8"),
    (lambda tree: position(tree).update(count=10**12), "claims 1,000,000,000,012 faces and vertices"),
    (lambda tree: tree.update(accessors=5), "cannot be read as glb"),
])  # fmt: skip
def test_a_gltf_whose_geometry_would_be_read_as_zeros_or_out_of_nothing_is_refused(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        load_mesh(with_tree(tmp_path / "box.glb", change))


def test_a_gltf_may_hold_zeros_that_nothing_uses_and_require_what_is_not_geometry(tmp_path):
    def harmless(tree):
        tree["accessors"].append({"componentType": 5126, "count": 10**12, "type": "VEC3"})
        position(tree)["normalized"] = True  # means nothing for floats
        tree["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual"]

    assert load_mesh(with_tree(tmp_path / "box.glb", harmless)).triangle_count == 12


def test_a_chunk_longer_than_the_file_is_refused_before_it_is_read(tmp_path):
    path = exported(tmp_path / "box.glb")
    content = bytearray(path.read_bytes())
    content[12:16] = b"\xff\xff\xff\xff"
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match="a chunk claims 4294967295 bytes"):
        load_mesh(path)


def test_a_broken_gltf_does_not_become_the_model_beside_it(tmp_path):
    for name, content in trimesh.Scene(BOX).export(file_type="gltf").items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "mine.gltf").write_text("{")
    assert load_mesh(tmp_path / "model.gltf").triangle_count == 12
    with pytest.raises(InputError, match=r"mine\.gltf cannot be read as gltf"):
        load_mesh(tmp_path / "mine.gltf")


def test_a_name_with_control_characters_is_shown_without_them(tmp_path):
    path = exported(tmp_path / "a\x1b[31m\u202e.off")
    assert load_mesh(path).name == r"a\x1b[31m\u202e"
    path.write_bytes(b"")
    with pytest.raises(InputError) as refused:
        load_mesh(path)
    assert str(refused.value).isprintable()
    assert r"a\x1b[31m\u202e.off cannot be read as off" in str(refused.value)


def test_the_strips_of_a_ply_are_triangles_that_wind_alike_and_begin_anew_at_minus_one(tmp_path):
    path = tmp_path / "strips.ply"
    expected = [[0, 1, 2], [2, 1, 3], [2, 3, 4]]
    for strips in ([(0, 1, 2, 3, 4)], [(0, 1, 2, -1, -1, 2, 1, 3, -1, 2, 3, 4, -1)], [(0, 1, 2), (2, 1, 3), (2, 3, 4)]):
        path.write_bytes(strips_ply(strips))
        mesh = load_mesh(path)
        assert np.sort(mesh.faces, axis=1).tolist() == np.sort(expected, axis=1).tolist()
        normals = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
        assert (normals[:, 2] > 0).all()
        assert (load_face_sources(path).face == np.arange(3)).all()
    path.write_bytes(strips_ply([(0, 1, 2, 2, 3, -1, 0, 1), ()]))  # triangles that name 2 twice have no area
    assert load_mesh(path).faces.tolist() == [[0, 1, 2]]
    head = strips_ply([(0,) * 6]).split(b"end_header\n")[0].replace(b"ascii", b"binary_big_endian") + b"end_header\n"
    rows = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 2, 0)], ">f4").tobytes()
    path.write_bytes(head + rows + np.array([9, 0, 1, 2, 3, 4, -1, 1, 3, 2], ">i4").tobytes())
    assert len(load_mesh(path).faces) == 4
    for strip, said in (((0, 1, 9), "names vertex 9"), ((0, 1, -2), "names vertex -2")):
        path.write_bytes(strips_ply([strip]))
        with pytest.raises(InputError, match=said):
            load_mesh(path)


@pytest.mark.parametrize("kind", ["binary_little_endian", "binary_big_endian"])
def test_a_ply_that_promises_more_rows_than_fit_the_memory_is_refused_before_any_is_made(kind, tmp_path, monkeypatch):
    content = ply(CORNERS, TRIANGLES, kind).replace(b"face 12", b"face %d" % (2**32 - 1))
    monkeypatch.setattr(np, "zeros", lambda shape, *_, **__: pytest.fail(f"zeros of {shape} are made"))
    with pytest.raises(InputError, match="promises 4,294,967,295 rows of the element face, but ends before"):
        load_mesh(written(tmp_path, "box.ply", content))
