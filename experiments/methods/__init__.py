"""Methods: what can be measured, ours and other people's; adding one is a line here and its file.

Installed packages and files add methods without a line here (`experiments.methods.outside`).
"""

from __future__ import annotations

import os

from atra.errors import InputError
from experiments.harness.method import Method
from experiments.harness.options import find_named
from experiments.methods.aligned import ALIGNED
from experiments.methods.bvh import BVH
from experiments.methods.classified import CLASSIFIED
from experiments.methods.outside.loading import METHOD_FILES, load_file, method_files, outside_methods
from experiments.methods.outside.program import PROGRAM
from experiments.methods.peers.embreex_run import EMBREEX
from experiments.methods.peers.llvmpipe import LLVMPIPE
from experiments.methods.peers.mitsuba_scene import MITSUBA3
from experiments.methods.peers.open3d_scene import OPEN3D
from experiments.methods.peers.trimesh_ray import TRIMESH
from experiments.methods.pixel import PIXEL
from experiments.methods.raster import RASTER
from experiments.methods.tiles import TILES
from experiments.methods.visible_first import VISIBLE_FIRST

_OWN: tuple[Method, ...] = (
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
    PROGRAM,
)
_TAKEN = frozenset(one.name for one in _OWN)

METHODS: list[Method] = [*_OWN, *outside_methods(_TAKEN)]
"""In the order of figures and legends."""


def find_method(name: str) -> Method:
    """The method called `name`. Raises InputError, naming those there are, for any other name."""
    try:
        return find_named("method", METHODS, name)
    except InputError as error:
        raise InputError(f"{error}; for a method of your own, give its method_file=, too") from None


def use_method_file(path: str) -> Method:
    """The method that a file defines, known from now on, here and to the processes that this one starts.

    Raises InputError as `load_file`.
    """
    others = len(METHODS) - len(_OWN)
    method = load_file(path, others, _TAKEN)
    METHODS[:] = [one for one in METHODS if one.name != method.name] + [method]
    whole = os.path.abspath(os.path.expanduser(path))
    os.environ[METHOD_FILES] = os.pathsep.join(dict.fromkeys([*method_files(), whole]))
    return method
