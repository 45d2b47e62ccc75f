"""Mesh files that are damaged, slow, large or misleading by design: refused, or read in due time."""

import json
import logging
import os
import random
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from atra.errors import InputError
from atra.files.meshes.loading import load_face_sources, load_mesh
from tests.files.samples import CORNERS, SQUARE, TRIANGLES, gltf, obj, ply, written
from tests.folders import ROOT
from tests.meshes import strips_ply

PART = {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}
BOX = trimesh.creation.box()


def exported(folder, name, **options):
    content = BOX.export(file_type=name.rpartition(".")[2], **options)
    return written(folder, name, content)


@pytest.mark.parametrize("suffix", ["obj", "stl", "off", "ply", "glb", "stl_ascii"])
def test_what_trimesh_writes_is_read_whole(tmp_path, suffix):
    assert load_mesh(exported(tmp_path, f"box.{suffix}")).triangle_count == 12


@pytest.mark.parametrize(("name", "old", "new", "message"), [
    ("box.off", b"8 12 0", b"8 13 0", "8 vertices and 13 faces, but has 20 lines"),
    ("box.off", b"OFF\n8 12 0", b"# OFF 1 1\nOFF # text\n8 99 0 # 1", "8 vertices and 99 faces, but has 20 lines"),
    ("box.stl_ascii", b"vertex 0.5", b"vertex O.5", "is no vertex of three numbers"),
    ("box.stl_ascii", b"endsolid", b"end", "seems cut short"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 nan\n", "cannot be read as ply"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 1e300\n", "cannot be read as ply"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 one\n", "cannot be read as ply"),
    ("ascii.ply", b"face 12", b"face 15", "promises 15 rows of the element face, but"),
    ("ascii.ply", b" 1 3 0\n", b" 1 3 8\n", "names vertex 8, but there are 8 vertices"),
    ("box.ply", b"list uchar", b"list float", "header has the line .property list float int .*, which is not read"),
    ("box.glb", None, b"\xff\xff\xff\xff", "a chunk claims 4294967295 bytes"),
])  # fmt: skip
def test_a_damaged_file_loses_no_face_silently(tmp_path, name, old, new, message):
    path = exported(tmp_path, name, **({"encoding": "ascii"} if name == "ascii.ply" else {}))
    content = path.read_bytes()
    old = content[12:16] if old is None else old
    assert old in content
    path.write_bytes(content.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        load_mesh(path)


POINTS = obj(SQUARE, [])


@pytest.mark.parametrize(("name", "text", "message"), [
    ("relative.obj", POINTS + "f -5 -2 -1\n", "line 5, 'f -5 -2 -1', names vertex -5, expected"),
    ("zero.obj", POINTS + "f 1 2 3\\\n  4\nf 0/1 1/2 2/3\n", "line 7, 'f 0/1 1/2 2/3', names vertex 0,"),
    ("zero.obj", POINTS.replace("\n", "\r") + "\rf 1 2 +00", r"line 6, 'f 1 2 \+00', names vertex \+00,"),
    ("range.obj", POINTS + "f 1 2 9\n", "line 5, 'f 1 2 9', names vertex 9, expected 1 to 4"),
    ("nan.obj", POINTS + "v nan 0 0\nf 1 2 5\n", "vertex 4 is .nan"), ("points.obj", POINTS, "holds no triangles"),
    ("empty.ply", "", "cannot be read as ply"), ("noise.glb", "noise", "cannot be read as glb"),
    ("scene.foo", "", "unknown format 'foo', expected one of .*ply"), ("scene", "", "unknown format ''"),
    ("scene.zip", "", "unpack an archive first"), ("nowhere.ply", None, "does not exist"), ("", None, "is a folder"),
])  # fmt: skip
def test_a_file_that_cannot_be_used_is_refused_naming_it(tmp_path, name, text, message):
    path = tmp_path / name if text is None else written(tmp_path, name, text)
    with pytest.raises(InputError, match=message) as caught:
        load_mesh(path)
    assert str(path) in str(caught.value)


def test_a_file_keeps_order_duplicates_and_degenerate_faces(tmp_path):
    faces = [[2, 1, 0], [0, 0, 1], [0, 1, 2], [0, 1, 2]]
    mesh = load_mesh(written(tmp_path, "square.ply", ply(SQUARE, faces)))
    assert (mesh.faces.tolist(), mesh.name) == (faces, "square")
    assert mesh.vertices.tolist() == [list(one) for one in SQUARE]


def test_a_gltf_may_not_name_a_file_outside_its_folder(tmp_path):
    (tmp_path / "inside").mkdir()
    for folder, uri in (("inside", "box.bin"), ("", "../box.bin")):
        content = np.array(CORNERS, "<f4").tobytes() + np.array(TRIANGLES, "<u2").tobytes()
        written(tmp_path / folder, "box.bin", content)
        text = gltf([{"mesh": 0}], buffers=[{"byteLength": len(content), "uri": uri}])
        written(tmp_path / "inside", f"{folder or 'outside'}.gltf", text)
    assert load_mesh(tmp_path / "inside" / "inside.gltf").triangle_count == 12
    with pytest.raises(InputError, match=r"outside\.gltf cannot be read as gltf.*outside its folder"):
        load_mesh(tmp_path / "inside" / "outside.gltf")


def test_a_face_of_two_corners_is_left_out_and_named(tmp_path):
    path = exported(tmp_path, "box.obj")
    path.write_bytes(path.read_bytes().replace(b"\nf 2 4 1", b"\nf 2 4", 1))
    with pytest.warns(UserWarning, match="1 of 12 faces have fewer than 3 corners and are left out"):
        assert load_mesh(path).triangle_count == 11


def changed(folder, change):
    """A box as glTF with its JSON changed in place."""
    tree = json.loads(gltf([{"mesh": 0}]))
    change(tree)
    return written(folder, "box.gltf", json.dumps(tree))


def position(tree):
    return tree["accessors"][0]


def mode(number):
    return lambda tree: tree["meshes"][0]["primitives"][0].update(mode=number)


@pytest.mark.parametrize(("change", "message"), [
    (lambda tree: position(tree).pop("bufferView"), "accessor 0 has no numbers, or compressed ones"),
    (lambda tree: tree["accessors"][1].pop("bufferView"), "accessor 1 has no numbers, or compressed ones"),
    (lambda tree: position(tree).update(sparse={"count": 1}), "cannot be read as gltf: 'indices'"),
    (lambda tree: position(tree).update(count=2.5), r"has the count 2\.5"),
    (lambda tree: position(tree).update(count=-8), "has the count -8"),
    (lambda tree: position(tree).update(count=10**12), "claims 1,000,000,000,012 faces and vertices"),
    (lambda tree: tree.update(accessors=5), "cannot be read as gltf"), (mode(7), "has the mode 7, expected 0 to 6"),
    (lambda tree: tree.update(extensionsRequired=["NEW_compression"]),
     "'NEW_compression', which is not read; .*gltf-transform/cli copy"),
    *((lambda tree, mesh=mesh: tree["nodes"].append({"mesh": mesh}) or tree["scenes"][0]["nodes"].append(1),
       f"names meshes {mesh!r}, but there are 1") for mesh in (1, -1, "0", None)),
    *((lambda tree, nodes=nodes, roots=roots: tree.update(nodes=nodes, scenes=[{"nodes": roots}]),
       "its own ancestor, or has several parents|holds no triangles") for nodes, roots in (
        ([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}], [0]),
        ([{"mesh": 0, "children": [1]}, {"mesh": 0, "children": [0]}], [0]),
        ([{"mesh": 0}], [0, 0]), ([{"mesh": 0, "children": [0]}], []))),
    (lambda tree: tree.update(meshes=[{"primitives": PART["primitives"] * 1500}], nodes=[{"mesh": 0}] * 1500,
                              scenes=[{"nodes": list(range(1500))}]), "claims .* parts and more, which take about"),
])  # fmt: skip
def test_a_gltf_whose_parts_are_not_there_or_too_many_is_refused(change, message, tmp_path):
    with pytest.raises(InputError, match=message):
        load_mesh(changed(tmp_path, change))


def claims_without_use(tree):
    tree["accessors"].append({"componentType": 5126, "count": 10**12, "type": "VEC3"})
    tree["accessors"] += [{"bufferView": 0, "componentType": 5126, "count": 10**6, "type": "MAT4"}] * 10**4
    tree["bufferViews"] += [{"buffer": 0, "byteLength": 10**7}] * 10**4


@pytest.mark.parametrize(("change", "count"), [
    (claims_without_use, 12), (lambda tree: position(tree).update(normalized=True), 12),  # which floats cannot be
    (lambda tree: tree.update(extensionsRequired=["KHR_materials_unlit", "KHR_texture_basisu"]), 12),
    (lambda tree: tree.update(nodes=[{"camera": 0, "children": [1]}, {"mesh": 0}],
                              cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]), 12),
    (mode(6), 34), (lambda tree: tree["nodes"].extend({"name": f"n_{k % 15_000}"} for k in range(30_000)), 12),
], ids=["claims", "normalized", "extensions", "camera", "fan", "names"])  # fmt: skip
def test_what_a_gltf_has_beside_its_triangles_disturbs_none(change, count, tmp_path):
    assert load_mesh(changed(tmp_path, change)).triangle_count == count


