"""What methods on Embree share: scenes of the geometry that they plan, and memory of their packets."""

from __future__ import annotations

from typing import Any

from atra.embree.callbacks_kernels import memory_monitor
from atra.embree.scene import EmbreeScene
from atra.embree.workspace import Workspace
from atra.geometry.view import View
from atra.tracing.geometry import AlignedGeometry
from atra.tracing.rays import share_direction


def build_scene(
    geometry: AlignedGeometry, threads: int, *, build_quality: str, robust: bool, **settings: Any
) -> EmbreeScene:
    """Build the BVH of planned geometry. settings: of `EmbreeScene`. Raises EmbreeError."""
    return EmbreeScene(
        geometry.vertices,
        geometry.faces,
        build_quality=build_quality,
        threads=threads,
        robust=robust,
        user_data=geometry.records,
        monitor_address=memory_monitor(),
        transforms=geometry.transforms,
        **settings,
    )


def make_workspaces(camera: View, packet_width: int, threads: int, coherent: bool = True) -> list[Workspace]:
    """Memory of each thread's packets for the rays of a camera, which start in ray space's origin or are parallel.

    coherent: Embree takes the rays of a packet through its tree together.
    """
    workspaces = [Workspace(packet_width, coherent=coherent) for _ in range(threads)]
    share_direction(workspaces, camera)
    return workspaces
