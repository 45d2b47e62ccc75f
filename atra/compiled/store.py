"""Compiled code on disk: shipped with the library, or kept from an earlier run.

Either is used as long as no file that the code may be made of has changed. Where there is none, where it cannot be kept
or is damaged, the code is compiled.
"""

from __future__ import annotations

import inspect
import os
import pickle
import re
import sys
import warnings
from collections.abc import Callable
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, _CacheLocator
from numba.core.ccallback import CFunc
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature

from atra.compiled.compilers import KernelCompiler, PartCompiler
from atra.compiled.instruction_sets import limit_numba
from atra.compiled.locks import lock_between_processes

limit_numba()

_PACKAGE = Path(__file__).parents[1]

SHIPPED = _PACKAGE / "compiled" / "shipped"
"""Folder of the kernels that a wheel brings along, in folders by room; a clone has none."""

INTO_VARIABLE = "ATRA_COMPILE_INTO"
"""Names a folder to keep compiled kernels in, in folders by room, where all are compiled to be shipped."""

_AS_IN_C = {"error_model": "numpy", "_nrt": False}
"""Numba's options for division as in C, and for no counting of references."""

QUIET_VARIABLE = "ATRA_QUIET"
"""Set to anything but 0, nothing is said of compiling."""

_IMPORT = re.compile(rb"^ *(?:import +(\w[.\w]*)|from +(\w[.\w]*) +import +(\([^)]*\)|.*))", re.MULTILINE)
"""An import: a module, or a module and the names taken from it, which may be modules, too."""


def source_stamp(path: Path) -> bytes:
    """Changes with the text of every file that the kernels in `path` may be made of, but not with a file's time: a new
    clone in the same place can use what an earlier one has kept, if both keep it in the folder NUMBA_CACHE_DIR."""
    return sha256(b"".join(source.read_bytes() for source in sorted(sources(path)))).digest()


@cache
def sources(path: Path) -> frozenset[Path]:
    """The file and those that it imports, directly or through others, of this library and of its own package."""
    found, left = set[Path](), [path]
    while left:
        one = left.pop()
        if one not in found:
            found.add(one)
            left += _imported_by(one)
    return frozenset(found)


@cache
def _imported_by(path: Path) -> tuple[Path, ...]:
    own = path.parent
    while (own.parent / "__init__.py").exists():
        own = own.parent
    packages, named = {own.name: own, _PACKAGE.name: _PACKAGE}, set[Path]()
    for module, package, names in _IMPORT.findall(path.read_bytes()):
        first, *rest = (module or package).decode().split(".")
        if first in packages:
            place = packages[first].joinpath(*rest)
            named |= {place, *(place / name for name in re.findall(r"\w+", names.decode()))}
    files = [place / "__init__.py" if place.is_dir() else place.with_suffix(".py") for place in named]
    return tuple(file for file in files if file.exists())


def cache_folder() -> str | None:
    """Where compiled kernels are kept; None where nothing can be written: every process then compiles them again."""
    folder = _Cache(kernel).cache_path
    return str(folder) if folder else None


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile `function` when it is first called, to run without the GIL, and keep the code on disk."""
    compiled = keep_on_disk(numba.njit(nogil=True, pipeline_class=KernelCompiler, **options)(function))
    compiled.get_call_template = _refuse_call
    return compiled


def _refuse_call(*_: Any) -> Any:
    """Kernels cannot be called by compiled code: on disk they keep machine code alone, which cannot be linked."""
    raise TypeError("compiled code calls a kernel; make what kernels call with njit or float_part")


def float_kernel(function: Callable[..., Any]) -> Any:
    """As `kernel`, for loops that shall be as fast as C's: a division by zero gives inf or NaN, and arrays are used
    without reference counting. Such a kernel can make no arrays."""
    return kernel(function, **_AS_IN_C)


def float_part(function: Callable[..., Any]) -> Any:
    """As `float_kernel`, for a function that kernels call."""
    return njit(function, **_AS_IN_C)


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Numba's `njit` for a function that kernels call. It gets no wrappers for calls from Python and C: compiling them
    takes as long as a small function itself. A call from Python compiles the function again, with Numba's `njit`."""
    if function is None:
        return partial(njit, **options)
    wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    called = numba.njit(pipeline_class=PartCompiler, **wrappers, **options)(function)
    called._insert = lambda *_, **__: None  # keeps Numba from running a wrapper that is not there
    called._compile_for_args = lambda *_, **__: _for_python(function, **options)  # what Numba calls instead
    return called


@cache
def _for_python(function: Callable[..., Any], **options: Any) -> Any:
    return numba.njit(**options)(function)


