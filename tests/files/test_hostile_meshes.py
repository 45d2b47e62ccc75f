"""Small mesh files that are slow, large or misleading by design: read in time their size accounts for, or refused."""

import base64
import json
import logging
import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from atra.errors import InputError
from atra.files.meshes.face_sources import load_face_sources
from atra.files.meshes.loading import load_mesh

ROOT = Path(__file__).resolve().parents[2]
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
PART = {"primitives": [{"attributes": {"POSITION": 0}}]}


def gltf(folder, nodes, roots, **more):
    """Nodes that place one triangle."""
    text = base64.b64encode(TRIANGLE.tobytes()).decode()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": TRIANGLE.nbytes, "uri": f"data:;base64,{text}"}],
        "bufferViews": [{"buffer": 0, "byteLength": TRIANGLE.nbytes}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [PART],
        "nodes": nodes,
        "scenes": [{"nodes": roots}],
        **more,
    }
    path = folder / "scene.gltf"
    path.write_text(json.dumps(tree))
    return path


def chain(folder):
    last = 3_000
    nodes = [{"mesh": 0, "translation": [1, 0, 0], "children": [number + 1]} for number in range(last)]
    return gltf(folder, [*nodes, {"mesh": 0}], [0])


def many_nodes_of_few_names(folder):
    nodes = [{"name": f"n_{number % 15_000}"} for number in range(30_000)]
    return gltf(folder, [*nodes, {"mesh": 0}], [len(nodes)])


def many_solids_of_one_name(folder):
    rows = "\n".join(f"vertex {x} {y} {z}" for x, y, z in TRIANGLE)
    path = folder / "scene.stl"
    path.write_text(f"solid a\nfacet normal 0 0 1\nouter loop\n{rows}\nendloop\nendfacet\nendsolid a\n" * 30_000)
    return path


def many_materials_in_comments(folder):
    path = folder / "scene.obj"
    vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" * 5_000
    path.write_text(vertices + "".join(f"# usemtl {number}\nf 1 2 3\n" for number in range(20_000)))
    return path


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
    (tmp_path / "other").mkdir()
    written = [
        chain(tmp_path), many_nodes_of_few_names(tmp_path / "other"), many_solids_of_one_name(tmp_path),
        many_materials_in_comments(tmp_path),
    ]  # fmt: skip
    assert read_elsewhere(*written) == ["3001", "1", "30000", "20000"]


@pytest.mark.parametrize("seed", range(8))
def test_parts_come_in_the_order_of_the_nodes_and_where_the_scene_graph_puts_them(seed, tmp_path):
    choose = random.Random(seed)
    nodes = []
    roots = []
    for number in range(40):
        node = {"name": choose.choice(("a", "world", f"n{number}")), "children": []}
        if choose.random() < 0.7:
            node["mesh"] = choose.randrange(2)
        if choose.random() < 0.5:
            node["translation"] = [choose.uniform(-1, 1) for _ in range(3)]
            node["rotation"] = np.divide(
                quaternion := [choose.gauss(0, 1) for _ in range(4)], np.hypot.reduce(quaternion)
            ).tolist()
            node["scale"] = [choose.uniform(0.5, 2) for _ in range(3)]
        elif choose.random() < 0.5:
            node["matrix"] = [1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1, 0, *(choose.uniform(-1, 1) for _ in range(3)), 1]
        parent = choose.randrange(-2, number) if number else -1
        (nodes[parent]["children"] if parent >= 0 else roots).append(number)
        nodes.append(node)
    several = {"primitives": PART["primitives"] * 3}
    path = gltf(tmp_path, nodes, roots, meshes=[PART, several])
    scene = trimesh.load_scene(path, process=False)
    expected = []
    for name in scene.graph.nodes_geometry:
        transform, geometry = scene.graph.get(name)
        expected.append(trimesh.transform_points(scene.geometry[geometry].vertices, transform))
    mesh, sources = load_mesh(path), load_face_sources(path)
    assert mesh.triangle_count == len(expected) > 10
    found, expected = mesh.vertices.reshape(-1, 9), np.reshape(expected, (-1, 9))
    distance = np.abs(found[:, None] - expected[None]).max(axis=2)
    assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 1e-4

    def placed(number):
        own = [1, 3][nodes[number]["mesh"]] if "mesh" in nodes[number] else 0
        return [number] * own + [one for child in nodes[number]["children"] for one in placed(child)]

    assert sources.node.tolist() == [one for root in roots for one in placed(root)]
    assert np.array_equal(mesh.faces.ravel(), np.arange(len(mesh.vertices)))


