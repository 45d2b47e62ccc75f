"""Peer `mitsuba3`: `Scene.ray_intersect_preliminary` on a wavefront of rays, compiled by Dr.Jit for the CPU."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from atra.geometry.mesh import Mesh
from atra.geometry.view import View
from atra.prim_ids import MISS
from experiments.methods.peers.peer import INSTALL, Answer, PeerScene, peer_method

MITSUBA_VARIANT = "llvm_ad_mono"
"""Vectorised on the CPU, with one colour channel, since ray queries need no colour."""

OLDEST_LLVM = 16
"""For paths; rays alone take older ones. 15 "cannot select" an instruction that Dr.Jit 1.5 asks for, and aborts; 19 was
tried, those between were not."""

INSTALL_LLVM = (
    f"install libLLVM {OLDEST_LLVM} or newer (Debian: libllvm19) or let DRJIT_LIBLLVM_PATH name its libLLVM.so"
)


class MitsubaScene(PeerScene):
    """`Scene.ray_intersect_preliminary(rays, coherent=True)` in the variant `llvm_ad_mono`.

    Timed: recording the query, Dr.Jit's look-up of the compiled kernel, its run until all threads are done,
    and numpy views of the two result arrays. The mark of a miss is set in the kernel. The kernel itself is compiled
    at the end of `build`, off the clock. Packets are as wide as Dr.Jit's vectors, which follow the machine. Dr.Jit
    has one pool of threads per process; every build and frame sets its size if another tracer changed it.
    """

    package = "mitsuba"
    interface = "Scene.ray_intersect_preliminary(coherent=True), llvm_ad_mono"
    setting = "fast, its default"
    rays_per_packet = 0

    def __init__(self, mesh: Mesh, camera: View, threads: int) -> None:
        self._mitsuba = mi = import_module("mitsuba")
        mi.set_variant(MITSUBA_VARIANT)
        self._drjit, self._threads = import_module("drjit"), threads
        self._use_own_threads()
        theirs = mi.Mesh("mesh", len(mesh.vertices), mesh.triangle_count)
        parameters = mi.traverse(theirs)
        parameters["vertex_positions"] = mi.Float(mesh.vertices.reshape(-1))
        parameters["faces"] = mi.UInt32(mesh.faces.reshape(-1))
        parameters.update()
        self._scene = mi.load_dict({"type": "scene", "mesh": theirs})
        self._drjit.sync_thread()  # the build runs on Dr.Jit's threads

    def make_rays(self, origins: NDArray[np.float32], directions: NDArray[np.float32]) -> Any:
        """Vectors of Dr.Jit, in memory."""
        mi = self._mitsuba
        o, d = ([mi.Float(np.ascontiguousarray(axis)) for axis in vectors.T] for vectors in (origins, directions))
        rays = mi.Ray3f(o=mi.Point3f(*o), d=mi.Vector3f(*d))
        self._drjit.make_opaque(rays)  # in memory before the clock runs, not part of the kernel
        return rays

    def warm_up(self, rays: Any) -> None:
        """Compile the kernel."""
        self.cast(rays)

    def cast(self, rays: Any) -> Answer:
        dr = self._drjit
        self._use_own_threads()
        hits = self._scene.ray_intersect_preliminary(rays, coherent=True)
        hit = hits.is_valid()
        depth = dr.select(hit, hits.t, np.inf)
        prim_id = dr.select(hit, hits.prim_index, int(MISS))
        dr.eval(depth, prim_id)
        dr.sync_thread()
        return depth.numpy(), prim_id.numpy()

    def _use_own_threads(self) -> None:
        if self._drjit.thread_count() != self._threads:
            self._drjit.set_thread_count(self._threads)


def _check() -> str | None:
    mitsuba = import_module("mitsuba")
    if MITSUBA_VARIANT not in mitsuba.variants():
        return f"mitsuba was built without the variant {MITSUBA_VARIANT}; {INSTALL}"
    try:
        mitsuba.set_variant(MITSUBA_VARIANT)  # loads LLVM
    except Exception as error:
        if "LLVM" not in str(error):
            raise
        return f"mitsuba finds no LLVM; {INSTALL_LLVM}"
    return None


MITSUBA3 = peer_method("mitsuba3", "Mitsuba 3", _check, MitsubaScene)
