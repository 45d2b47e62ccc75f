"""The libembree4 library, found and loaded once per process.

The wheel of `embreex` carries the official library; `ATRA_EMBREE` names another file.
"""

from __future__ import annotations

import ctypes
import importlib.util
import os
import platform
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import llvmlite.binding

from atra.compiled.instruction_sets import check_instruction_set, limit_numba
from atra.embree import layout
from atra.embree.self_check import check_layouts
from atra.errors import EmbreeError

limit_numba()  # a process that loads no kernel asks Numba, too, which set it compiles for

OVERRIDE_VARIABLE = "ATRA_EMBREE"
SUPPORTED_VERSIONS = ((4, 4, 0), (5, 0, 0))
"""Supported versions: from the first up to, but not including, the second. `layout` describes Embree 4.4."""

_HINT = f"install it with `pip install 'embreex>=4.4,<5'`, or set {OVERRIDE_VARIABLE} to a libembree4 of version 4.4"

_WHEELS = {"linux": ("Linux", ("x86_64",)), "darwin": ("macOS", ("arm64", "x86_64")), "win32": ("Windows", ("AMD64",))}
"""Wheels of embreex 4.4: by `sys.platform`, the system's name and its machines."""

_FIRST_PYTHON_WITHOUT_WHEEL = (3, 16)

# Result and argument types by function; handles are void pointers.
_P, _U, _I, _S = ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_size_t
_SIGNATURES = {
    "rtcNewDevice": (_P, (ctypes.c_char_p,)),
    "rtcReleaseDevice": (None, (_P,)),
    "rtcGetDeviceError": (_I, (_P,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_P, _I)),
    "rtcSetDeviceMemoryMonitorFunction": (None, (_P, _P, _P)),
    "rtcNewScene": (_P, (_P,)),
    "rtcReleaseScene": (None, (_P,)),
    "rtcSetSceneBuildQuality": (None, (_P, _I)),
    "rtcSetSceneFlags": (None, (_P, _I)),
    "rtcCommitScene": (None, (_P,)),
    "rtcNewGeometry": (_P, (_P, _I)),
    "rtcReleaseGeometry": (None, (_P,)),
    "rtcSetGeometryBuildQuality": (None, (_P, _I)),
    "rtcSetSharedGeometryBuffer": (None, (_P, _I, _U, _I, _P, _S, _S, _S)),
    "rtcSetGeometryUserData": (None, (_P, _P)),
    "rtcSetGeometryIntersectFilterFunction": (None, (_P, _P)),
    "rtcSetGeometryInstancedScene": (None, (_P, _P)),
    "rtcSetGeometryTransform": (None, (_P, _U, _I, _P)),
    "rtcCommitGeometry": (None, (_P,)),
    "rtcAttachGeometry": (_U, (_P, _P)),
    "rtcAttachGeometryByID": (None, (_P, _P, _U)),
    "rtcNewBVH": (_P, (_P,)),
    "rtcBuildBVH": (_P, (_P,)),
    "rtcReleaseBVH": (None, (_P,)),
} | {
    f"rtc{query}{width}": (None, (_P,) * (3 if width == 1 else 4))
    for query in ("Intersect", "Occluded")
    for width in (1, 4, 8, 16)
}


@dataclass(frozen=True)
class Library:
    """The loaded library. functions: for ctypes; Numba knows its symbols by name."""

    path: Path
    version: tuple[int, int, int]
    native_packet_widths: tuple[int, ...]
    functions: ctypes.CDLL