def test_no_primitive_of_a_mesh_is_lost_to_another_of_the_same_random_name(tmp_path, monkeypatch):
    monkeypatch.setattr(trimesh.util, "unique_id", lambda length: "0" * length)
    path = gltf(tmp_path, [{"mesh": 0}], [0], meshes=[{"primitives": PART["primitives"] * 5}])
    assert load_mesh(path).triangle_count == 5


def test_what_hangs_on_a_camera_is_read(tmp_path):
    nodes = [{"camera": 0, "children": [1]}, {"mesh": 0, "translation": [1, 0, 0]}]
    perspective = {"yfov": 1.0, "aspectRatio": 1.0, "znear": 0.1}
    path = gltf(tmp_path, nodes, [0], cameras=[{"type": "perspective", "perspective": perspective}])
    assert load_mesh(path).bounds.tolist() == [[1, 0, 0], [2, 1, 0]]


@pytest.mark.parametrize(("nodes", "roots"), [
    ([{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}], [0]),
    ([{"mesh": 0, "children": [1]}, {"mesh": 0, "children": [0]}], [0]), ([{"mesh": 0}], [0, 0]),
    ([{"mesh": 0, "children": [0]}], []),
], ids=["two parents", "circle", "two roots", "its own parent"])  # fmt: skip
def test_nodes_that_are_no_tree_are_refused_or_show_nothing(nodes, roots, tmp_path):
    with pytest.raises(InputError, match=r"its own ancestor, or has several parents|holds no triangles"):
        load_mesh(gltf(tmp_path, nodes, roots))


@pytest.mark.parametrize("mesh", [1, -1, "0", None])
def test_a_node_that_names_no_mesh_there_is_is_refused(mesh, tmp_path):
    with pytest.raises(InputError, match=f"names meshes {mesh!r}, but there are 1"):
        load_mesh(gltf(tmp_path, [{"mesh": 0}, {"mesh": mesh}], [0, 1]))


def test_a_fan_is_read_and_an_unknown_mode_refused(tmp_path):
    fan = {"primitives": [{**PART["primitives"][0], "mode": 6}]}
    assert load_mesh(gltf(tmp_path, [{"mesh": 0}], [0], meshes=[fan])).triangle_count == 1
    fan["primitives"][0]["mode"] = 7
    with pytest.raises(InputError, match="has the mode 7, expected 0 to 6"):
        load_mesh(gltf(tmp_path, [{"mesh": 0}], [0], meshes=[fan]))


def test_a_gltf_that_places_its_parts_too_often_is_refused_before_they_are_read(tmp_path):
    many = {"meshes": [{"primitives": PART["primitives"] * 1500}], "nodes": [{"mesh": 0}] * 1500}
    with pytest.raises(InputError, match=r"claims .* parts and more, which take about"):
        load_mesh(gltf(tmp_path, roots=list(range(1500)), **many))


@pytest.mark.parametrize("more", [
    {"bufferViews": [{"buffer": 0, "byteLength": 36}] + [{"buffer": 0, "byteLength": 10**7}] * 10**4},
    {"accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}]
     + [{"bufferView": 0, "componentType": 5126, "count": 10**6, "type": "MAT4"}] * 10**4},
], ids=["views", "accessors"])  # fmt: skip
def test_what_a_gltf_only_claims_is_not_read(more, tmp_path):
    assert load_mesh(gltf(tmp_path, [{"mesh": 0}], [0], **more)).triangle_count == 1


