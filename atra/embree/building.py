"""Wraps Embree's builds so that its threads sleep afterwards."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

from atra.embree.library import Library, device_options

_lock = threading.Lock()
_builds = 0  # of devices with one thread, going on now
_idle_device: int | None = None


@contextmanager
def building(library: Library, threads: int) -> Iterator[None]:
    """Wrap each build of a device with so many build threads.

    While no device has more than one thread, the library that Embree takes its threads from (TBB) keeps a second one
    awake after a build: it turns round and round on another core until the device is released. Embree allows as many
    threads as the device with the most has, so a device with two threads that builds nothing lets it sleep. That
    device is there between builds alone: a build with one thread keeps to it.
    """
    if threads > 1:
        yield
        return
    _begin(library)
    try:
        yield
    finally:
        _end(library)


def _begin(library: Library) -> None:
    global _builds, _idle_device
    with _lock:
        _builds += 1
        if _idle_device is not None:
            library.functions.rtcReleaseDevice(_idle_device)
            _idle_device = None


def _end(library: Library) -> None:
    global _builds, _idle_device
    with _lock:
        _builds -= 1
        if not _builds:
            _idle_device = library.functions.rtcNewDevice(device_options(threads=2))