@cache
def load_library() -> Library:
    """Load libembree4 and check it.

    Raises EmbreeError if no library is found or it cannot be loaded, has an unsupported version or no filter functions,
    cannot create a device, or lays out its structs differently from `layout`. Raises InputError for an instruction set
    that this machine lacks.
    """
    options = device_options(threads=1)
    path = _locate()
    try:
        functions = ctypes.CDLL(str(path))
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(functions, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise EmbreeError(f"{path} is not a usable libembree4 ({error}); {_HINT}") from error
    device = functions.rtcNewDevice(options)
    if not device:
        code = functions.rtcGetDeviceError(None)
        raise EmbreeError(f"{path} cannot create a device: {layout.ERROR_NAMES.get(code, code)}")
    try:

        def read(number: int) -> int:
            return int(functions.rtcGetDeviceProperty(device, number))

        version = _check_version(path, read(layout.DEVICE_VERSION))
        if not read(layout.DEVICE_FILTER_FUNCTION):
            raise EmbreeError(f"{path} was built without filter functions, which atra needs; {_HINT}")
        widths = (1, *(width for width, number in layout.DEVICE_NATIVE_RAY.items() if read(number)))
        try:
            check_layouts(functions, device, widths)
        except EmbreeError as error:
            raise EmbreeError(f"{path} cannot be used: {error}; {_HINT}") from None
    finally:
        functions.rtcReleaseDevice(device)
    llvmlite.binding.load_library_permanently(str(path))
    return Library(path, version, widths, functions)


def device_options(threads: int) -> bytes:
    """Options of a new device: its build threads, and the instruction set that `ATRA_ISA` names, if any."""
    instruction_set = check_instruction_set()
    return f"threads={threads}{f',isa={instruction_set}' if instruction_set else ''}".encode()


def embree_version() -> str:
    """Version of the loaded library, such as "4.4.0"."""
    return ".".join(map(str, load_library().version))


def wheel_problem() -> str | None:
    """Why pip cannot install embreex here, such as "embreex has no wheel for Linux on aarch64"; None where it can.

    It does not notice a macOS before 13 or a Linux without glibc; there pip itself reports that it finds no embreex.
    """
    system, machines = _WHEELS.get(sys.platform, (platform.system(), ()))
    here = platform.python_implementation()
    if here != "CPython":
        return f"embreex has no wheel for {here}"
    if platform.machine() not in machines:
        return f"embreex has no wheel for {system} on {platform.machine()}"
    if sys.version_info[:2] >= _FIRST_PYTHON_WITHOUT_WHEEL:
        return f"embreex has no wheel for Python {sys.version_info[0]}.{sys.version_info[1]}"
    return None


def _check_version(path: Path, number: int) -> tuple[int, int, int]:
    version = (number // 10000, number // 100 % 100, number % 100)
    first, end = SUPPORTED_VERSIONS
    if not first <= version < end:
        found, low, high = (".".join(map(str, v)) for v in (version, first, end))
        raise EmbreeError(f"{path} is Embree {found}, expected at least {low} and below {high}; {_HINT}")
    return version


def _locate() -> Path:
    override = os.environ.get(OVERRIDE_VARIABLE)
    if override:
        path = Path(override).expanduser().resolve()  # the loader would search the system for a bare name
        if not path.is_file():
            raise EmbreeError(f"{OVERRIDE_VARIABLE} is {override!r}, expected the file of a libembree4")
        return path
    spec = importlib.util.find_spec("embreex")
    if spec is None or not spec.submodule_search_locations:
        problem = wheel_problem()
        own = f"set {OVERRIDE_VARIABLE} to a libembree4 of version 4.4 of your own, such as a distribution's"
        way_out = _HINT if problem is None else f"{problem}; {own}"
        raise EmbreeError(f"the package embreex, which carries libembree4, is not installed: {way_out}")
    package = Path(next(iter(spec.submodule_search_locations)))
    found = next(_candidates(package), None)
    if found is None:
        raise EmbreeError(f"no libembree4 beside {package}; {_HINT}")
    return found


def _candidates(package: Path) -> Iterator[Path]:
    """The places where wheels have the library on Linux, macOS and Windows."""
    places = (
        (package.parent / "embreex.libs", ("libembree4*.so*", "embree4*.dll")),
        (package / ".dylibs", ("libembree4*.dylib",)),
        (package, ("embree4*.dll", "libembree4*.so*", "libembree4*.dylib")),
    )
    for folder, patterns in places:
        for pattern in patterns:
            yield from sorted(folder.glob(pattern))
