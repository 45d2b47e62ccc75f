"""Questions of rays that come from no camera, which libraries have functions for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

QUESTIONS = ("closest", "any", "count", "all", "contains")
"""closest: the first triangle that each ray hits. any: whether it hits any. count: how many. all: which ones.
contains: whether points lie inside."""

Asked = NDArray[Any] | tuple[NDArray[Any], NDArray[Any]]
"""closest: (N,) integers, -1 or `MISS` for none. any, contains: (N,) bool. count: (N,) integers. all: (M,) integers
each, the rays and the triangles of the hits."""

Answering = Callable[..., Asked]
"""Origins and directions, (N, 3) float32 each, or points alone -> the answer."""
