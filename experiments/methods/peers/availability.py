"""Foreign packages: whether they can be used on this machine, and what is missing for those that cannot."""

from __future__ import annotations

import re
from collections.abc import Callable

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


_REINSTALL = "pip install 'atra[peers]'"


def package_problem(package: str, check: Callable[[], str | None], no_wheel: Callable[[], str | None]) -> str | None:
    """Why a foreign package cannot be used here, in one line with what to do about it; None when it can.

    check: imports the package, which takes seconds for some, and returns what is wrong with it; whatever it raises
    becomes the text. no_wheel: why it cannot be installed here, None = it can.
    """
    try:
        return check()
    except ModuleNotFoundError as error:
        if error.name == package:
            return f"{package} is not installed; {no_wheel() or _REINSTALL}"
        return f"{package} cannot be imported, {_one_line(error)}; {_REINSTALL}"
    except Exception as error:  # a foreign package may raise anything; without it there is a reason, not a crash
        return _broken(package, error)


def reinstall(what: str) -> str:
    """A problem with a package that is there, and what to do about it."""
    return f"{what}; {_REINSTALL}"


def _broken(package: str, error: Exception) -> str:
    text = _one_line(error)
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
