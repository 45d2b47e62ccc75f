"""Methods: what can be measured, ours and other people's; adding one is a line here and its file.

Installed packages and files add methods without a line here (`experiments.methods.outside`).
"""

from __future__ import annotations

import os
from functools import cache
from pkgutil import resolve_name
from typing import Any

from atra.errors import InputError
from experiments.harness.method import Method
from experiments.harness.options import find_named

OWN = {
    "visible_first": "experiments.methods.visible_first:VISIBLE_FIRST",
    "aligned": "experiments.methods.aligned:ALIGNED",
    "tiles": "experiments.methods.tiles:TILES",
    "pixel": "experiments.methods.pixel:PIXEL",
    "raster": "experiments.methods.raster:RASTER",
    "bvh": "experiments.classification.own_bvh:BVH",
    "classified": "experiments.classification.classified:CLASSIFIED",
    "embreex": "experiments.methods.peers.embreex_run:EMBREEX",
    "trimesh": "experiments.methods.peers.trimesh_ray:TRIMESH",
    "mitsuba3": "experiments.methods.peers.mitsuba_scene:MITSUBA3",
    "open3d": "experiments.methods.peers.open3d_scene:OPEN3D",
    "llvmpipe": "experiments.methods.peers.llvmpipe:LLVMPIPE",
    "program": "experiments.methods.outside.program:PROGRAM",
}
"""Name -> where the method is defined, as entry points say it; in the order of figures and legends."""

METHOD_FILES = "ATRA_METHOD_FILES"
"""Environment variable with the paths of files that hold methods; processes of a run find them by it."""

METHODS: list[Method]
"""All methods in that order, those from outside last. They are imported when this list is first asked for: a worker
measures one method and imports no other."""


def __getattr__(name: str) -> Any:
    if name != "METHODS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _methods()


def _methods() -> list[Method]:
    if "METHODS" not in globals():
        globals()["METHODS"] = [*map(resolve_name, OWN.values()), *_outside()]
    found: list[Method] = globals()["METHODS"]
    return found


@cache
def _outside() -> tuple[Method, ...]:
    from experiments.methods.outside.loading import outside_methods

    return tuple(outside_methods(OWN, _method_files()))


def _method_files() -> list[str]:
    return [one for one in os.environ.get(METHOD_FILES, "").split(os.pathsep) if one]


def find_method(name: str) -> Method:
    """The method called `name`; one of ours is imported alone. Raises InputError, naming those there are, for any other
    name."""
    if name in OWN:
        return resolve_name(OWN[name])  # type: ignore[no-any-return]
    known = globals().get("METHODS") or _outside()
    try:
        return find_named("method", known, name, OWN)
    except InputError as error:
        raise InputError(f"{error}; for a method of your own, give its method_file=, too") from None


def use_method_file(path: str) -> Method:
    """The method that a file defines, known from now on, here and to the processes that this one starts.

    Raises InputError as `load_file`.
    """
    from experiments.methods.outside.loading import load_file

    known = _methods()
    method = load_file(path, len(known) - len(OWN), OWN, _method_files())
    known[:] = [one for one in known if one.name != method.name] + [method]
    whole = os.path.abspath(os.path.expanduser(path))
    os.environ[METHOD_FILES] = os.pathsep.join(dict.fromkeys([*_method_files(), whole]))
    return method
