"""Other ray tracers, put behind the `Tracer` protocol so that the harness measures them beside the methods of `atra`.

All four run on an Embree of their own: `embreex` and `trimesh` on the one `atra` loads, too, Mitsuba 3 and Open3D on
copies in their wheels. They get the rays of `PixelTracer` ready made, in the order of the image's rows.
"""

from __future__ import annotations

from atra.errors import InputError
from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from experiments.methods.availability import PEERS, peer_problem, peer_version
from experiments.methods.peer import PeerTracer

__all__ = ["PEERS", "PeerTracer", "make_peer", "peer_problem", "peer_version"]


def make_peer(name: str, mesh: Mesh, camera: View, threads: int | None = None) -> PeerTracer:
    """The tracer of the peer `name`, one of `PEERS`; its package is imported here.

    threads: how many trace; None takes every core.
    Raises InputError for an unknown name, for a peer that cannot be used here (with the text of `peer_problem`) and
    for threads below 1.
    """
    problem = peer_problem(name)
    if problem is not None:
        raise InputError(problem)
    if name == "embreex":
        from experiments.methods.embreex_run import EmbreexTracer

        return EmbreexTracer(mesh, camera, threads)
    if name == "trimesh":
        from experiments.methods.trimesh_ray import TrimeshTracer

        return TrimeshTracer(mesh, camera, threads)
    if name == "mitsuba3":
        from experiments.methods.mitsuba_scene import MitsubaTracer

        return MitsubaTracer(mesh, camera, threads)
    from experiments.methods.open3d_scene import Open3DTracer

    return Open3DTracer(mesh, camera, threads)
