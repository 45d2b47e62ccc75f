"""Methods: what can be measured, ours and other people's; adding one is a line here and its file.

The wings of the experiments and installed packages add methods by entry points, files by `method_file=...`
(`experiments.methods.outside`).
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pkgutil import resolve_name
from typing import Any

from atra.errors import InputError
from experiments.harness.entry_points import METHODS_GROUP, name_of_file, offered, offers
from experiments.harness.method import Method
from experiments.harness.options import find_named

CORE = {
    "visible_first": "experiments.methods.visible_first:VISIBLE_FIRST",
    "aligned": "experiments.methods.aligned:ALIGNED",
    "tiles": "experiments.methods.tiles:TILES",
    "pixel": "experiments.methods.pixel:PIXEL",
    "raster": "experiments.methods.raster:RASTER",
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
"""All methods: the core's in that order, those of wings and packages by name, those of files. They are imported when
this list is first asked for: a worker measures one method and imports no other."""


def __getattr__(name: str) -> Any:
    if name != "METHODS":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _methods()


def _methods() -> list[Method]:
    if "METHODS" not in globals():
        globals()["METHODS"] = [*map(resolve_name, CORE.values()), *_outside()]
    known: list[Method] = globals()["METHODS"]
    return known


def _outside(names: Iterable[str] | None = None) -> list[Method]:
    """Methods of wings, packages and files, by default all."""
    from experiments.methods.outside.loading import outside_methods

    return list(outside_methods(CORE, _method_files(), names))


def _method_files() -> list[str]:
    return [path for path in os.environ.get(METHOD_FILES, "").split(os.pathsep) if path]


def method_names() -> list[str]:
    """The names of all methods, none of which is imported for that."""
    return list(dict.fromkeys([*CORE, *offered(METHODS_GROUP), *map(name_of_file, _method_files())]))


def find_method(name: str) -> Method:
    """The method called `name`, imported alone. Raises InputError, naming those there are, for any other name."""
    if name in CORE:
        return resolve_name(CORE[name])  # type: ignore[no-any-return]
    offer = next(offers(METHODS_GROUP, [name]), None)
    if offer is not None and isinstance(offer.value, Method) and offer.value.name == name:
        return offer.value
    try:
        return find_named("method", globals().get("METHODS") or _outside([name]), name, method_names())
    except InputError as error:
        raise InputError(f"{error}; for a method of your own, give its method_file=, too") from None


def use_method_file(path: str) -> Method:
    """The method that a file defines, known from now on, here and to the processes that this one starts.

    Raises InputError as `load_file`.
    """
    from experiments.methods.outside.loading import load_file

    known = _methods()
    others = sum(not method.is_ours and method.name not in CORE for method in known)
    method = load_file(path, others, CORE, _method_files())
    known[:] = [other for other in known if other.name != method.name] + [method]
    whole = os.path.abspath(os.path.expanduser(path))
    os.environ[METHOD_FILES] = os.pathsep.join(dict.fromkeys([*_method_files(), whole]))
    return method