@pytest.mark.parametrize(
    ("rows", "properties", "message"),
    [(500, 900, "promises 500 rows of the element thing, but ends before"), (0, 10_000, "holds no triangles")],
)
def test_a_ply_of_more_values_than_bytes_or_of_endless_properties_is_refused(rows, properties, message, tmp_path):
    names = "".join(f"property list uchar int p{number}\n" for number in range(properties))
    path = tmp_path / "wide.ply"
    path.write_text(f"ply\nformat ascii 1.0\nelement thing {rows}\n{names}end_header\n" + "1\n" * rows)
    with pytest.raises(InputError, match=message):
        load_mesh(path)


def test_materials_hidden_in_comments_or_another_encoding_reorder_no_faces(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n# usemtl b\nf 1 2 3\n# usemtl a\nf 2 3 4\n# usemtl b\nf 3 2 1\n"
    path = tmp_path / "scene.obj"
    path.write_text(text)
    assert load_mesh(path).faces.tolist() == [[0, 1, 2], [1, 2, 3], [2, 1, 0]]
    path.write_bytes(text.replace("# ", "").encode("utf-16"))
    with pytest.raises(InputError, match="holds no triangles"):
        load_mesh(path)


def test_nothing_of_a_damaged_stl_is_logged(tmp_path, caplog):
    path = tmp_path / "box.stl"
    text = trimesh.creation.box().export(file_type="stl_ascii")
    path.write_text(text.replace("facet normal -", "facet normal one"))  # normals are not read
    assert load_mesh(path).triangle_count == 12
    path.write_text(text.replace("facet normal -", "facet normal one").replace("vertex 0.5", "vertex half", 1))
    with pytest.raises(InputError, match="is no vertex of three numbers"):
        load_mesh(path)
    assert [record for record in caplog.records if record.levelno >= logging.INFO] == []


def test_what_trimesh_only_warns_of_is_refused_in_its_words_and_nothing_is_printed(tmp_path, monkeypatch, caplog):
    def careless(*_, **__):
        logging.getLogger("trimesh.util").warning("went on without half of it")

    monkeypatch.setattr(trimesh, "load_scene", careless)
    (tmp_path / "points.xyz").write_text("0 0 0\n")
    with pytest.raises(InputError, match="went on without half of it"):
        load_mesh(tmp_path / "points.xyz")
    assert caplog.records == []
    logging.getLogger("trimesh.util").warning("elsewhere it may")
    assert len(caplog.records) == 1


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_refused_instead_of_waited_for(tmp_path):
    path = gltf(tmp_path, [{"mesh": 0}], [0], buffers=[{"byteLength": 36, "uri": "points.bin"}])
    os.mkfifo(tmp_path / "points.bin")
    os.mkfifo(tmp_path / "pipe.gltf")
    said = read_elsewhere(path, tmp_path / "pipe.gltf")
    expected = ("names 'points.bin', which is no file", "pipe.gltf is no regular file")
    assert [one in line for one, line in zip(expected, said, strict=True)] == [True, True]


def test_a_buffer_that_is_named_a_thousand_times_is_read_once(tmp_path, monkeypatch):
    names = ["points.bin", "./points.bin", "././points.bin"] * 300
    path = gltf(tmp_path, [{"mesh": 0}], [0], buffers=[{"byteLength": 36, "uri": name} for name in names])
    (tmp_path / "points.bin").write_bytes(TRIANGLE.tobytes())
    read, given = [], Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda self: read.append(self.name) or given(self))
    assert load_mesh(path).triangle_count == 1
    assert read == ["scene.gltf", "points.bin"]
