"""Small mesh files made by code, and measures of what is read of them."""

import base64
import json
import struct
import warnings
import zipfile

import numpy as np

import atra

SQUARE = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
CORNERS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
QUADS = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
"""A box from 0 to 1 whose faces look outward."""
TRIANGLES = [half for a, b, c, d in QUADS for half in ((a, b, c), (a, c, d))]
L = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
ARROWHEAD = [(0, 0, 0), (1, -0.7, 0), (0.3, 0, 0), (1, 0.7, 0)]
"""Two triangles of area 0.3 * 0.7 / 2."""


def written(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def quiet(path, **options):
    """The mesh of a file that is read without a note."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = atra.load_mesh(path, **options)
    assert mesh.notes == ()
    return mesh


def corners_of(mesh):
    return mesh.triangles(np.arange(mesh.triangle_count))


def area(mesh):
    a, b, c = corners_of(mesh).transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def volume(mesh):
    return np.linalg.det(corners_of(mesh)).sum() / 6


def obj(vertices, faces):
    rows = ["v " + " ".join(map(str, one)) for one in vertices]
    return "\n".join(rows + ["f " + " ".join(str(k + 1) for k in face) for face in faces]) + "\n"


def off(vertices, faces):
    rows = [" ".join(map(str, one)) for one in [*vertices, *((len(face), *face) for face in faces)]]
    return f"OFF\n{len(vertices)} {len(faces)} 0\n" + "\n".join(rows) + "\n"


def ply(vertices, faces, kind="ascii", before="", after=""):
    """before, after: lines of properties of a face, each of one int that is 7."""
    head = f"ply\nformat {kind} 1.0\nelement vertex {len(vertices)}\n" + "".join(f"property float {a}\n" for a in "xyz")
    head += f"element face {len(faces)}\n{before}property list uchar int vertex_indices\n{after}end_header\n"
    if kind == "ascii":
        return head + "".join(" ".join(map(str, r)) + "\n" for r in [*vertices, *((len(f), *f) for f in faces)])
    order = "<" if "little" in kind else ">"
    body = b"".join(struct.pack(f"{order}3f", *one) for one in vertices)
    for face in faces:
        body += struct.pack(f"{order}i", 7) * bool(before) + struct.pack(f"{order}B{len(face)}i", len(face), *face)
        body += struct.pack(f"{order}i", 7) * bool(after)
    return head.encode() + body


def gltf(nodes, **more):
    """Nodes that place a box of triangles."""
    points, indices = np.array(CORNERS, "<f4").tobytes(), np.array(TRIANGLES, "<u2").tobytes()
    uri = "data:;base64," + base64.b64encode(points + indices).decode()
    return json.dumps({
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(points + indices), "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": len(points)},
                        {"buffer": 0, "byteOffset": len(points), "byteLength": len(indices)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
                      {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}],
        **more,
    })  # fmt: skip


MODEL = '<?xml version="1.0"?><model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'


def three_mf(path, items, unit="millimeter", more="", vertices=CORNERS, faces=TRIANGLES):
    """A mesh placed by the transforms of items, as in the file."""
    text = MODEL.format(unit=unit) + '<resources><object id="1" type="model"><mesh><vertices>'
    text += "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in vertices) + "</vertices><triangles>"
    text += "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces)
    text += f"</triangles></mesh></object>{more}</resources><build>"
    text += "".join(f'<item objectid="1" transform="{one}"/>' for one in items) + "</build></model>"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", text)
    return path


FORMS = {
    "obj": obj, "off": off, "ply": ply, "little.ply": lambda v, f: ply(v, f, "binary_little_endian"),
    "big.ply": lambda v, f: ply(v, f, "binary_big_endian"),
}  # fmt: skip