READ = """
import sys
from atra.files.meshes.loading import load_mesh
for path in sys.argv[1:]:
    try: print(load_mesh(path).triangle_count)
    except Exception as error: print(error)
"""


def read_elsewhere(*paths):
    """What reading each file gives, in one process that has 45 s for all."""
    command = [sys.executable, "-c", READ, *map(str, paths)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=45).stdout.splitlines()


def test_a_file_takes_no_more_than_linear_time(tmp_path):
    """Well below a second each; what they are to catch takes minutes."""
    chain = [{"mesh": 0, "translation": [1, 0, 0], "children": [number + 1]} for number in range(3_000)]
    rows = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0"
    facet = f"solid a\nfacet normal 0 0 1\nouter loop\n{rows}\nendloop\nendfacet\nendsolid a\n"
    faces = "".join(f"# usemtl {number}\nf 1 2 3\n" for number in range(20_000))
    files = [
        written(tmp_path, "chain.gltf", gltf([*chain, {"mesh": 0}], scenes=[{"nodes": [0]}])),
        written(tmp_path, "solids.stl", facet * 30_000),
        written(tmp_path, "comments.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n" * 5_000 + faces),
    ]
    assert read_elsewhere(*files) == [str(3001 * 12), "30000", "20000"]


@pytest.mark.parametrize("seed", range(4))
def test_parts_come_in_the_order_of_the_nodes_and_where_the_scene_graph_puts_them(seed, tmp_path):
    choose = random.Random(seed)
    nodes, roots = [], []
    for number in range(40):
        node = {"name": choose.choice(("a", "world", f"n{number}")), "children": []}
        if choose.random() < 0.7:
            node["mesh"] = choose.randrange(2)
        if choose.random() < 0.5:
            turn = np.array([choose.gauss(0, 1) for _ in range(4)])
            node["translation"] = [choose.uniform(-1, 1) for _ in range(3)]
            node["rotation"] = (turn / np.linalg.norm(turn)).tolist()
            node["scale"] = [choose.uniform(0.5, 2) for _ in range(3)]
        elif choose.random() < 0.5:
            node["matrix"] = [1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, *(choose.uniform(-1, 1) for _ in range(3)), 1]
        parent = choose.randrange(-2, number) if number else -1
        (nodes[parent]["children"] if parent >= 0 else roots).append(number)
        nodes.append(node)
    meshes = [PART, {"primitives": PART["primitives"] * 3}]
    path = written(tmp_path, "scene.gltf", gltf(nodes, scenes=[{"nodes": roots}], meshes=meshes))
    scene = trimesh.load_scene(path, process=False)
    expected = []
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph.get(name)
        expected.append(trimesh.transform_points(scene.geometry[geometry].vertices, transform))
    mesh, sources = load_mesh(path), load_face_sources(path)
    assert mesh.triangle_count == 12 * len(expected) > 120
    found, expected = mesh.vertices.reshape(-1, 24), np.reshape(expected, (-1, 24))
    distance = np.abs(found[:, None] - expected[None]).max(axis=2)
    assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 1e-4

    def placed(number):
        own = [12, 36][nodes[number]["mesh"]] if "mesh" in nodes[number] else 0
        return [number] * own + [one for child in nodes[number]["children"] for one in placed(child)]

    assert sources.node.tolist() == [one for root in roots for one in placed(root)]


