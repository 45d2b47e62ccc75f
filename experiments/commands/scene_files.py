"""A scene as files that other programs read, and `atra judge`: its triangles as PLY, its own view as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from atra.geometry.mesh import Mesh
from scenes.scene import Scene


def ply_of(mesh: Mesh) -> bytes:
    """The triangles as a binary PLY file, little-endian: corners of the mesh's type, in its order, to the last bit."""
    kind, number = ("double", "<f8") if mesh.has_origin else ("float", "<f4")
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
        f"property {kind} x\nproperty {kind} y\nproperty {kind} z\n"
        f"element face {mesh.triangle_count}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    faces = np.empty(mesh.triangle_count, [("corners", "u1"), ("vertices", "<i4", 3)])
    faces["corners"], faces["vertices"] = 3, mesh.faces
    return header.encode() + np.ascontiguousarray(mesh.vertices, number).tobytes() + faces.tobytes()


def cameras_of(scene: Scene, sizes: Mapping[str, int]) -> bytes:
    """The scene's own view as a camera of each size, by name, as JSON that `atra render` and `atra judge` read. sizes:
    name -> pixels along each side."""
    return json.dumps(
        {name: {**scene.camera, "width": side, "height": side} for name, side in sizes.items()}, indent=1
    ).encode()