def callback(signature: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile a function for C to call, at once, and keep the code on disk. The compiled one has an `address`."""

    def compiled(function: Callable[..., Any]) -> Any:
        kind = normalize_signature(signature)
        callback = keep_on_disk(CFunc(function, kind, locals={}, options={}, pipeline_class=KernelCompiler))
        callback.compile()
        return callback

    return compiled


def keep_on_disk(compiled: Any) -> Any:
    """The same `njit` function or C callback, made without `cache=True`, with this cache in place of none."""
    compiled._cache = _Cache(compiled.__wrapped__)
    return compiled


@cache
def _say_compiling() -> None:
    if os.environ.get(QUIET_VARIABLE, "0") in ("", "0") and sys.stderr is not None:
        print("atra: compiling kernels for this machine, once", file=sys.stderr, flush=True)


@cache
def _warn(reason: str) -> None:
    warnings.warn(
        f"compiled code cannot be kept ({reason}), so every run compiles again; NUMBA_CACHE_DIR names another folder",
        stacklevel=1,
    )


class _Nowhere(_CacheLocator):
    """Stands for a folder where none can be written to, neither beside the source nor in the home directory."""

    @classmethod
    def from_function(cls, function: Any, path: str) -> Any:
        place = cls()
        place.line = str(function.__code__.co_firstlineno)
        return place

    line = "0"

    def get_cache_path(self) -> str:
        return ""

    def get_source_stamp(self) -> Any:
        return None

    def get_disambiguator(self) -> str:
        return self.line


class _Sealed(CompileResultCacheImpl):
    """Code with a digest: flipped bits would be run as they are."""

    _locator_classes = (*CompileResultCacheImpl._locator_classes, _Nowhere)

    def reduce(self, cres: Any) -> Any:
        code = dumps(super().reduce(cres))
        return sha256(code).digest(), code

    def rebuild(self, target_context: Any, reduced_data: Any) -> Any:
        digest, code = reduced_data
        if sha256(code).digest() != digest:
            raise ValueError("damaged")
        return super().rebuild(target_context, pickle.loads(code))


class _Index(IndexDataCacheFile):
    """Files that say whose code they hold: two processes that keep some at once may give them one name."""

    def save(self, key: Any, data: Any) -> None:
        super().save(key, (key, self._source_stamp, data))

    def load(self, key: Any) -> Any:
        kept = super().load(key)
        return kept[2] if kept is not None and kept[:2] == (key, self._source_stamp) else None

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:  # a damaged pickle may raise anything
            return {}


class _Cache(FunctionCache):
    """Numba runs kept code as long as the file of the function itself is the same. Kernels inline functions of other
    files and their constants, so here the text of all these files counts: older code would otherwise be run after an
    update.
    """

    _impl_class = _Sealed

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        source, into = Path(inspect.getfile(function)), os.environ.get(INTO_VARIABLE)
        base, stamp = self._impl.filename_base, source_stamp(source)
        room = source.parent.relative_to(_PACKAGE) if source.is_relative_to(_PACKAGE) else Path()
        if into:
            self._cache_path = str(Path(into) / room)
        self._shipped = None if into or not SHIPPED.is_dir() else _Index(str(SHIPPED / room), base, stamp)
        self._cache_file = _Index(self._cache_path, base, stamp)
        self._lock: Any = None

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is shipped or kept; else None, after which Numba compiles and saves. Of two processes that need the
        same, one compiles while the other waits for it here."""
        if not self._enabled:
            return None
        found = self._found(sig, target_context)
        if found is None and self._cache_path:
            self._lock, has_waited = lock_between_processes(Path(self._cache_path) / f"{self._impl.filename_base}.lock")
            if has_waited:
                found = self._found(sig, target_context)
        if found is None:
            _say_compiling()
        elif self._lock is not None:
            self._lock.release()
        return found

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        limit_numba()  # Numba forgets it when a variable NUMBA_... changes, though not the code that it makes
        return super()._index_key(sig, codegen)

    def _found(self, sig: Any, target_context: Any) -> Any:
        key = self._index_key(sig, target_context.codegen())
        for index in (self._shipped, self._cache_file):
            try:
                data = None if index is None else index.load(key)
                if data is not None:
                    rtsys.initialize(target_context)  # all that machine code needs; compiling loads far more of Numba
                    return self._impl.rebuild(target_context, data)
            except Exception:  # a damaged pickle may raise anything; saving replaces what is kept
                continue
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            if not self._cache_path:
                _warn("no folder for it can be written to")
            else:
                super().save_overload(sig, data)
        except OSError as error:
            _warn(f"{self.cache_path}: {error.strerror or error}")
        finally:
            if self._lock is not None:
                self._lock.release()