@pytest.mark.parametrize(
    ("rows", "properties", "message"),
    [(500, 900, "promises 500 rows of the element thing, but ends before"), (0, 10_000, "holds no triangles")],
)
def test_a_ply_of_more_values_than_bytes_or_of_endless_properties_is_refused(rows, properties, message, tmp_path):
    names = "".join(f"property list uchar int p{number}\n" for number in range(properties))
    text = f"ply\nformat ascii 1.0\nelement thing {rows}\n{names}end_header\n" + "1\n" * rows
    with pytest.raises(InputError, match=message):
        load_mesh(written(tmp_path, "wide.ply", text))


@pytest.mark.parametrize("kind", ["binary_little_endian", "binary_big_endian"])
def test_a_ply_that_promises_more_rows_than_fit_the_memory_is_refused_before_any_is_made(kind, tmp_path, monkeypatch):
    content = ply(CORNERS, TRIANGLES, kind).replace(b"face 12", b"face %d" % (2**32 - 1))
    for name in ("zeros", "empty"):
        make = getattr(np, name)
        monkeypatch.setattr(
            np, name, lambda shape, *more, make=make, **options: make(shape, *more, **options)
            if np.prod(shape) < 10**6 else pytest.fail(f"an array of {shape} is made")
        )  # fmt: skip
    with pytest.raises(InputError, match="promises 4,294,967,295 rows of the element face, but ends before"):
        load_mesh(written(tmp_path, "box.ply", content))


