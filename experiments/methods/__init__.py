"""Methods: what can be measured, ours and other people's; adding one is a line here and its file."""

from __future__ import annotations

from experiments.harness.method import Method
from experiments.harness.options import find_named
from experiments.methods.aligned import ALIGNED
from experiments.methods.bvh import BVH
from experiments.methods.classified import CLASSIFIED
from experiments.methods.peers.embreex_run import EMBREEX
from experiments.methods.peers.llvmpipe import LLVMPIPE
from experiments.methods.peers.mitsuba_scene import MITSUBA3
from experiments.methods.peers.open3d_scene import OPEN3D
from experiments.methods.peers.trimesh_ray import TRIMESH
from experiments.methods.pixel import PIXEL
from experiments.methods.raster import RASTER
from experiments.methods.tiles import TILES
from experiments.methods.visible_first import VISIBLE_FIRST

METHODS: tuple[Method, ...] = (
    VISIBLE_FIRST,
    ALIGNED,
    TILES,
    PIXEL,
    RASTER,
    BVH,
    CLASSIFIED,
    EMBREEX,
    TRIMESH,
    MITSUBA3,
    OPEN3D,
    LLVMPIPE,
)
"""In the order of figures and legends."""


def find_method(name: str) -> Method:
    """The method called `name`. Raises InputError, naming those there are, for any other name."""
    return find_named("method", METHODS, name)
