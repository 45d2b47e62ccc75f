"""u, v and normals: on demand they are those of the triangle that was hit, as Embree's are."""

import numpy as np

from experiments.harness.method import Tracing
from experiments.workloads.surface import surface_of, surface_tracer
from tests.images import assert_same_bits, trace
from tests.meshes import cornell_box, cornell_camera


def test_what_is_computed_on_demand_is_what_embree_hands_over():
    mesh, camera = cornell_box(), cornell_camera(67, 45)
    with surface_tracer(mesh, camera, Tracing(threads=2, ties="any")) as tracer:
        stored, surface = tracer.trace(), tracer.prepared.surface
    assert_same_bits(stored, trace("pixels", mesh, camera, ties="any", robust=False))
    u, v, normal = surface_of(trace("aligned", mesh, camera, (67, 1)))
    same = (stored.prim_id == trace("aligned", mesh, camera, (67, 1)).prim_id) & stored.hit
    assert same.mean() > 0.9
    # Triangles are handed over as `Mesh.traced_faces` has them, whose corners may be turned.
    turned = (mesh.traced_faces != mesh.faces).any(axis=1)[np.where(same, stored.prim_id, 0)]
    for own, embree in ((u, surface.u), (v, surface.v)):
        np.testing.assert_allclose(own[same & ~turned], embree[same & ~turned], atol=1e-3)
    cosine = (normal * surface.normal)[same].sum(axis=-1)
    lengths = np.linalg.norm(normal[same], axis=-1) * np.linalg.norm(surface.normal[same], axis=-1)
    np.testing.assert_allclose(np.abs(cosine) / lengths, 1, atol=1e-4)
