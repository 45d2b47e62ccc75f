"""The packet loop with all threads of a pool."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from atra.compiled.threads import WorkerPool
from atra.embree.packets_kernels import PixelTiles, RayGrid, TracedImage
from atra.embree.workspace import Workspace, check_widths
from atra.geometry.ray_space import ray_axes
from atra.geometry.view import View
from atra.packets.loop_kernels import NEAREST, Limits, packet_kernel

_NO_IMAGE = TracedImage(np.empty((0, 0), np.float32), np.empty((0, 0), np.uint32))
_NO_LIMITS = np.empty(0, np.float32)


class Packets(NamedTuple):
    """Rays to trace in packets.

    scene: address of the BVH. shape: columns and rows of pixels in a packet. camera: whose rays they are; parallel ones
    share a direction but not an origin. rays, tiles, size, row_stride, cell_rows: as for `packet_kernel`. kind: NEAREST
    or another of the loop's. is_alone: packets overlap others' pixels, so one thread traces them all.
    """

    scene: int
    shape: tuple[int, int]
    camera: View
    rays: RayGrid | NDArray[np.float32]
    tiles: PixelTiles
    size: tuple[int, int]
    kind: int = NEAREST
    row_stride: int = 0
    cell_rows: int = 0
    is_alone: bool = False


def trace_packets(
    packets: Packets,
    workspaces: Sequence[Workspace],
    pool: WorkerPool,
    image: TracedImage = _NO_IMAGE,
    nearest: NDArray[np.float32] = _NO_LIMITS,
) -> int:
    """Trace rays into an image, or into what a filter writes. nearest: of `Limits`.

    Returns how many packets were traced, which only NEARER counts. Raises EmbreeError where a filter was given packets
    of another width than were sent.
    """
    camera = packets.camera
    kernel = packet_kernel(*packets.shape, packets.kind, camera.is_parallel)
    direction = ray_axes(camera)[2].tolist() if camera.is_parallel else None
    for workspace in workspaces:
        workspace.set_row_bytes(4 * packets.row_stride)
        if direction is not None:
            workspace.set_direction(direction)
    given = packets.rays, packets.tiles, packets.size, packets.row_stride, packets.cell_rows, image
    traced = np.zeros((len(workspaces), 16), np.int64)  # a cache line and more for each thread

    def work(worker: int, counter: int) -> None:
        kernel(counter, packets.scene, workspaces[worker].packet, *given, Limits(nearest, traced[worker]))

    pool.run(work, 1 if packets.is_alone else pool.threads)
    check_widths(workspaces)
    return int(traced[:, 0].sum())
