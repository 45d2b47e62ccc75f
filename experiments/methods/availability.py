"""Which peers can be used on this machine, and what is missing for the others."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from importlib import import_module, metadata

from atra.embree.library import wheel_problem
from atra.errors import InputError

PEERS = ("embreex", "trimesh", "mitsuba3", "open3d")
"""Names of the peers, in the order of tables and figures."""

MITSUBA_VARIANT = "llvm_ad_mono"
"""Vectorised, on the CPU, one colour channel; queries of rays do not depend on colour. Nothing is differentiated."""

_OPEN3D_FIRST_PYTHON_WITHOUT_WHEEL = (3, 15)  # of Open3D 0.20

_LIBRARY = re.compile(r"(lib[\w.+-]+?\.so(?:\.\d+)*): cannot open shared object file")

_DEBIAN_PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libX11.so.6": "libx11-6",
    "libgomp.so.1": "libgomp1",
    "libidn2.so.0": "libidn2-0",
    "libudev.so.1": "libudev1",
    "libusb-1.0.so.0": "libusb-1.0-0",
}
"""Where the libraries come from that Open3D's wheel expects of the system. The loader names only the first missing."""


def peer_problem(name: str) -> str | None:
    """Why the peer `name` cannot be used here, in one line with what to do about it; None when it can.

    Imports the peer's package, which takes seconds for some; whatever its import raises becomes the text.
    Raises InputError for a name that is not in `PEERS`.
    """
    if name not in PEERS:
        raise InputError(f"unknown peer {name!r}, expected one of {', '.join(PEERS)}")
    package, check = _CHECKS[name]
    try:
        return check()
    except ModuleNotFoundError as error:
        if error.name == package:
            return _not_installed(package)
        return f"{package} cannot be imported, {_one_line(error)}; {_REINSTALL}"
    except Exception as error:  # a foreign package may raise anything; without it there is a reason, not a crash
        return _broken(package, error)


def _check_embreex() -> str | None:
    import_module("embreex.rtcore_scene")
    import_module("embreex.mesh_construction")
    return None


def _check_trimesh() -> str | None:
    trimesh = import_module("trimesh")
    if not trimesh.ray.has_embree:
        return f"trimesh finds no embreex and would trace in Python; {wheel_problem() or 'pip install embreex'}"
    return None


def _check_mitsuba() -> str | None:
    mitsuba = import_module("mitsuba")
    if MITSUBA_VARIANT not in mitsuba.variants():
        return f"mitsuba was built without the variant {MITSUBA_VARIANT}; {_REINSTALL}"
    mitsuba.set_variant(MITSUBA_VARIANT)  # loads LLVM
    return None


def _check_open3d() -> str | None:
    open3d = import_module("open3d")
    return None if hasattr(open3d.t.geometry, "RaycastingScene") else f"open3d has no RaycastingScene; {_REINSTALL}"


_REINSTALL = "pip install 'atra[peers]'"

_CHECKS: dict[str, tuple[str, Callable[[], str | None]]] = {
    "embreex": ("embreex", _check_embreex),
    "trimesh": ("trimesh", _check_trimesh),
    "mitsuba3": ("mitsuba", _check_mitsuba),
    "open3d": ("open3d", _check_open3d),
}


def peer_version(name: str) -> str | None:
    """The version of the peer's package, None where it is not installed; nothing is imported."""
    try:
        return metadata.version(_CHECKS[name][0])
    except metadata.PackageNotFoundError:
        return None


def _not_installed(package: str) -> str:
    if package == "embreex" and wheel_problem() is not None:
        return f"embreex is not installed; {wheel_problem()}"
    if package == "open3d" and sys.version_info[:2] >= _OPEN3D_FIRST_PYTHON_WITHOUT_WHEEL:
        here = ".".join(map(str, sys.version_info[:2]))
        newest = f"3.{_OPEN3D_FIRST_PYTHON_WITHOUT_WHEEL[1] - 1}"
        return f"open3d is not installed and has no wheel for Python {here}; use Python {newest} or older"
    return f"{package} is not installed; {_REINSTALL}"


def _broken(package: str, error: Exception) -> str:
    text = _one_line(error)
    if package == "mitsuba" and "LLVM" in text:
        return "mitsuba finds no LLVM; install libLLVM (Debian: libllvm15) or let DRJIT_LIBLLVM_PATH name a libLLVM.so"
    missing = _LIBRARY.search(text)
    if missing is None:
        return f"{package} cannot be imported, {text}; {_REINSTALL}"
    library = missing.group(1)
    if library not in _DEBIAN_PACKAGES:
        return f"{package} cannot load {library}; install the system's package that has it"
    others = " ".join(sorted(_DEBIAN_PACKAGES.values()))
    return f"{package} cannot load {library}; install Debian's {_DEBIAN_PACKAGES[library]} (it needs all of: {others})"


def _one_line(error: Exception) -> str:
    """The error in one line, with its type, since a bare text such as 'numpy' would say nothing."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"
