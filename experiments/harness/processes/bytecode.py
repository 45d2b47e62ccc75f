"""Bytecode of workers: a folder that Python keeps it in while a sweep runs, where it keeps none beside the sources."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import SourceFileLoader
from pathlib import Path

_NAME = ".bytecode"

_ROOM_BYTES = 1 << 28
"""Free space below which the folder is not used: Python 3.11 takes bytecode that a full disk cut short for whole."""

_CUT_SHORT = "marshal data"
"""What Python says of such bytecode."""


@contextmanager
def bytecode_folder(results: Path) -> Iterator[None]:
    """Let workers keep bytecode in a folder of `results`, unless all of it lies beside the sources already.

    Without it, each worker compiles anew what packages were installed without bytecode, or, with
    PYTHONDONTWRITEBYTECODE, came without it. A folder that cannot be made makes workers slower, and nothing else.
    """
    folder = results / _NAME
    # What a killed run left, or what came with somebody's results: bytecode is run, so only that of this run is.
    shutil.rmtree(folder, ignore_errors=True)
    if not _is_beside_sources():
        with suppress(OSError):
            folder.mkdir(mode=0o700)
    try:
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@cache
def _is_beside_sources() -> bool:
    """Whether Python found, or has put, bytecode of all that this process has imported where it looks for it."""
    specs = [getattr(module, "__spec__", None) for module in list(sys.modules.values())]
    return all(
        _is_compiled(spec.origin, spec.cached)
        for spec in specs
        if spec is not None and type(spec.loader) is SourceFileLoader
    )


def _is_compiled(source: str | None, cached: str | None) -> bool:
    if source is None or cached is None:
        return True
    try:
        return Path(cached).stat().st_mtime >= Path(source).stat().st_mtime
    except OSError:
        return False


def variables(results: Path | None) -> dict[str, str]:
    """Environment variables by which a worker uses the folder of these results; none where that is of no use."""
    if results is None:
        return {}
    folder = (results / _NAME).absolute()
    try:
        is_usable = folder.is_dir() and shutil.disk_usage(folder).free >= _ROOM_BYTES
    except OSError:
        is_usable = False
    return {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(folder)} if is_usable else {}


def forget_if_cut_short(used: dict[str, str], said: str) -> bool:
    """Remove the folder if a worker that used it failed and `said` that its bytecode is not whole, which others would
    fail of, too. used: its `variables`. Returns whether that was so."""
    if not used or _CUT_SHORT not in said:
        return False
    shutil.rmtree(used["PYTHONPYCACHEPREFIX"], ignore_errors=True)
    return True