def test_the_strips_of_a_ply_are_triangles_that_wind_alike_and_begin_anew_at_minus_one(tmp_path):
    expected = [[0, 1, 2], [2, 1, 3], [2, 3, 4]]
    for strips in ([(0, 1, 2, 3, 4)], [(0, 1, 2, -1, -1, 2, 1, 3, -1, 2, 3, 4, -1)], [(0, 1, 2), (2, 1, 3), (2, 3, 4)]):
        path = written(tmp_path, "strips.ply", strips_ply(strips))
        mesh = load_mesh(path)
        assert np.sort(mesh.faces, axis=1).tolist() == np.sort(expected, axis=1).tolist()
        normals = np.cross(*(mesh.vertices[mesh.faces[:, k]] - mesh.vertices[mesh.faces[:, 0]] for k in (1, 2)))
        assert (normals[:, 2] > 0).all()
        assert (load_face_sources(path).face == np.arange(3)).all()
    path.write_bytes(strips_ply([(0, 1, 2, 2, 3, -1, 0, 1), ()]))  # triangles that name 2 twice have no area
    assert load_mesh(path).faces.tolist() == [[0, 1, 2]]
    head = strips_ply([(0,) * 6]).split(b"end_header\n")[0].replace(b"ascii", b"binary_big_endian") + b"end_header\n"
    rows = struct.pack(">15f", 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0)
    path.write_bytes(head + rows + struct.pack(">10i", 9, 0, 1, 2, 3, 4, -1, 1, 3, 2))
    assert len(load_mesh(path).faces) == 4
    for strip, said in (((0, 1, 9), "names vertex 9"), ((0, 1, -2), "names vertex -2")):
        path.write_bytes(strips_ply([strip]))
        with pytest.raises(InputError, match=said):
            load_mesh(path)


def test_materials_hidden_in_comments_or_another_encoding_reorder_no_faces(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n# usemtl b\nf 1 2 3\n# usemtl a\nf 2 3 4\n# usemtl b\nf 3 2 1\n"
    assert load_mesh(written(tmp_path, "scene.obj", text)).faces.tolist() == [[0, 1, 2], [1, 2, 3], [2, 1, 0]]
    with pytest.raises(InputError, match="holds no triangles"):
        load_mesh(written(tmp_path, "scene.obj", text.replace("# ", "").encode("utf-16")))


def test_what_trimesh_only_warns_of_is_refused_in_its_words_and_nothing_is_printed(tmp_path, monkeypatch, caplog):
    def careless(*_, **__):
        logging.getLogger("trimesh.util").warning("went on without half of it")

    monkeypatch.setattr(trimesh, "load_scene", careless)
    with pytest.raises(InputError, match="went on without half of it"):
        load_mesh(written(tmp_path, "points.xyz", "0 0 0\n"))
    assert caplog.records == []
    logging.getLogger("trimesh.util").warning("elsewhere it may")
    assert len(caplog.records) == 1


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_refused_instead_of_waited_for(tmp_path):
    path = written(tmp_path, "scene.gltf", gltf([{"mesh": 0}], buffers=[{"byteLength": 168, "uri": "points.bin"}]))
    os.mkfifo(tmp_path / "points.bin")
    os.mkfifo(tmp_path / "pipe.gltf")
    said = read_elsewhere(path, tmp_path / "pipe.gltf")
    expected = ("names 'points.bin', which is no file", "pipe.gltf is no regular file")
    assert [one in line for one, line in zip(expected, said, strict=True)] == [True, True]


def test_a_buffer_that_is_named_a_thousand_times_is_read_once(tmp_path, monkeypatch):
    names = ["points.bin", "./points.bin", "././points.bin"] * 300
    buffers = [{"byteLength": 168, "uri": name} for name in names]
    path = written(tmp_path, "scene.gltf", gltf([{"mesh": 0}], buffers=buffers))
    written(tmp_path, "points.bin", np.array(CORNERS, "<f4").tobytes() + np.array(TRIANGLES, "<u2").tobytes())
    read, given = [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: read.append(self.name) or given(self))
    assert load_mesh(path).triangle_count == 12
    assert read == ["scene.gltf", "points.bin"]


def test_a_name_with_control_characters_is_shown_without_them(tmp_path):
    path = exported(tmp_path, "a\x1b[31m\u202e.off")
    assert load_mesh(path).name == r"a\x1b[31m\u202e"
    path.write_bytes(b"")
    with pytest.raises(InputError) as refused:
        load_mesh(path)
    assert str(refused.value).isprintable()
    assert r"a\x1b[31m\u202e.off cannot be read as off" in str(refused.value)
